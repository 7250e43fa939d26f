"""The equations of refined instrumental variables: between spectra of the measured and of the predicted inputs."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.reference_response import share_explained
from ankleloop.joint.regressors import INTRINSIC_NAMES, predicted_inputs
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import Band

__all__ = ["MOTION", "WEIGHTINGS", "Found", "Parameters", "Problem"]

WEIGHTINGS = ("noise", "flat")

LOWEST = 0.05  # Hz: drifts and means lie below
NOISE_RESOLUTION = 0.4  # Hz
DELAYS = np.arange(0.02, 0.121, 0.01)  # s: where an unknown delay is looked for
DELAY_LIMITS = (0.015, 0.15)  # s: no stretch reflex is faster; a shorter one could not be told from viscosity
LARGEST_STEP = 0.4  # of a natural frequency or damping in one iteration
LARGEST_DELAY_STEP = 0.01  # s
WEAKEST = 0.05  # share of the position that the reference predicts
FURTHEST = 20.0  # of the highest frequency: a pole beyond [rad/s] leaves no trace in the band
SINGULAR = 1e-12  # of the largest singular value of scaled equations
MOTION = len(INTRINSIC_NAMES)


@dataclass(frozen=True)
class Parameters:
    """Linear parameters K, B, I, c₁ …, the dynamics behind the latter, and the delay."""

    linear: np.ndarray
    dynamics: ReflexDynamics
    shift: float = 0.0  # of the delay from the nominal one [s]

    def moved(self, step):
        """Parameters after a step of the linear ones, of the logarithms of the dynamics and of an unknown delay."""
        linear, dynamics, shift = np.split(step, np.cumsum([self.linear.size, len(self.dynamics.values)]))
        return Parameters(self.linear + linear, self.dynamics.moved(dynamics), self.shift + shift.sum())


@dataclass(frozen=True)
class Found:
    """Where the iteration ended."""

    parameters: Parameters
    covariance: np.ndarray  # of what a step of `Parameters` holds
    iterations: int
    converged: bool
    criteria: tuple  # at the start and at the end
    strength: float
    noise: np.ndarray


class Problem:
    """Spectra of the measured and of the predicted inputs, and the equations between them."""

    def __init__(self, trial, regressors, delay, free_delay, order, weighting):
        self.regressors, self.order, self.weighting = regressors, order, weighting
        self.delay, self.free_delay = delay, free_delay
        self.band = Band(regressors.torque.size, regressors.rate, LOWEST, PASSBAND * regressors.rate)
        self.torque = self.band.transform(regressors.torque)
        self.measured = self.band.transform(regressors.inputs.T)
        self.explained = self._check_reference()
        self.predicted = self.band.transform(predicted_inputs(trial, regressors, delay).T)

    def _check_reference(self):
        """Refuse a reference that does not move the joint."""
        r = self.regressors
        if r.reference_name == "position":
            return 1.0
        share = share_explained(r.inputs[:, 0], r.reference, r.rate)
        if share < WEAKEST:
            raise DataError(
                f"{r.reference_name} explains {100 * max(share, 0.0):.0f} % of the position: as an instrument it is "
                "too weak to say anything. Give the command of the servo as reference; reference='position' is for "
                "records in open loop."
            )
        return share

    def _terms(self, spectra, parameters):
        """Responses to the linear parameters; and to the other ones, given the linear ones."""
        response, derivatives = parameters.dynamics.response(self.band.s)
        late = np.exp(-self.band.s * parameters.shift)
        driven = late * spectra[MOTION:]
        combined = parameters.linear[MOTION:] @ driven
        others = [derivative * combined for derivative in derivatives]
        if self.free_delay:
            others.append(-self.band.s * response * combined)
        return np.vstack([spectra[:MOTION], response * driven]), np.array(others)

    def _residual(self, spectra, parameters):
        return self.torque - parameters.linear @ self._terms(spectra, parameters)[0]

    def _noise(self, residual):
        power = self.band.smoothed(np.abs(residual) ** 2, NOISE_RESOLUTION)
        return np.maximum(power, 1e-12 * power.max())

    def start(self):
        """Best of a grid of dynamics for the predicted position: a fit to what the reference explains."""
        shifts = DELAYS - self.delay if self.free_delay else [0.0]
        grid = [(dynamics, shift) for dynamics in ReflexDynamics.grid(self.order) for shift in shifts]
        filters = np.array([dynamics.response(self.band.s)[0] for dynamics, _ in grid[:: len(shifts)]])
        late = np.exp(-np.outer(shifts, self.band.s))
        filters = (filters[:, None] * late).reshape(len(grid), -1)
        best = self._best(grid, filters, np.ones(self.band.s.size))
        if self.weighting == "flat":
            return best
        return self._best(grid, filters, self._noise(self._residual(self.predicted, best)))

    def _best(self, grid, filters, noise):
        """Fit the linear parameters for all of the grid at once: normal equations are products with the filters."""
        motion, driven = np.split(self.predicted, [MOTION])
        k = len(driven)
        weighted = motion.conj() / noise
        normal = np.empty((len(grid), MOTION + k, MOTION + k))
        normal[:, :MOTION, :MOTION] = np.real(weighted @ motion.T)
        cross = np.real(filters @ (weighted[:, None] * driven).reshape(MOTION * k, -1).T).reshape(-1, MOTION, k)
        normal[:, :MOTION, MOTION:], normal[:, MOTION:, :MOTION] = cross, np.swapaxes(cross, 1, 2)
        own = np.real(driven.conj()[:, None] * driven / noise).reshape(k * k, -1)
        normal[:, MOTION:, MOTION:] = (np.abs(filters) ** 2 @ own.T).reshape(-1, k, k)
        right = np.empty((len(grid), MOTION + k))
        right[:, :MOTION] = np.real(weighted @ self.torque)
        right[:, MOTION:] = np.real(filters @ (driven * self.torque.conj() / noise).T)
        scale = 1.0 / np.sqrt(np.einsum("gii->gi", normal))
        scaled = normal * scale[:, :, None] * scale[:, None] + 1e-12 * np.eye(MOTION + k)
        linear = scale * np.linalg.solve(scaled, (scale * right)[..., None])[..., 0]
        best = int(np.argmax(np.sum(right * linear, axis=1)))  # what it explains
        return Parameters(linear[best], *grid[best])

    def refine(self, start, max_iterations, tolerance):
        """Iterate noise spectrum, derivatives and parameters."""
        parameters = start
        for iteration in range(1, max_iterations + 1):
            noise = self._noise(self._residual(self.measured, parameters))
            level = noise if self.weighting == "noise" else np.full(noise.size, noise.mean())
            parameters = self._linear(parameters, level)
            instruments, jacobian = (np.vstack(self._terms(x, parameters)) for x in (self.predicted, self.measured))
            weighted = instruments.conj() / level
            normal = np.real(weighted @ jacobian.T)
            step = _solved(normal, np.real(weighted @ self._residual(self.measured, parameters)))
            scatter = np.real((weighted * noise) @ weighted.conj().T)
            covariance = self._covariance(normal, scatter)
            share = self._share(step)
            parameters = parameters.moved(share * step)
            if self.left_band(parameters) or self.left_delays(parameters):
                converged = False
                break
            converged = share == 1.0 and np.all(np.abs(step) <= tolerance * np.sqrt(np.diag(covariance)))
            if converged and iteration > 1:
                break
        criteria = tuple(self._criterion(weighted, scatter, at) for at in (start, parameters))
        strength = _strength(instruments, jacobian, level)
        return Found(parameters, covariance, iteration, bool(converged), criteria, strength, noise)

    def left_band(self, parameters):
        """Whether a pole is so fast that it leaves no trace."""
        values = parameters.dynamics.values
        return max(values["omega_n"], values.get("pole", 0.0)) > FURTHEST * self.band.highest

    def left_delays(self, parameters):
        """Whether an estimated delay is none that a reflex can have."""
        return self.free_delay and not DELAY_LIMITS[0] <= self.delay + parameters.shift <= DELAY_LIMITS[1]

    def _linear(self, parameters, noise):
        """Linear parameters in closed form, the dynamics being given."""
        instruments, terms = (self._terms(x, parameters)[0] for x in (self.predicted, self.measured))
        weighted = instruments.conj() / noise
        linear = _solved(np.real(weighted @ terms.T), np.real(weighted @ self.torque))
        return Parameters(linear, parameters.dynamics, parameters.shift)

    def _share(self, step):
        """Share of a step that stays within what one iteration may change."""
        largest = np.array([LARGEST_STEP] * self.order + [LARGEST_DELAY_STEP] * self.free_delay)
        return min(1.0, float(np.min(largest / np.maximum(np.abs(step[-largest.size :]), 1e-30))))

    def _covariance(self, normal, scatter):
        """Asymptotic covariance of the parameters; each frequency counts twice, as a complex number does.

        Weights from the noise are an estimate themselves. To first order in the variance a of a smoothed periodogram
        over its square the equations scatter by 1 + 3a more than with the true spectrum, where this formula says 1 + a.
        """
        inverse = _solved(normal, np.eye(len(normal)))
        estimated = 1.0 + 2.0 * self.band.smoothing_variance(NOISE_RESOLUTION) if self.weighting == "noise" else 1.0
        return 0.5 * self.band.correlation * estimated * inverse @ scatter @ inverse.T

    def _criterion(self, weighted, scatter, parameters):
        """Size of the instrumental equations' left side, in units of its standard deviation."""
        left = np.real(weighted @ self._residual(self.measured, parameters))
        return float(left @ _solved(scatter, left))


def _solved(normal, right):
    """Solve normal equations whose unknowns have units of their own; directions without information stay put."""
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(normal)), np.finfo(float).tiny))
    scaled = normal * np.outer(scale, scale)
    right = (right.T * scale).T
    return (linalg.lstsq(scaled, right, cond=SINGULAR)[0].T * scale).T


def _stacked(terms, target):
    """Real least squares from complex rows."""
    return np.hstack([terms.real, terms.imag]).T, np.concatenate([target.real, target.imag])


def _strength(instruments, jacobian, noise):
    """Smallest canonical correlation of instruments and regressors."""
    z, x = (np.linalg.qr(_stacked(part / np.sqrt(noise), part[0])[0])[0] for part in (instruments, jacobian))
    return float(np.linalg.svd(z.T @ x, compute_uv=False)[-1])
