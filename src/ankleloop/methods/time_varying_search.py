"""Solution of the equations of `riv-tv`: rounds of linear solutions, smoothing, dynamics and weights."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ankleloop.joint.dynamics import ReflexDynamics, respond
from ankleloop.methods.riv_equations import DELAY_LIMITS, fit_grid, solve_scaled
from ankleloop.methods.time_varying_equations import TimeVaryingEquations, TimeVaryingParameters, WhitenedSystem
from ankleloop.signals.spectra import smooth

MOST_ROUNDS = 30
LARGEST_STEPS = {"omega_n": 0.3, "zeta": 0.3, "pole": 0.3, "delay": 0.008, "torque_lag": 0.004}
CONVERGED = 0.02  # of its standard error: largest step of a parameter of the dynamics
SMOOTHING_STEPS = 5  # of the penalties in one round
LARGEST_PENALTY, SMALLEST_PENALTY = 1e8, 1e-8  # in units of the information over the penalty
RENEWED = 1e-4  # s: change of the delay for which inputs are made anew


@dataclass(frozen=True, eq=False)
class TimeVaryingSolution:
    """Parameters that solve the equations, and the system at them."""

    equations: TimeVaryingEquations  # the equations
    parameters: TimeVaryingParameters  # their solution
    system: WhitenedSystem  # whitened system with its regressors at the solution
    penalties: np.ndarray  # shape (4,): weights of the penalties of K, B, G and I
    variance: float  # variance of the whitened noise at a frequency of the band
    spectrum: np.ndarray  # spectrum of the noise that the weights are the inverse of
    rounds: int  # number of rounds
    converged: bool  # whether the dynamics of the reflex moved no more

    @property
    def matrix(self) -> np.ndarray:
        """Penalised normal equations of all unknowns."""
        matrix = self.system.normal.copy()
        size = self.equations.bases.size
        matrix[:size, :size] += self.equations.bases.penalty(self.penalties)
        return matrix

    @property
    def freedom(self) -> np.ndarray:
        """Effective number of parameters of K, B, G and I, shape (4,)."""
        bases, size = self.equations.bases, self.equations.bases.size
        information = self.system.information
        penalised = information.copy()
        penalised[:size, :size] += bases.penalty(self.penalties)
        hat = solve_scaled(penalised, information)
        return np.array([np.trace(hat[block, block]) for block in bases.blocks])


def solve_time_varying(equations: TimeVaryingEquations) -> TimeVaryingSolution:
    """Solve the equations, from the best of a grid of dynamics for constant parameters.

    A round solves the linear equations with weights and instruments of the point where it begins, chooses the
    penalties (`choose_penalties`), makes a step of the dynamics and of the delays, and renews the weights.
    """
    parameters, penalties = _start(equations), np.ones(len(equations.bases.all))
    level = np.ones(equations.rows.stop - equations.rows.start)
    converged = False
    for count in range(1, MOST_ROUNDS + 1):
        noise = equations.noise(parameters)
        weight = equations.weight(noise)
        level = equations.level(noise, weight)
        system = equations.system(parameters, weight, level)
        if count == 1:
            penalties = _scale_penalties(equations, system)
        solution, penalties, variance = choose_penalties(equations, system, penalties)
        spectrum = equations.spectrum(noise)
        if converged:
            parameters = replace(parameters, linear=solution[: equations.bases.size])
            break
        parameters, converged = _step(equations, parameters, system, solution, variance)
        if abs(parameters.shift) > RENEWED:
            parameters = equations.move_delay(parameters)
        converged = converged and count > 2
    return TimeVaryingSolution(equations, parameters, system, penalties, variance, spectrum, count, converged)


def _start(equations: TimeVaryingEquations) -> TimeVaryingParameters:
    """Best of a grid of dynamics for parameters that are constant, by the predicted inputs."""
    bases = equations.bases
    ones = np.zeros((4, bases.size))
    k, b, g, i = bases.blocks
    ones[0, k], ones[1, b], ones[2, i], ones[3, g] = 1.0, 1.0, 1.0, 1.0
    inside, s = equations.inside, equations.inputs.s[equations.inside]
    motion = ones[:3, : g.start] @ equations.predicted_motion[:, inside]
    drive, target = equations.predicted_drive[:, inside].sum(axis=0), equations.torque[inside]
    noise, grid = np.ones(s.size), ReflexDynamics.grid(equations.order)
    filters = respond(grid, s)
    width = equations.resolution * equations.inputs.size / equations.inputs.rate
    for _ in range(2):
        linear, best, residual = fit_grid(motion, drive[None], target, filters, noise)
        noise = smooth(np.abs(residual) ** 2, width)
        noise = np.maximum(noise, 1e-10 * noise.max())
    return TimeVaryingParameters(linear @ ones, grid[best], lag=equations.torque_lag)


def _scale_penalties(equations: TimeVaryingEquations, system: WhitenedSystem) -> np.ndarray:
    """Penalties that weigh as much as the data."""
    bases, information = equations.bases, np.diag(system.information)
    return np.array(
        [
            np.sum(information[block]) / max(np.trace(splines.penalty), 1.0)
            for splines, block in zip(bases.all, bases.blocks, strict=True)
        ]
    )


def choose_penalties(
    equations: TimeVaryingEquations, system: WhitenedSystem, penalties: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    r"""Penalties by restricted likelihood, and the solution with them (Wood and Fasiolo 2017).

    .. math:: \lambda \leftarrow c s^2 \frac{rank(S) - \lambda\, tr(V S) / s^2}{\theta^T S \theta}, \quad
              V = s^2 (Z^T Z + S_\lambda)^{-1}

    The factor c is 1 for noise weights; for flat ones it is the variance of the noise where the regressors of the
    parameter have their power, over its mean.

    Shapes: penalties (4,); returns solution (unknowns,), penalties (4,).
    """
    bases = equations.bases
    size, unknowns = bases.size, len(system.normal)
    typical, factors = _scale_penalties(equations, system), np.ones(len(penalties))
    for step in range(SMOOTHING_STEPS):
        penalty = np.zeros((unknowns, unknowns))
        penalty[:size, :size] = bases.penalty(penalties)
        solution = solve_scaled(system.normal + penalty, system.side)
        variance = _noise_variance(equations, system, solution, penalty)
        if step == 0 and equations.weighting == "flat":
            factors = _noise_factors(equations, system, solution[:size])
        inverse = solve_scaled(system.information + penalty, np.eye(unknowns))
        new = penalties.copy()
        for k, (splines, block) in enumerate(zip(bases.all, bases.blocks, strict=True)):
            if splines.rank == 0:
                new[k] = 0.0
                continue
            roughness = solution[block] @ splines.penalty @ solution[block]
            freedom = splines.rank - penalties[k] * np.trace(inverse[block, block] @ splines.penalty)
            value = factors[k] * variance * max(freedom, 1e-10) / max(roughness, 1e-300)
            new[k] = np.clip(value, SMALLEST_PENALTY * typical[k], LARGEST_PENALTY * typical[k])
        penalties = new
    return solution, penalties, variance


def _noise_variance(
    equations: TimeVaryingEquations, system: WhitenedSystem, solution: np.ndarray, penalty: np.ndarray
) -> float:
    """Variance of the whitened residual at a frequency of the band."""
    residual = system.torque - solution @ system.regressors
    freedom = residual.size * system.share - solution.size - equations.locked_dimension() * system.share
    return float(residual @ residual / max(freedom, 1.0))


def _noise_factors(equations: TimeVaryingEquations, system: WhitenedSystem, linear: np.ndarray) -> np.ndarray:
    """Variance of the noise where the regressors of K, B, G and I have their power, over its mean, shape (4,).

    Low frequencies show K and G, and flat weights leave the noise large there.
    """
    instruments = system.instruments[: linear.size]
    coloured = equations.colour(instruments, system.residual(linear))
    return np.array(
        [np.sum(coloured[block] ** 2) / np.sum(instruments[block] ** 2) for block in equations.bases.blocks]
    )


def _step(
    equations: TimeVaryingEquations,
    parameters: TimeVaryingParameters,
    system: WhitenedSystem,
    solution: np.ndarray,
    variance: float,
) -> tuple[TimeVaryingParameters, bool]:
    """Parameters after a round, and whether the dynamics have not moved."""
    size = equations.bases.size
    # The columns of the dynamics are those of the linear parameters where the round begins.
    steps = dict(zip(equations.names, solution[size:].tolist(), strict=True))
    inverse = solve_scaled(system.information, np.eye(len(system.information)))
    errors = np.sqrt(np.maximum(variance * np.diag(inverse)[size:], 0.0))
    limited = {name: float(np.clip(step, -LARGEST_STEPS[name], LARGEST_STEPS[name])) for name, step in steps.items()}
    dynamics = parameters.dynamics.scale(np.array([limited[name] for name in parameters.dynamics.values]))
    shift = parameters.shift + limited.get("delay", 0.0)
    low, high = (limit - equations.delay for limit in DELAY_LIMITS)
    shift = float(np.clip(shift, low, high)) if equations.estimate_delay else shift
    lag = parameters.lag + limited.get("torque_lag", 0.0)
    moved = max(abs(step) / max(error, 1e-300) for step, error in zip(steps.values(), errors, strict=True))
    small = max(abs(step) / LARGEST_STEPS[name] for name, step in steps.items())
    return TimeVaryingParameters(solution[:size], dynamics, shift, lag), moved < CONVERGED or small < 1e-5
