"""Solution of the equations of an ensemble, its covariance, and tests of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import linalg

from ankleloop.methods.ensemble.equations import EnsembleEquations
from ankleloop.methods.riv.alternatives import normal_score
from ankleloop.methods.riv.equations import ABSENT_REFLEX, SHOWN_REFLEX, Parameters
from ankleloop.methods.riv_tv.solution import CONVERGED, LARGEST_STEPS, NEGLIGIBLE_STEP
from ankleloop.signals.least_squares import TINY, invert_scaled, solve_scaled

MOST_ROUNDS = 20
FEWEST_ROUNDS = 3
FULL_ROUNDS = 6  # with whole steps
LARGEST_BIAS = 0.5  # standard errors that a bias may have
PERMUTATIONS = 199
PERMUTATION_SEED = 20


@dataclass(frozen=True, eq=False)
class EnsembleSolution:
    """The equations at some parameters, with weights and instruments of these parameters."""

    equations: EnsembleEquations
    parameters: Parameters
    # Shape (C - 1,) or (0,): of the torque of all conditions but the first [N·m].
    offsets: np.ndarray
    converged: bool = False

    @cached_property
    def columns(self) -> np.ndarray:
        """Derivatives of the torque by the unknowns, shape (unknowns, trials, T)."""
        return self.equations.columns(self.parameters)

    @cached_property
    def residual(self) -> np.ndarray:
        """Torque less that of the model, and less the mean of both over all trials, shape (trials, T)."""
        linear = self.parameters.linear.size
        model = np.tensordot(self.parameters.linear, self.columns[:linear], 1)
        shifts = np.tensordot(self.offsets, self.equations.offsets, 1)
        residual = self.equations.torque - model - shifts
        return residual - residual.mean(axis=0)

    @cached_property
    def weights(self) -> np.ndarray:
        """Whitening matrix of each trial, shape (trials, T, T)."""
        return self.equations.find_weights(self.residual)

    def _whiten(self, signals: np.ndarray) -> np.ndarray:
        """Signals of the trials, white over the window; shapes (..., trials, T)."""
        return np.einsum("...nt,ntu->...nu", signals, self.weights, optimize=True)

    @cached_property
    def white_columns(self) -> np.ndarray:
        """Columns less their means over all trials, white."""
        return self._whiten(self.columns - self.columns.mean(axis=1, keepdims=True))

    @cached_property
    def white_instruments(self) -> np.ndarray:
        """Instruments, white."""
        return self._whiten(self.equations.make_instruments(self.columns))

    @cached_property
    def white_residual(self) -> np.ndarray:
        """Residual, white."""
        return self._whiten(self.residual)

    @cached_property
    def contributions(self) -> np.ndarray:
        """Contributions of the trials to the left side of the equations, shape (trials, unknowns)."""
        return np.einsum("pnt,nt->np", self.white_instruments, self.white_residual)

    @cached_property
    def trial_normals(self) -> np.ndarray:
        """Contributions of the trials to the matrix of the equations, shape (trials, unknowns, unknowns)."""
        return np.einsum("pnt,qnt->npq", self.white_instruments, self.white_columns, optimize=True)

    @cached_property
    def normal(self) -> np.ndarray:
        """Matrix of the equations, shape (unknowns, unknowns)."""
        return self.trial_normals.sum(axis=0)

    @cached_property
    def information(self) -> np.ndarray:
        """Matrix of the equations with the means of all trials of a condition as instruments, shape as `normal`.

        Unlike `normal` it is symmetric and positive, so a step by it goes the right way where the instruments are weak.
        """
        windows = self.equations.windows
        means = windows.average(self.columns) - self.columns.mean(axis=1, keepdims=True)
        white = self._whiten(means[:, windows.groups])
        return np.einsum("pnt,qnt->pq", white, white, optimize=True)

    def find_step(self) -> np.ndarray:
        """Step of the unknowns that goes towards the solution, shape (unknowns,).

        That of Gauss and Newton, which `information` damps where the instruments are weak. Dynamics and delay move by
        no more than they may, and the others go with them.
        """
        size = self.parameters.linear.size
        side = self.contributions.sum(axis=0)
        step = solve_scaled(self.information, side)
        largest = np.array([LARGEST_STEPS[name] for name in self.parameters.unknowns])
        bound = slice(size, size + largest.size)
        limited = np.clip(step[bound], -largest, largest)
        free = np.delete(np.arange(step.size), np.arange(size, size + largest.size))
        rest = side[free] - self.information[free, bound] @ limited
        step[free] = solve_scaled(self.information[np.ix_(free, free)], rest)
        step[bound] = limited
        return step

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance of the unknowns: squares of the influences of the trials, shape (unknowns, unknowns).

        The influence of a trial is the step that it makes in the equations without it.
        """
        scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(self.normal)), TINY))
        others = (self.normal - self.trial_normals) * (scale[:, None] * scale)
        sides = (self.contributions * scale)[:, :, None]
        influences = scale * np.linalg.solve(others, sides)[:, :, 0]
        return influences.T @ influences

    @property
    def bias(self) -> np.ndarray:
        """Bias of the unknowns by weak instruments, to second order in the noise, shape (unknowns,).

        The noise of a trial is in the matrix A of the equations twice: in its columns, and in the instruments that it
        is part of for others. With its part B of the matrix and its contribution c, which feedback correlates, the
        solution is off by the mean of -A⁻¹ (B + Bᵀ) A⁻¹ c over the noise. Where that is large it is not known.
        """
        inverse = invert_scaled(self.normal)
        influences = self.contributions @ inverse.T
        parts = self.trial_normals + self.trial_normals.swapaxes(1, 2)
        bias = -inverse @ np.einsum("npq,nq->p", parts, influences)
        limits = LARGEST_BIAS * np.sqrt(np.diag(self.covariance))
        size = self.parameters.linear.size
        for number, name in enumerate(self.parameters.unknowns, size):
            limits[number] = min(limits[number], LARGEST_STEPS[name])
        return np.clip(bias, -limits, limits)

    @property
    def delay(self) -> float:
        """Delay of the reflex [s]."""
        return self.equations.delay + self.parameters.shift

    @property
    def names(self) -> list[str]:
        """Names of the unknowns but the offsets."""
        intrinsic = ["K", "B", "I", "K_slope"][: self.parameters.linear.size - 1]
        return [*intrinsic, "G", *self.parameters.unknowns]

    @property
    def rows(self) -> dict[str, np.ndarray]:
        """Slopes of the parameters, or of their logarithms, by the unknowns."""
        return dict(zip(self.names, np.eye(len(self.columns)), strict=False))

    @property
    def reflex_score(self) -> float:
        """Normal score of the reflex gain."""
        place = slice(self.parameters.linear.size - 1, self.parameters.linear.size)
        return abs(normal_score(self.parameters.linear[place], self.covariance[place, place]))

    @property
    def strength(self) -> float:
        """F statistic of the direction in which the conditions differ least.

        The smallest eigenvalue of the matrix of the equations, against what the scatter of the columns within the
        conditions would give in means, plus one.
        """
        windows = self.equations.windows
        within = self._whiten(self.columns - windows.average(self.columns)[:, windows.groups])
        scatter = np.einsum("pnt,qnt->pq", within, within, optimize=True)
        scatter *= (windows.sizes.size - 1.0) / (windows.groups.size - windows.sizes.size)
        size = self.columns.shape[0] - len(self.offsets)  # offsets have no scatter
        scatter = scatter[:size, :size]
        normal = self.normal
        if len(self.offsets):
            shifted = solve_scaled(normal[size:, size:], normal[size:, :size])
            normal = normal[:size, :size] - normal[:size, size:] @ shifted
        symmetric = 0.5 * (normal + normal.T)
        scale = 1.0 / np.sqrt(np.diag(scatter))
        scaled = scale[:, None] * scale
        return float(1.0 + linalg.eigvalsh(symmetric * scaled, scatter * scaled)[0])

    @cached_property
    def _unexplained(self) -> np.ndarray:
        """Sizes of the differences between conditions that the parameters cannot explain, shape (1 + permutations,).

        First those of the residual, then those where the conditions are permuted over the trials.
        """
        windows = self.equations.windows
        weights = self._contrasts
        explained = (weights @ self.white_columns).reshape(len(self.columns), -1)
        basis = np.linalg.qr(explained.T)[0]
        generator = np.random.default_rng(PERMUTATION_SEED)
        orders = [generator.permutation(windows.groups.size) for _ in range(PERMUTATIONS)]
        permuted = weights[:, [np.arange(windows.groups.size), *orders]].swapaxes(0, 1)
        contrasts = (permuted @ self.white_residual).reshape(PERMUTATIONS + 1, -1)
        left = contrasts - (contrasts @ basis) @ basis.T
        return np.sum(left**2, axis=1)

    @property
    def _contrasts(self) -> np.ndarray:
        """Weights of the trials in the mean of each condition, as it counts, shape (C, trials)."""
        windows = self.equations.windows
        members = windows.groups == np.arange(windows.sizes.size)[:, None]
        return members / np.sqrt(windows.sizes)[:, None]

    @property
    def incomplete_p(self) -> float:
        """Probability of such differences at least as large, were the model complete."""
        return float(np.mean(self._unexplained >= self._unexplained[0]))

    @property
    def incomplete_share(self) -> float:
        """How much of the differences of the torque they are, beyond chance."""
        torque = self.equations.torque
        differences = self._contrasts @ self._whiten(torque - torque.mean(axis=0))
        beyond = self._unexplained[0] - self._unexplained[1:].mean()
        return float(beyond / np.sum(differences**2))

    def remove_bias(self) -> EnsembleSolution:
        """The solution less its bias; one that is refused for its strength has no bias of any use."""
        return replace(self.advance(-self.bias), converged=self.converged)

    def advance(self, step: np.ndarray) -> EnsembleSolution:
        """Solution after a step of the unknowns."""
        size = step.size - self.offsets.size
        return EnsembleSolution(
            equations=self.equations,
            parameters=self.parameters.add(step[:size]).limit_delay(self.equations.delay),
            offsets=self.offsets + step[size:],
        )


