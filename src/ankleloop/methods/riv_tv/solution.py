"""Solution of the equations of `riv-tv`: rounds of smoothing, dynamics and weights; covariance, bands, tests of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import special
from scipy.fft import irfft

from ankleloop.joint.dynamics import GRIDS, ReflexDynamics, respond
from ankleloop.methods.riv.alternatives import Alternative, compute_shifts
from ankleloop.methods.riv.equations import Parameters, fit_grid
from ankleloop.methods.riv_tv.equations import (
    MEAN_SPLINES,
    Motion,
    TimeVaryingEquations,
    WhitenedSystem,
)
from ankleloop.signals.least_squares import solve_scaled
from ankleloop.signals.spectra import smooth

INTEGRATION = 2001  # places at which squares of splines are summed
IDENTIFIED = 0.03  # of the mean information about a parameter: less is not identified
EFFECTS = ("lag", "high-pass", "friction", "compression", "direction", "delay")
UNKNOWNS = {"lag": "torque_lag", "delay": "delay"}
MOST_ROUNDS = 30
LARGEST_STEPS = {"omega_n": 0.3, "zeta": 0.3, "pole": 0.3, "delay": 0.008, "torque_lag": 0.004}
CONVERGED = 0.02  # of its standard error: largest step of a parameter of the dynamics
SMOOTHING_STEPS = 5  # of the penalties in one round
LARGEST_PENALTY, SMALLEST_PENALTY = 1e8, 1e-8  # in units of the information over the penalty
RENEWED = 1e-4  # s: change of the delay for which inputs are made again


@dataclass(frozen=True, eq=False)
class TimeVaryingSolution:
    """Parameters that solve the equations, and the system at them."""

    equations: TimeVaryingEquations
    parameters: Parameters
    system: WhitenedSystem  # whitened system with its regressors at the solution
    penalty: np.ndarray  # shape (unknowns, unknowns): penalties with their weights
    variance: float  # variance of the whitened noise at a frequency of the band
    rounds: int
    converged: bool  # whether the dynamics of the reflex moved no more

    @cached_property
    def _residual(self) -> np.ndarray:
        return self.system.residual(self.parameters.linear)

    @cached_property
    def _inverse(self) -> np.ndarray:
        """Inverse of the penalised normal equations, shape (unknowns, unknowns)."""
        return solve_scaled(self.system.normal + self.penalty, np.eye(len(self.penalty)))

    @cached_property
    def covariance(self) -> np.ndarray:
        r"""Covariance of the unknowns about the true ones, smoothing included, shape (unknowns, unknowns).

        .. math:: A^{-1} (M + s^2 S_\lambda) A^{-T}, \quad A = Z^T X + S_\lambda,

        with M the sum over cycles of the outer products of their contributions to the left side of the equations, which
        holds whatever the noise does within a cycle; the second term is what the penalties may have smoothed away, for
        trajectories as rough as they say (Nychka, J. Am. Stat. Assoc. 83(404), 1134-1143, 1988). Weights from the noise
        are estimates themselves (`ankleloop.methods.riv.equations.Point.covariance`).
        """
        course = self.equations.course
        starts = np.searchsorted(course.segment, np.arange(course.segments))
        scores = np.add.reduceat(self.system.instruments * self._residual, starts, axis=1)
        scatter = scores @ scores.T + self.variance * self.penalty
        factor = (
            (1.0 + 2.0 * self.equations.smoothing_variance)
            * course.segments
            / (course.segments - 1.0)
        )
        return factor * self._inverse @ scatter @ self._inverse.T

    @property
    def delay(self) -> float:
        """Delay of the reflex [s]."""
        return self.equations.delay + self.parameters.shift

    @property
    def means(self) -> dict[str, float]:
        """Means of K, B, I and G over the record."""
        return self.equations.means(self.parameters.linear)

    @property
    def quantile(self) -> float:
        """Half of a 95 % interval over its standard error."""
        return float(special.stdtrit(self.equations.course.segments - 1, 0.975))

    @cached_property
    def strength(self) -> float:
        """Smallest canonical correlation of instruments and regressors."""
        system, size = self.system, self.equations.bases.size
        z, x = (np.linalg.qr(rows[:size].T)[0] for rows in (system.instruments, system.regressors))
        return float(np.linalg.svd(z.T @ x, compute_uv=False)[-1])

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the means of K, B, I and G, and of the other unknowns."""
        size, names = self.equations.bases.size, (*"KBIG", *self.parameters.unknowns)
        means, others = (
            self._deviate(self.equations.mean_weights, slice(size)),
            np.diag(self.covariance)[size:],
        )
        return dict(zip(names, [*means.tolist(), *np.sqrt(others).tolist()], strict=True))

    def _deviate(self, weights: np.ndarray, block: slice) -> np.ndarray:
        """Standard deviations of weighted sums of the parameters of a block, shapes (..., parameters) and (...)."""
        return np.sqrt(
            np.maximum(np.sum(weights @ self.covariance[block, block] * weights, axis=-1), 0.0)
        )

    def find_trajectories(
        self, places: np.ndarray
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Trajectories of what varies with the ends of their bands, nan where the record shows nothing; excitation.

        The excitation is the information of the record about a trajectory over its mean, for splines of equal size.

        Shapes: places (places,); returns (places,).
        """
        bases, information = self.equations.bases, np.diag(self.system.information)
        values, excitation = {}, {}
        for name, splines, block in zip(bases.names, bases.all, bases.blocks, strict=False):
            weights = splines(places)
            density = information[block] / np.mean(
                splines(np.linspace(0.0, 1.0, INTEGRATION)) ** 2, axis=0
            )
            excitation[name] = weights @ (
                density / max(float(np.mean(density)), np.finfo(float).tiny)
            )
            curve = weights @ self.parameters.linear[block]
            curve[excitation[name] < IDENTIFIED] = np.nan
            margin = self.quantile * self._deviate(weights, block) if self.converged else np.nan
            values[name], values[f"{name}_low"], values[f"{name}_high"] = (
                curve,
                curve - margin,
                curve + margin,
            )
        return values, excitation

    @property
    def variation_p(self) -> dict[str, float]:
        """Probability of a variation at least as large as the one that was seen, if K, B and G were constant.

        A score test: the equations are solved for constant parameters, with the weights and the dynamics of the
        solution, and the left sides of those for the contrasts of the splines are compared with their covariance, which
        the spectrum of the residual gives.
        """
        e, system = self.equations, self.system
        coloured = e.colour(system.instruments, self._residual)
        # The spectrum is an estimate, by which left sides scatter more.
        scatter = (
            self.variance
            * (1.0 + e.band.smoothing_variance(e.resolution))
            * (coloured @ coloured.T)
        )
        # The first direction of each block is its constant, the others are its contrasts.
        rotation, contrasts = np.eye(len(scatter)), {}
        for name, block in zip("KBG", e.bases.blocks, strict=False):
            rotation[block, block] = np.linalg.svd(np.ones((1, block.stop - block.start)))[2]
            contrasts[name] = np.arange(block.start + 1, block.stop)
        contrasts["all"] = np.concatenate(list(contrasts.values()))
        normal, scatter = rotation @ system.normal @ rotation.T, rotation @ scatter @ rotation.T
        side, values = rotation @ system.side, {}
        for name, tested in contrasts.items():
            free = np.setdiff1d(np.arange(len(side)), tested)
            rows = np.eye(len(side))[tested]
            rows[:, free] = -normal[np.ix_(tested, free)] @ solve_scaled(
                normal[np.ix_(free, free)], np.eye(free.size)
            )
            statistic = (rows @ side) @ solve_scaled(rows @ scatter @ rows.T, rows @ side)
            values[name] = float(special.chdtrc(tested.size, statistic))
        return values

    def find_alternatives(self) -> list[Alternative]:
        """Effects with their scores, and how far the means of K, B, I and G move with one step towards each of them."""
        e, system, linear = self.equations, self.system, self.parameters.linear
        whiten = e.noise_whitener(self.parameters)
        scale = np.sqrt(self.variance * (1.0 + e.smoothing_variance))
        predicted = self.parameters.torque(e.predicted.spectra, e.predicted.drive, e.s)
        sides = (e.measured, e.lead(self.parameters)), (e.predicted, predicted)
        effects = [
            effect for effect in EFFECTS if UNKNOWNS.get(effect) not in self.parameters.delays
        ]
        alternatives = []
        for effect in effects:
            regressor, instrument = (whiten(self._respond(effect, *side)) for side in sides)
            instrument = (
                instrument - (instrument @ system.regressors.T) @ self._inverse @ system.instruments
            )
            left = instrument @ self._residual
            score = left / (scale * np.linalg.norm(e.colour(instrument, self._residual)))
            step = left / (instrument @ regressor)
            moved = -step * (self._inverse @ (system.instruments @ regressor))
            shifts = compute_shifts(self.means, e.means(linear + moved[: linear.size]))
            alternatives.append(Alternative(effect, float(step), float(score), shifts))
        return alternatives

    def _respond(self, effect: str, motion: Motion, torque: np.ndarray) -> np.ndarray:
        """Transform of the derivative of the torque with respect to an effect, by a motion and the torque of it."""
        e, parameters = self.equations, self.parameters
        s, velocity = np.where(e.inside, e.s, 1.0), motion.signals[1]
        if effect == "lag":
            return -s * torque
        if effect == "high-pass":
            return -torque / s
        if effect == "compression":
            return -e.spectra(irfft(torque, e.size)[: e.grid.samples] ** 3)
        if effect == "friction":
            return e.spectra(np.sign(velocity))
        response = parameters.responses(e.s)[0]
        if effect == "delay":
            return -s * response * (parameters.linear[e.bases.blocks[2]] @ motion.drive)
        late = np.exp(-e.s * e.delay)
        return response * (e.spectra(motion.rectify(e.delay)) - late * e.spectra(velocity))


def solve_time_varying(equations: TimeVaryingEquations) -> TimeVaryingSolution:
    """Solve the equations, from the best of a grid of dynamics for constant parameters.

    A round solves the linear equations with weights and instruments of the point where it begins, chooses the
    penalties (`choose_penalties`), makes a step of the dynamics and of the delays, and renews the weights.
    """
    options = equations.options
    linear, dynamics = _fit_constants(equations)
    delays = ("delay",) * (options.delay is None) + ("torque_lag",) * (options.torque_lag is None)
    parameters = Parameters(linear, dynamics, lag=options.torque_lag or 0.0, delays=delays)
    largest = np.array([LARGEST_STEPS[name] for name in parameters.unknowns])
    converged, penalties = False, np.zeros(0)
    for count in range(1, MOST_ROUNDS + 1):
        system = equations.system(parameters, equations.noise_whitener(parameters))
        solution, penalties, variance = choose_penalties(equations, system, penalties)
        linear, step = np.split(solution, [linear.size])
        if converged:
            parameters = replace(parameters, linear=linear)
            break
        inverse = solve_scaled(system.information, np.eye(len(system.information)))
        errors = np.sqrt(np.maximum(variance * np.diag(inverse)[linear.size :], 1e-300))
        small = np.max(np.abs(step) / errors) < CONVERGED or np.max(np.abs(step) / largest) < 1e-5
        converged = bool(small) and count > 2
        # The columns of the dynamics are those of the linear parameters where the round begins.
        limited = np.concatenate([linear - parameters.linear, np.clip(step, -largest, largest)])
        parameters = parameters.add(limited).limit_delay(equations.delay)
        if abs(parameters.shift) > RENEWED:
            equations.set_delay(equations.delay + parameters.shift)
            parameters = replace(parameters, shift=0.0)
    penalty = equations.bases.penalty(penalties, len(solution))
    return TimeVaryingSolution(equations, parameters, system, penalty, variance, count, converged)


def _fit_constants(equations: TimeVaryingEquations) -> tuple[np.ndarray, ReflexDynamics]:
    """Linear parameters that are constant, by the predicted inputs, and the best dynamics of a grid."""
    predicted, inside, (k, b, g, i) = equations.predicted, equations.inside, equations.bases.blocks
    motion = [predicted.spectra[block].sum(axis=0) for block in (k, b, i)]
    inputs = np.stack([*motion, predicted.drive.sum(axis=0)])[:, inside]
    s, target, grid = equations.s[inside], equations.torque[inside], GRIDS[equations.options.order]
    width, noise = equations.resolution * equations.size / equations.rate, np.ones(target.size)
    responses = respond(grid, s)
    for _ in range(2):
        values, best, residual = fit_grid(inputs, target, responses, np.ones((1, s.size)), noise)
        noise = smooth(np.abs(residual) ** 2, width)
        noise = np.maximum(noise, 1e-10 * noise.max())
    return np.repeat(values, [block.stop - block.start for block in (k, b, i, g)]), grid[best]


def choose_penalties(
    equations: TimeVaryingEquations, system: WhitenedSystem, penalties: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    r"""Penalties by restricted likelihood, and the solution with them (Wood and Fasiolo 2017).

    .. math:: \lambda \leftarrow c s^2 \frac{rank(S) - \lambda\, tr(V S) / s^2}{\theta^T S \theta}, \quad
              V = s^2 (Z^T Z + S_\lambda)^{-1}

    The factor c is 1 for noise weights; for flat ones it is the variance of the noise where the regressors of the
    parameter have their power, over its mean: low frequencies show K and G, and flat weights leave the noise large
    there. Without penalties, as in the first round, they begin by weighing as much as the data.

    Shapes: penalties (4,); returns solution (unknowns,), penalties (4,).
    """
    bases, unknowns, course = equations.bases, len(system.normal), equations.course
    parts, information = (
        list(zip(bases.all, bases.blocks, strict=True)),
        np.diag(system.information),
    )
    typical = np.array(
        [
            np.sum(information[block]) / max(np.trace(splines.penalty), 1.0)
            for splines, block in parts
        ]
    )
    penalties, factors = penalties if penalties.size else typical, np.ones(len(parts))
    freedom = (
        system.torque.size - (course.equal_cycles or MEAN_SPLINES)
    ) * equations.share - unknowns
    for step in range(SMOOTHING_STEPS):
        penalty = bases.penalty(penalties, unknowns)
        solution = solve_scaled(system.normal + penalty, system.side)
        residual = system.torque - solution @ system.regressors
        variance = float(residual @ residual / max(freedom, 1.0))
        if step == 0 and equations.options.weighting == "flat":
            instruments = system.instruments[: bases.size]
            coloured = equations.colour(instruments, system.residual(solution[: bases.size]))
            factors = np.array(
                [
                    np.sum(coloured[block] ** 2) / np.sum(instruments[block] ** 2)
                    for _, block in parts
                ]
            )
        inverse = solve_scaled(system.information + penalty, np.eye(unknowns))
        rough = np.array(
            [solution[block] @ splines.penalty @ solution[block] for splines, block in parts]
        )
        traces = np.array(
            [np.trace(inverse[block, block] @ splines.penalty) for splines, block in parts]
        )
        ranks = np.array([splines.rank for splines in bases.all])
        values = (
            factors
            * variance
            * np.maximum(ranks - penalties * traces, 1e-10)
            / np.maximum(rough, 1e-300)
        )
        penalties = np.where(
            ranks > 0, np.clip(values, SMALLEST_PENALTY * typical, LARGEST_PENALTY * typical), 0.0
        )
    return solution, penalties, variance
