"""The equations of refined instrumental variables, between spectra of measured and predicted inputs; their start."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import linalg
from scipy.linalg import lapack

from ankleloop.joint.dynamics import ReflexDynamics, respond
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import MOTION, Regressors
from ankleloop.signals.reference import explained_share
from ankleloop.signals.spectra import pass_band

NOISE_RESOLUTION = 0.4  # Hz
DELAY_LIMITS = (0.015, 0.15)  # s: no stretch reflex is faster; a shorter delay could not be told from viscosity
FASTEST_POLE = 20.0  # of the highest frequency: a pole beyond [rad/s] acts like a delay of a millisecond
NO_POLE = 100.0  # of that limit: a third pole that is held there is none
WELL_CONDITIONED = 1e-9  # reciprocal condition number
SINGULAR = 1e-12  # of the largest singular value of scaled equations
DIFFERENCE = 1e-4  # of a logarithm, for second derivatives
DELAYS = np.arange(0.02, 0.121, 0.01)  # s: candidates for the start of an unknown delay


@dataclass(frozen=True)
class RivParameters:
    """Linear parameters K, B, I, c₁ …, the dynamics behind the latter, and the shift of the delay."""

    linear: np.ndarray  # shape (3 + k,): K, B, I and the coefficients of the k basis functions
    dynamics: ReflexDynamics  # dynamics of the reflex
    shift: float = 0.0  # delay less the nominal one [s]

    def add(self, step: np.ndarray) -> RivParameters:
        """Parameters after a step of the linear ones, of the logarithms of the dynamics and of an unknown delay."""
        linear, dynamics, shift = np.split(step, np.cumsum([self.linear.size, len(self.dynamics.values)]))
        return RivParameters(self.linear + linear, self.dynamics.scale(dynamics), self.shift + shift.sum())


@dataclass(frozen=True, eq=False)
class RivPoint:
    """The equations at some parameters; weights and instruments are those of these parameters."""

    equations: RivEquations  # the equations
    parameters: RivParameters  # the parameters
    # Shape (unknowns, frequencies): derivatives of the torque with respect to the parameters, by the predicted inputs.
    instruments: np.ndarray
    regressors: np.ndarray  # the same by the measured inputs
    residual: np.ndarray  # shape (frequencies,): measured torque less that of the model
    noise: np.ndarray  # shape (frequencies,): smoothed periodogram of the residual

    @cached_property
    def level(self) -> np.ndarray:
        """Noise that the weights are the inverse of, shape (frequencies,)."""
        return self.noise if self.equations.weighting == "noise" else np.full(self.noise.size, self.noise.mean())

    @cached_property
    def weighted(self) -> np.ndarray:
        """Weighted conjugate instruments, shape (unknowns, frequencies)."""
        return self.instruments.conj() / self.level

    @cached_property
    def side(self) -> np.ndarray:
        """Left side of the equations, zero at their solution, shape (unknowns,)."""
        return np.real(self.weighted @ self.residual)

    @cached_property
    def normal(self) -> np.ndarray:
        """Minus the slope of the left side for fixed weights and instruments, shape (unknowns, unknowns)."""
        return np.real(self.weighted @ self.regressors.T)

    @cached_property
    def information(self) -> np.ndarray:
        """Products of the instruments, shape (unknowns, unknowns)."""
        return np.real(self.weighted @ self.instruments.T)

    @cached_property
    def scatter(self) -> np.ndarray:
        """Covariance of the left side where noise of this spectrum is all that is left; each frequency counts twice."""
        products = np.real((self.weighted * self.noise) @ self.weighted.conj().T)
        return 0.5 * self.equations.band.correlation * products

    def merit(self, free: np.ndarray) -> float:
        """Size of the left side of some unknowns over its standard deviation, squared: a χ² at the true parameters."""
        side = self.side[free]
        return float(side @ solve_scaled(self.scatter[np.ix_(free, free)], side))

    @cached_property
    def misfit(self) -> float:
        """Twice the negative log-likelihood of the torque less what the predicted inputs explain, but for a constant.

        With weights from the noise its spectrum is unknown (Whittle 1953), else it is white. In open loop its slope is
        the left side of the equations, but for the smoothing of weights.
        """
        e, remainder = self.equations, self.residual
        if e.predicted is not e.measured:
            linear = self.parameters.linear
            remainder = e.torque - linear @ self.instruments[: linear.size]
        if e.weighting == "noise":
            logarithms = np.log(e.smooth_power(remainder))
        else:
            logarithms = np.full(remainder.size, np.log(np.mean(np.abs(remainder) ** 2)))
        return float(2.0 / e.band.correlation * np.sum(logarithms))

    @cached_property
    def slope(self) -> np.ndarray:
        """Minus the slope of the left side, weights and instruments being renewed, shape (unknowns, unknowns)."""
        slope = self.normal - self.equations.second_derivatives(self)
        if self.equations.weighting == "noise":
            slope = slope - 2.0 * np.real(self.weighted * self.residual) / self.level @ self.noise_slopes.T
        return slope

    @cached_property
    def noise_slopes(self) -> np.ndarray:
        """Minus half of the slope of the noise with respect to each parameter, shape (unknowns, frequencies)."""
        products = np.real(self.residual.conj() * self.regressors)
        return np.array([self.equations.smooth(row) for row in products])

    @cached_property
    def strength(self) -> float:
        """Smallest canonical correlation of instruments and regressors."""
        if self.instruments is self.regressors:
            return 1.0
        root = np.sqrt(self.level)
        z, x = (np.linalg.qr(_real_rows(part / root))[0] for part in (self.instruments, self.regressors))
        return float(np.linalg.svd(z.T @ x, compute_uv=False)[-1])


class RivEquations:
    """Spectra of the measured and of the predicted inputs of a trial, and the equations between them.

    Parameters
    ----------
    trial : PreparedTrial
        The trial.
    regressors : Regressors
        Its regressors with the reference, for the nominal delay.
    order : {2, 3}
        Poles of the reflex dynamics.
    estimate_delay : bool
        Whether the delay is an unknown.
    weighting : {"noise", "flat"}
        Weights of frequencies.
    """

    def __init__(
        self, trial: PreparedTrial, regressors: Regressors, order: int, *, estimate_delay: bool, weighting: str
    ) -> None:
        self.regressors, self.order, self.weighting = regressors, order, weighting
        self.estimate_delay = estimate_delay
        self.band = pass_band(regressors.torque.size, regressors.rate)
        self.torque = self.band.transform(regressors.torque)
        self.measured = self.band.transform(regressors.inputs.T)
        self.explained = self._explained_share()
        self.predicted_inputs = trial.predict_inputs(regressors)
        open_loop = self.predicted_inputs is regressors.inputs
        self.predicted = self.measured if open_loop else self.band.transform(self.predicted_inputs.T)

    def _explained_share(self) -> float:
        """Share of the position that the reference explains."""
        r = self.regressors
        if r.reference is None or r.reference_name == "position":
            return 1.0
        return explained_share(r.inputs[:, 0], r.reference, r.rate)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every unknown."""
        terms = tuple(f"c{k}" for k in range(1, len(self.measured) - MOTION + 1))
        poles = ("omega_n", "zeta", "pole")[: self.order]
        return ("K", "B", "I", *terms, *poles, *(("delay",) if self.estimate_delay else ()))

    def smooth(self, power: np.ndarray) -> np.ndarray:
        """Smooth over frequencies, as the noise spectrum is."""
        return self.band.smooth(power, NOISE_RESOLUTION)

    def smooth_power(self, spectrum: np.ndarray) -> np.ndarray:
        """Smoothed periodogram, shape (frequencies,)."""
        power = self.smooth(np.abs(spectrum) ** 2)
        return np.maximum(power, 1e-12 * power.max())

    def evaluate(self, parameters: RivParameters) -> RivPoint:
        """Left side of the equations and all that belongs to it."""
        regressors = self._derivatives(self.measured, parameters)
        open_loop = self.predicted is self.measured
        instruments = regressors if open_loop else self._derivatives(self.predicted, parameters)
        residual = self.torque - parameters.linear @ regressors[: parameters.linear.size]
        return RivPoint(self, parameters, instruments, regressors, residual, self.smooth_power(residual))

    def _derivatives(self, spectra: np.ndarray, parameters: RivParameters) -> np.ndarray:
        """Derivatives of the torque with respect to the parameters, by some inputs."""
        response, derivatives = self.responses(parameters)
        drive = spectra[MOTION:]
        nonlinear = derivatives * (parameters.linear[MOTION:] @ drive)
        return np.vstack([spectra[:MOTION], response * drive, nonlinear])

    def responses(self, parameters: RivParameters) -> tuple[np.ndarray, np.ndarray]:
        """Response of the reflex with its shift of the delay, and its derivatives with respect to its parameters."""
        response, derivatives = parameters.dynamics.response(self.band.s)
        rows = np.array([*derivatives, -self.band.s * response] if self.estimate_delay else derivatives)
        if parameters.shift:
            delay = np.exp(-self.band.s * parameters.shift)
            response, rows = delay * response, delay * rows
        return response, rows

    def second_derivatives(self, point: RivPoint) -> np.ndarray:
        """Products of the residual with the derivatives of the instruments, shape (unknowns, unknowns)."""
        p, target = point.parameters, point.residual / point.level
        k, m = p.linear.size, len(point.side) - p.linear.size
        products = np.zeros((k + m, k + m))
        drive = self.predicted[MOTION:]
        mixed = np.real((drive.conj() * target) @ self.responses(p)[1].conj().T)
        products[MOTION:k, k:], products[k:, MOTION:k] = mixed, mixed.T
        combined = np.conj(p.linear[MOTION:] @ drive) * target
        for j, step in enumerate(DIFFERENCE * np.eye(k + m)[k:]):
            ahead, behind = (self.responses(p.add(sign * step))[1] for sign in (1.0, -1.0))
            products[k:, k + j] = np.real((ahead - behind).conj() @ combined) / (2.0 * DIFFERENCE)
        return products

    @property
    def pole_limit(self) -> float:
        """Magnitude from which on a pole cannot be told from a delay [rad/s]."""
        return FASTEST_POLE * self.band.highest

    def pole_out_of_band(self, parameters: RivParameters) -> bool:
        """Whether a pole of the second-order part is so fast that it cannot be told from a delay."""
        omega_n, zeta = parameters.dynamics.omega_n, parameters.dynamics.zeta
        return bool(omega_n * (zeta + np.sqrt(max(zeta**2 - 1.0, 0.0))) > self.pole_limit)

    def hold_at_limits(self, parameters: RivParameters) -> tuple[RivParameters, set[str]]:
        """Parameters without a third pole or a delay beyond their limits, and the names of those that were."""
        names = set()
        if (parameters.dynamics.pole or 0.0) >= self.pole_limit:
            parameters = replace(parameters, dynamics=replace(parameters.dynamics, pole=NO_POLE * self.pole_limit))
            names.add("pole")
        shortest, longest = (limit - self.regressors.delay for limit in DELAY_LIMITS)
        if self.estimate_delay and not shortest < parameters.shift < longest:
            parameters = replace(parameters, shift=min(max(parameters.shift, shortest), longest))
            names.add("delay")
        return parameters, names


