"""The equations of refined instrumental variables: between spectra of the measured and of the predicted inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.reference_response import explained_share
from ankleloop.joint.regressors import INTRINSIC_NAMES, Regressors
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import Band

__all__ = ["MOTION", "RivEquations", "RivParameters", "RivSolution"]

LOWEST = 0.05  # Hz: drifts and means lie below
NOISE_RESOLUTION = 0.4  # Hz
DELAYS = np.arange(0.02, 0.121, 0.01)  # s: candidates for the start of an unknown delay
DELAY_LIMITS = (0.015, 0.15)  # s: no stretch reflex is faster; a shorter delay could not be told from viscosity
LARGEST_STEP = 0.4  # of a natural frequency or damping in one iteration
LARGEST_DELAY_STEP = 0.01  # s
WEAKEST = 0.05  # share of the position that the reference predicts
FASTEST_POLE = 20.0  # of the highest frequency: a pole beyond [rad/s] leaves no trace in the band
SINGULAR = 1e-12  # of the largest singular value of scaled equations
MOTION = len(INTRINSIC_NAMES)


@dataclass(frozen=True)
class RivParameters:
    """Linear parameters K, B, I, c₁ …, the dynamics behind the latter, and the shift of the delay.

    Parameters
    ----------
    linear : ndarray, shape (3 + k,)
        K, B, I and the coefficients of the k basis functions.
    dynamics : ReflexDynamics
        Dynamics of the reflex.
    shift : float
        Delay less the nominal one [s].
    """

    linear: np.ndarray
    dynamics: ReflexDynamics
    shift: float = 0.0

    def add(self, step: np.ndarray) -> RivParameters:
        """Parameters after a step of the linear ones, of the logarithms of the dynamics and of an unknown delay."""
        linear, dynamics, shift = np.split(step, np.cumsum([self.linear.size, len(self.dynamics.values)]))
        return RivParameters(self.linear + linear, self.dynamics.scale(dynamics), self.shift + shift.sum())


@dataclass(frozen=True)
class RivSolution:
    """End of the iteration.

    Parameters
    ----------
    parameters : RivParameters
        The parameters.
    covariance : ndarray, shape (unknowns, unknowns)
        Covariance of the entries of a step of the parameters.
    iterations : int
        Number of iterations.
    converged : bool
        Whether the last step was within the tolerance.
    criteria : tuple of float
        Size of the equations' left side at the start and at the end, in units of its standard deviation, squared.
    strength : float
        Smallest canonical correlation of instruments and regressors.
    noise : ndarray, shape (frequencies,)
        Smoothed periodogram of the residual.
    """

    parameters: RivParameters
    covariance: np.ndarray
    iterations: int
    converged: bool
    criteria: tuple[float, float]
    strength: float
    noise: np.ndarray


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
        self.band = Band(regressors.torque.size, regressors.rate, LOWEST, PASSBAND * regressors.rate)
        self.torque = self.band.transform(regressors.torque)
        self.measured = self.band.transform(regressors.inputs.T)
        self.explained = self._check_reference()
        self.predicted = self.band.transform(trial.predict_inputs(regressors).T)

    def _check_reference(self) -> float:
        """Share of the position that the reference explains; a reference that does not move the joint is refused."""
        r = self.regressors
        if r.reference is None or r.reference_name == "position":
            return 1.0
        share = explained_share(r.inputs[:, 0], r.reference, r.rate)
        if share < WEAKEST:
            raise DataError(
                f"{r.reference_name} explains {100 * max(share, 0.0):.0f} % of the position: as an instrument it is "
                "too weak to say anything. Give the command of the servo as reference; reference='position' is for "
                "records in open loop."
            )
        return share

    def _terms(self, spectra: np.ndarray, parameters: RivParameters) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the torque with respect to the linear parameters, and to dynamics and delay."""
        response, derivatives = parameters.dynamics.response(self.band.s)
        drive = np.exp(-self.band.s * parameters.shift) * spectra[MOTION:]
        combined = parameters.linear[MOTION:] @ drive
        nonlinear = [derivative * combined for derivative in derivatives]
        if self.estimate_delay:
            nonlinear.append(-self.band.s * response * combined)
        return np.vstack([spectra[:MOTION], response * drive]), np.array(nonlinear)

    def _residual(self, spectra: np.ndarray, parameters: RivParameters) -> np.ndarray:
        return self.torque - parameters.linear @ self._terms(spectra, parameters)[0]

    def _noise(self, residual: np.ndarray) -> np.ndarray:
        power = self.band.smooth(np.abs(residual) ** 2, NOISE_RESOLUTION)
        return np.maximum(power, 1e-12 * power.max())

    def start(self) -> RivParameters:
        """Best of a grid of dynamics for the predicted position: a fit to the torque that the reference explains."""
        shifts = DELAYS - self.regressors.delay if self.estimate_delay else np.zeros(1)
        grid = [(dynamics, shift) for dynamics in ReflexDynamics.grid(self.order) for shift in shifts]
        filters = np.array([dynamics.response(self.band.s)[0] for dynamics, _ in grid[:: len(shifts)]])
        delays = np.exp(-np.outer(shifts, self.band.s))
        filters = (filters[:, None] * delays).reshape(len(grid), -1)
        best = self._fit_grid(grid, filters, np.ones(self.band.s.size))
        if self.weighting == "flat":
            return best
        return self._fit_grid(grid, filters, self._noise(self._residual(self.predicted, best)))

    def _fit_grid(
        self, grid: list[tuple[ReflexDynamics, float]], filters: np.ndarray, noise: np.ndarray
    ) -> RivParameters:
        """Best of a grid of dynamics and shifts; the linear parameters are fitted for all of the grid in one pass."""
        motion, drive = np.split(self.predicted, [MOTION])
        k = len(drive)
        weighted = motion.conj() / noise
        normal = np.empty((len(grid), MOTION + k, MOTION + k))
        normal[:, :MOTION, :MOTION] = np.real(weighted @ motion.T)
        cross = np.real(filters @ (weighted[:, None] * drive).reshape(MOTION * k, -1).T).reshape(-1, MOTION, k)
        normal[:, :MOTION, MOTION:], normal[:, MOTION:, :MOTION] = cross, np.swapaxes(cross, 1, 2)
        products = np.real(drive.conj()[:, None] * drive / noise).reshape(k * k, -1)
        normal[:, MOTION:, MOTION:] = (np.abs(filters) ** 2 @ products.T).reshape(-1, k, k)
        right = np.empty((len(grid), MOTION + k))
        right[:, :MOTION] = np.real(weighted @ self.torque)
        right[:, MOTION:] = np.real(filters @ (drive * self.torque.conj() / noise).T)
        scale = 1.0 / np.sqrt(np.einsum("gii->gi", normal))
        scaled = normal * scale[:, :, None] * scale[:, None] + 1e-12 * np.eye(MOTION + k)
        linear = scale * np.linalg.solve(scaled, (scale * right)[..., None])[..., 0]
        best = int(np.argmax(np.sum(right * linear, axis=1)))  # explained energy
        return RivParameters(linear[best], *grid[best])

    def solve(self, start: RivParameters, max_iterations: int, tolerance: float) -> RivSolution:
        """Iterate noise spectrum, derivatives and parameters from a start."""
        parameters = start
        for iteration in range(1, max_iterations + 1):
            noise = self._noise(self._residual(self.measured, parameters))
            level = noise if self.weighting == "noise" else np.full(noise.size, noise.mean())
            parameters = self._fit_linear(parameters, level)
            instruments, jacobian = (np.vstack(self._terms(x, parameters)) for x in (self.predicted, self.measured))
            weighted = instruments.conj() / level
            normal = np.real(weighted @ jacobian.T)
            step = _solve(normal, np.real(weighted @ self._residual(self.measured, parameters)))
            scatter = np.real((weighted * noise) @ weighted.conj().T)
            covariance = self._covariance(normal, scatter)
            share = self._step_share(step)
            parameters = parameters.add(share * step)
            if self.pole_out_of_band(parameters) or self.delay_out_of_range(parameters):
                converged = False
                break
            converged = share == 1.0 and bool(np.all(np.abs(step) <= tolerance * np.sqrt(np.diag(covariance))))
            if converged and iteration > 1:
                break
        criteria = self._criterion(weighted, scatter, start), self._criterion(weighted, scatter, parameters)
        strength = _strength(instruments, jacobian, level)
        return RivSolution(parameters, covariance, iteration, converged, criteria, strength, noise)

    def pole_out_of_band(self, parameters: RivParameters) -> bool:
        """Whether a pole is so fast that it leaves no trace."""
        values = parameters.dynamics.values
        return max(values["omega_n"], values.get("pole", 0.0)) > FASTEST_POLE * self.band.highest

    def delay_out_of_range(self, parameters: RivParameters) -> bool:
        """Whether an estimated delay is outside the range of stretch reflexes."""
        shortest, longest = DELAY_LIMITS
        return self.estimate_delay and not shortest <= self.regressors.delay + parameters.shift <= longest

    def _fit_linear(self, parameters: RivParameters, noise: np.ndarray) -> RivParameters:
        """Linear parameters in closed form, for fixed dynamics."""
        instruments, terms = (self._terms(x, parameters)[0] for x in (self.predicted, self.measured))
        weighted = instruments.conj() / noise
        linear = _solve(np.real(weighted @ terms.T), np.real(weighted @ self.torque))
        return RivParameters(linear, parameters.dynamics, parameters.shift)

    def _step_share(self, step: np.ndarray) -> float:
        """Share of a step that stays within what one iteration may change."""
        largest = np.array([LARGEST_STEP] * self.order + [LARGEST_DELAY_STEP] * self.estimate_delay)
        return min(1.0, float(np.min(largest / np.maximum(np.abs(step[-largest.size :]), 1e-30))))

    def _covariance(self, normal: np.ndarray, scatter: np.ndarray) -> np.ndarray:
        """Asymptotic covariance of the parameters; each frequency counts twice, as a complex number does.

        Weights from the noise are an estimate themselves. To first order in the variance a of a smoothed periodogram
        over its square the equations scatter by 1 + 3a more than with the true spectrum, where this formula says 1 + a.
        """
        inverse = _solve(normal, np.eye(len(normal)))
        weights = 1.0 + 2.0 * self.band.smoothing_variance(NOISE_RESOLUTION) if self.weighting == "noise" else 1.0
        return 0.5 * self.band.correlation * weights * inverse @ scatter @ inverse.T

    def _criterion(self, weighted: np.ndarray, scatter: np.ndarray, parameters: RivParameters) -> float:
        """Size of the instrumental equations' left side, in units of its standard deviation."""
        side = np.real(weighted @ self._residual(self.measured, parameters))
        return float(side @ _solve(scatter, side))


def _solve(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve normal equations whose unknowns differ in unit; directions without information get zero."""
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(normal)), np.finfo(float).tiny))
    scaled = normal * np.outer(scale, scale)
    right = (right.T * scale).T
    return (linalg.lstsq(scaled, right, cond=SINGULAR)[0].T * scale).T


def _real_rows(terms: np.ndarray) -> np.ndarray:
    """Complex rows as real columns, real parts above imaginary parts."""
    return np.hstack([terms.real, terms.imag]).T


def _strength(instruments: np.ndarray, jacobian: np.ndarray, noise: np.ndarray) -> float:
    """Smallest canonical correlation of instruments and regressors."""
    z, x = (np.linalg.qr(_real_rows(part / np.sqrt(noise)))[0] for part in (instruments, jacobian))
    return float(np.linalg.svd(z.T @ x, compute_uv=False)[-1])