def solve_ensemble(equations: EnsembleEquations) -> EnsembleSolution:
    """Solve the equations, for a passive joint where the windows show no reflex; else with its dynamics."""
    start = EnsembleSolution(equations, *equations.find_start())
    solution = _search(start)
    if not solution.converged or solution.reflex_score <= SHOWN_REFLEX:
        passive = _search(replace(start, parameters=solution.parameters.without_reflex()))
        if passive.converged and passive.reflex_score < ABSENT_REFLEX:
            solution = passive
    return solution


def _search(solution: EnsembleSolution) -> EnsembleSolution:
    """Solution that steps of Gauss and Newton reach; weights and instruments are renewed in each round."""
    size = solution.parameters.linear.size
    unknowns = solution.parameters.unknowns
    largest = np.array([LARGEST_STEPS[name] for name in unknowns])
    for number in range(1, MOST_ROUNDS + 1):
        step = solution.find_step()
        errors = np.sqrt(np.diag(solution.covariance))
        moves = np.abs(step[size : size + len(unknowns)])
        small = np.all(np.abs(step) <= CONVERGED * errors)
        negligible = np.max(moves / largest, initial=0.0) < NEGLIGIBLE_STEP
        if number > FEWEST_ROUNDS and (small or negligible):
            return replace(solution, converged=True)
        # Weights that follow the residual can make the rounds swing about a solution.
        solution = solution.advance(step if number <= FULL_ROUNDS else 0.5 * step)
    return solution