def solve_scaled(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve normal equations whose unknowns differ in unit; directions without information get zero."""
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(normal)), np.finfo(float).tiny))
    scaled = normal * (scale[:, None] * scale)
    right = (right.T * scale).T
    factor, pivots, failure = lapack.dgetrf(scaled)
    if failure == 0 and lapack.dgecon(factor, np.abs(scaled).sum(axis=0).max())[0] > WELL_CONDITIONED:
        return (lapack.dgetrs(factor, pivots, right)[0].T * scale).T
    return (linalg.lstsq(scaled, right, cond=SINGULAR)[0].T * scale).T


def _real_rows(terms: np.ndarray) -> np.ndarray:
    """Complex rows as real columns, real parts above imaginary parts."""
    return np.hstack([terms.real, terms.imag]).T


def best_of_grid(equations: RivEquations) -> RivParameters:
    """Start: the best of a grid of dynamics for the predicted position, a fit to the torque that it explains."""
    nominal, s, torque = equations.regressors.delay, equations.band.s, equations.torque
    shifts = DELAYS - nominal if equations.estimate_delay else np.zeros(1)
    grid = [(dynamics, shift) for dynamics in ReflexDynamics.grid(equations.order) for shift in shifts]
    filters = respond([dynamics for dynamics, _ in grid[:: len(shifts)]], s)
    delays = np.exp(-np.outer(shifts, s))
    filters = (filters[:, None] * delays).reshape(len(grid), -1)
    motion, drive = np.split(equations.predicted, [MOTION])
    linear, best, residual = fit_grid(motion, drive, torque, filters, np.ones(s.size))
    if equations.weighting == "noise":
        linear, best, _ = fit_grid(motion, drive, torque, filters, equations.smooth_power(residual))
    return RivParameters(linear, *grid[best])


def fit_grid(
    motion: np.ndarray, drive: np.ndarray, torque: np.ndarray, filters: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray, int, np.ndarray]:
    """Linear parameters of the best of some filters of the drive, its number, and what it leaves of the torque.

    They are fitted for all of the filters in one pass.

    Shapes: motion (3, F), drive (k, F), torque (F,), filters (size, F), noise (F,); returns (3 + k,), residual (F,).
    """
    k, size = len(drive), len(filters)
    weighted = motion.conj() / noise
    normal = np.empty((size, MOTION + k, MOTION + k))
    normal[:, :MOTION, :MOTION] = np.real(weighted @ motion.T)
    cross = np.real(filters @ (weighted[:, None] * drive).reshape(MOTION * k, -1).T).reshape(-1, MOTION, k)
    normal[:, :MOTION, MOTION:], normal[:, MOTION:, :MOTION] = cross, np.swapaxes(cross, 1, 2)
    products = np.real(drive.conj()[:, None] * drive / noise).reshape(k * k, -1)
    normal[:, MOTION:, MOTION:] = (np.abs(filters) ** 2 @ products.T).reshape(-1, k, k)
    right = np.empty((size, MOTION + k))
    right[:, :MOTION] = np.real(weighted @ torque)
    right[:, MOTION:] = np.real(filters @ (drive * torque.conj() / noise).T)
    scale = 1.0 / np.sqrt(np.einsum("gii->gi", normal))
    scaled = normal * scale[:, :, None] * scale[:, None] + 1e-12 * np.eye(MOTION + k)
    linear = scale * np.linalg.solve(scaled, (scale * right)[..., None])[..., 0]
    best = int(np.argmax(np.sum(right * linear, axis=1)))  # explained energy
    values = linear[best]
    return values, best, torque - values[:MOTION] @ motion - filters[best] * (values[MOTION:] @ drive)
