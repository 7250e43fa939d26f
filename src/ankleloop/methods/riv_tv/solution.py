"""Solution of the equations of `riv-tv`: rounds of smoothing, dynamics and weights; covariance, bands, tests of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import linalg, special

from ankleloop.joint.dynamics import GRIDS, respond
from ankleloop.methods.riv.alternatives import normal_score
from ankleloop.methods.riv.equations import FASTEST_POLE, Parameters
from ankleloop.methods.riv.search import NEARLY_ZERO
from ankleloop.methods.riv.start import fit_grid
from ankleloop.methods.riv_tv.equations import TimeVaryingEquations, WhitenedSystem
from ankleloop.methods.riv_tv.smoothing import choose_penalties
from ankleloop.methods.riv_tv.whitening import WEIGHT_FLOOR
from ankleloop.quantities import STIFFNESS
from ankleloop.signals.least_squares import invert_scaled, solve_scaled
from ankleloop.signals.spectra import smooth

INTEGRATION_PLACES = 2001  # at which squares of splines are summed
# Of the mean information about a parameter: chosen, where a standard error is six times that at the mean.
IDENTIFIED = 0.03
MOST_ROUNDS = 30
FEWEST_ROUNDS = 3
LARGEST_STEPS = {"omega_n": 0.3, "zeta": 0.3, "pole": 0.3, "delay": 0.008, "torque_lag": 0.004}
CONVERGED = 0.02  # of its standard error: largest step of a parameter of the dynamics
NEGLIGIBLE_STEP = 1e-5  # of the largest steps
RENEWED = 1e-4  # s: change of the delay for which inputs are made again


@dataclass(frozen=True, eq=False)
class TimeVaryingSolution:
    """Parameters that solve the equations, and the system at them."""

    equations: TimeVaryingEquations
    parameters: Parameters
    system: WhitenedSystem  # whitened system with its regressors at the solution
    penalty: np.ndarray  # shape (unknowns, unknowns): penalties with their weights
    variance: float  # variance of the whitened noise at a frequency of the band
    converged: bool  # whether the dynamics of the reflex moved no more

    @cached_property
    def residual(self) -> np.ndarray:
        """Whitened torque that is left, shape (rows,)."""
        return self.system.residual(self.parameters.linear)

    @cached_property
    def inverse(self) -> np.ndarray:
        """Inverse of the penalised normal equations, shape (unknowns, unknowns)."""
        return invert_scaled(self.system.normal + self.penalty)

    @cached_property
    def covariance(self) -> np.ndarray:
        r"""Covariance of the unknowns about the true ones, smoothing included, shape (unknowns, unknowns).

        .. math:: A^{-1} (M + s^2 S_\lambda) A^{-T}, \quad A = Z^T X + S_\lambda,

        with M the sum over cycles of the outer products of their contributions to the left side of the equations, which
        holds whatever the noise does within a cycle; the second term is what the penalties may have smoothed away, for
        trajectories as rough as they say (Nychka, J. Am. Stat. Assoc. 83(404), 1134-1143, 1988). Weights from the noise
        are estimates themselves (`ankleloop.methods.riv.equations.Point.covariance`).
        """
        cycles = self.equations.course.segments
        starts = np.searchsorted(self.equations.course.segment, np.arange(cycles))
        scores = np.add.reduceat(self.system.instruments * self.residual, starts, axis=1)
        scatter = scores @ scores.T + self.variance * self.penalty
        few_cycles = cycles / (cycles - 1.0)
        estimated_weights = 1.0 + 2.0 * self.equations.noise.weight_variance
        return few_cycles * estimated_weights * self.inverse @ scatter @ self.inverse.T

    @cached_property
    def apparatus_covariance(self) -> np.ndarray:
        """Covariance that an apparatus makes which is subtracted (`ankleloop.methods.riv.covariance`); else zero.

        Shapes: returns (unknowns, unknowns).
        """
        equations = self.equations
        apparatus = equations.trials[0].apparatus
        if apparatus is None:
            return np.zeros_like(self.inverse)
        pairs = zip(equations.trials, equations.grids, strict=True)
        inputs = np.concatenate([trial.apparatus_inputs(grid) for trial, grid in pairs])
        whitener = equations.noise_whitener(self.parameters)
        columns = whitener(equations.spectra(inputs.T))
        influence = self.inverse @ (self.system.instruments @ columns.T)
        return influence @ apparatus.scatter @ influence.T

    @property
    def delay(self) -> float:
        """Delay of the reflex [s]."""
        return self.equations.delay + self.parameters.shift

    @property
    def means(self) -> dict[str, float]:
        """Means of K, B, I and G over the record."""
        return self.equations.bases.means(self.parameters.linear)

    @cached_property
    def shown_means(self) -> dict[str, float]:
        """Means over the record that are not nearly zero; without a G that is that of no reflex."""
        means = self.means
        if self.parameters.passive:
            del means["G"]
        rows = self.parameter_rows
        errors = {name: np.sqrt(rows[name] @ self.covariance @ rows[name]) for name in means}
        return {
            name: mean for name, mean in means.items() if abs(mean) > NEARLY_ZERO * errors[name]
        }

    @property
    def pole_out_of_band(self) -> bool:
        """Whether a pole of the reflex is so fast that it cannot be told from a delay."""
        dynamics = self.parameters.dynamics
        fastest = max(dynamics.fastest_pole, dynamics.pole or 0.0)
        return fastest > FASTEST_POLE * self.equations.noise.highest

    @property
    def reflex_score(self) -> float:
        """Normal score of the coefficients of the reflex."""
        block = self.equations.bases.blocks["G"]
        return abs(normal_score(self.parameters.linear[block], self.covariance[block, block]))

    @cached_property
    def strength(self) -> float:
        """Smallest canonical correlation of instruments and regressors."""
        size = self.equations.bases.size
        instruments = self.system.instruments[:size]
        regressors = self.system.regressors[:size]
        return float(np.cos(linalg.subspace_angles(instruments.T, regressors.T)[0]))

    @property
    def weakness_f(self) -> float:
        """F statistic of the direction that the instruments explain least (Staiger and Stock 1997)."""
        size = self.equations.bases.size
        independent = self.system.torque.size * self.equations.noise.share / size - 1.0
        explained = self.strength**2
        return explained / max(1.0 - explained, 1e-12) * independent

    @property
    def parameter_rows(self) -> dict[str, np.ndarray]:
        """Slopes of the means of K, B, I and G, and of the other unknowns, by all unknowns, shapes (unknowns,)."""
        bases = self.equations.bases
        units = np.eye(len(self.system.normal))
        means = {
            name: bases.mean_weights[name] @ units[block] for name, block in bases.blocks.items()
        }
        return means | dict(zip(self.parameters.unknowns, units[bases.size :], strict=True))

    def find_trajectories(
        self, places: np.ndarray
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """What varies, with the ends of its bands, K, K_low, K_high, …; and the excitation behind it.

        The excitation is the information of the record about a trajectory over its mean, for splines of equal size.
        Where the record shows nothing the trajectory is nan.

        Shapes: places (places,); returns (places,).
        """
        bases = self.equations.bases
        information = np.diag(self.system.information)
        quantile = special.stdtrit(self.equations.course.segments - 1, 0.975)
        covariance = self.covariance + self.apparatus_covariance
        curves = {}
        excitations = {}
        for name in bases.trajectories:
            splines = bases.splines[name]
            block = bases.blocks[name]
            squares = splines(np.linspace(0.0, 1.0, INTEGRATION_PLACES)) ** 2
            density = information[block] / squares.mean(axis=0)
            mean = max(float(density.mean()), np.finfo(float).tiny)
            weights = splines(places)
            excitation = weights @ (density / mean)
            curve = weights @ self.parameters.linear[block]
            curve[excitation < IDENTIFIED] = np.nan
            variances = np.sum(weights @ covariance[block, block] * weights, axis=1)
            margin = quantile * np.sqrt(variances) if self.converged else np.nan
            curves[name] = curve
            curves[f"{name}_low"] = curve - margin
            curves[f"{name}_high"] = curve + margin
            excitations[name] = excitation
        return curves, excitations

    @property
    def variation_p(self) -> dict[str, float]:
        """Probability of a variation at least as large as the one that was seen, if K, B and G were constant.

        Of each of them that has several splines, and of all of these. A score test: the equations are solved for
        constant parameters, with the weights and the dynamics of the solution, and the left sides of those for the
        contrasts of the splines are compared with their covariance, which the spectrum of the residual gives.
        """
        splines = self.equations.bases.splines
        varying = [name for name in ("K", "B", "G") if splines[name].size > 1]
        if not varying:
            return {}
        noise = self.equations.noise
        coloured = noise.colour(self.system.instruments, self.residual)
        # The spectrum is an estimate, by which left sides scatter more.
        variance = self.variance * (1.0 + noise.spectrum_variance)
        scatter = variance * coloured @ coloured.T
        probabilities = {name: self._test_constancy([name], scatter) for name in varying}
        return {**probabilities, "all": self._test_constancy(varying, scatter)}

    def _test_constancy(self, names: Sequence[str], scatter: np.ndarray) -> float:
        """Probability of left sides for the contrasts of some parameters that are at least as large as these.

        Shapes: scatter (unknowns, unknowns): covariance of all left sides.
        """
        blocks = [
            np.ones((splines.size, 1)) if name in names else np.eye(splines.size)
            for name, splines in self.equations.bases.splines.items()
        ]
        constant = linalg.block_diag(*blocks, np.eye(len(self.parameters.unknowns)))
        contrasts = linalg.null_space(constant.T).T
        normal = self.system.normal @ constant
        solution = solve_scaled(constant.T @ normal, constant.T)
        rows = contrasts - contrasts @ normal @ solution
        left = rows @ self.system.side
        statistic = left @ solve_scaled(rows @ scatter @ rows.T, left)
        return float(special.chdtrc(left.size, statistic))


def solve_time_varying(
    equations: TimeVaryingEquations, *, passive: bool = False
) -> TimeVaryingSolution:
    """Solve the equations, from the best of a grid of dynamics for constant parameters; or for a passive joint.

    A round solves the linear equations with weights and instruments of the point where it begins, chooses the
    penalties (`choose_penalties`), makes a step of the dynamics and of the delays, and renews the weights. The round
    after the last step is for the linear parameters alone.
    """
    parameters = _find_start(equations)
    if passive:
        parameters = parameters.without_reflex()
    size = parameters.linear.size
    largest = np.array([LARGEST_STEPS[name] for name in parameters.unknowns])
    converged = False
    penalties = None
    for number in range(1, MOST_ROUNDS + 1):
        system = equations.system(parameters, equations.noise_whitener(parameters))
        solution = choose_penalties(equations, system, penalties)
        penalties = solution.penalties
        linear, step = np.split(solution.values, [size])
        if converged:
            parameters = replace(parameters, linear=linear)
            break
        inverse = invert_scaled(system.information)
        errors = np.sqrt(np.maximum(solution.variance * np.diag(inverse)[size:], 1e-300))
        small = np.max(np.abs(step) / errors, initial=0.0) < CONVERGED
        negligible = np.max(np.abs(step) / largest, initial=0.0) < NEGLIGIBLE_STEP
        converged = number >= FEWEST_ROUNDS and bool(small or negligible)
        # The columns of the dynamics are those of the linear parameters where the round begins.
        limited = np.clip(step, -largest, largest)
        whole_step = np.concatenate([linear - parameters.linear, limited])
        parameters = parameters.add(whole_step).limit_delay(equations.delay)
        if abs(parameters.shift) > RENEWED:
            equations = equations.with_delay(equations.delay + parameters.shift)
            parameters = replace(parameters, shift=0.0)
    return TimeVaryingSolution(
        equations=equations,
        parameters=parameters,
        system=system,
        penalty=equations.bases.penalty(solution.penalties, len(solution.values)),
        variance=solution.variance,
        converged=converged,
    )


def _find_start(equations: TimeVaryingEquations) -> Parameters:
    """Parameters to begin with: constant linear ones, by the predicted inputs, and the best dynamics of a grid.

    As `riv.equations.Equations.find_start`, but for the padded transform, whose band is another, and without a grid of
    delays: a step of the delay here makes new inputs.
    """
    options = equations.options
    noise = equations.noise
    inputs = equations.predicted
    grid = GRIDS[options.order]
    blocks = equations.bases.blocks
    intrinsic = [inputs.intrinsic[blocks[name]].sum(axis=0) for name in STIFFNESS]
    spectra = np.stack([*intrinsic, inputs.drive.sum(axis=0)])[:, noise.inside]
    torque = equations.torque[noise.inside]
    responses = respond(grid, equations.transform.s[noise.inside])
    no_delays = np.ones((1, torque.size))
    width = noise.resolution * equations.transform.size / equations.transform.rate
    power = np.ones(torque.size)
    for _ in range(2):
        constants, best, residual = fit_grid(spectra, torque, responses, no_delays, power)
        power = smooth(np.abs(residual) ** 2, width)
        power = np.maximum(power, WEIGHT_FLOOR * power.max())
    delays = {"delay": options.delay, "torque_lag": options.torque_lag}
    return Parameters(
        linear=np.repeat(constants, [splines.size for splines in equations.bases.splines.values()]),
        dynamics=grid[best],
        lag=options.torque_lag or 0.0,
        delays=tuple(name for name, value in delays.items() if value is None),
    )
