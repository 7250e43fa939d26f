"""The reflex path taken apart: a static nonlinearity, and linear dynamics of unit gain behind it."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit

from ankleloop.errors import DataError
from ankleloop.joint.basis import Basis
from ankleloop.joint.dynamics import fit_dynamics
from ankleloop.joint.once import once
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import Band

__all__ = ["ReflexPath", "StaticNonlinearity", "response_gain", "separate"]

LOWEST = 0.05  # Hz
BIN = 0.2  # Hz
CANDIDATES = 60  # thresholds looked at


@dataclass(frozen=True)
class StaticNonlinearity:
    """Torque against delayed velocity, the dynamics behind it being of unit gain.

    Parameters
    ----------
    basis : Basis
        Basis functions.
    coefficients : ndarray, shape (k,)
        Torque per basis function.
    """

    basis: Basis
    coefficients: np.ndarray

    def __call__(self, velocity):
        """Torque at a velocity, beyond that at rest.

        Parameters
        ----------
        velocity : ndarray, shape (N,)
            Delayed velocity [rad/s].

        Returns
        -------
        ndarray, shape (N,)
            Torque [N·m].
        """
        return self.coefficients @ (self.basis(np.asarray(velocity, dtype=float)) - self.basis(np.zeros(1)))

    def curve(self):
        """The nonlinearity where the velocity was, for a picture."""
        velocity = self.basis.quantiles
        return {"velocity": velocity, "torque": self(velocity)}

    def rectifier(self):
        r"""Gain and threshold of the half-wave rectifier that comes closest, over the velocities of the record.

        .. math:: \min_{G, v_0, c} \sum_q \left[f(v_q) - c - G \max(0, v_q - v_0)\right]^2

        Returns
        -------
        gain : float
            G [N·m·s/rad].
        threshold : float
            v₀ [rad/s].
        share : float
            Share of the curve's variance that it explains.
        """
        if self.basis.kind == "rectifier":
            return float(self.coefficients[0]), 0.0, 1.0
        velocity = self.basis.quantiles
        torque = self(velocity)
        centred = torque - torque.mean()
        low, high = velocity[0], velocity[-3]
        for _ in range(3):  # ever finer grids: the criterion has kinks, and may have several valleys
            grid = np.linspace(low, high, CANDIDATES)
            gains, explained = _ramps(velocity, centred, grid)
            best = int(np.argmax(explained))
            low, high = grid[max(best - 1, 0)], grid[min(best + 1, CANDIDATES - 1)]
        return float(gains[best]), float(grid[best]), float(explained[best] / (centred @ centred))


@njit(cache=True)
def _ramps(velocity, centred, thresholds):
    """Gain of the ramp that comes closest to a curve without its mean, at each threshold, and what it explains."""
    gains, explained = np.empty(thresholds.size), np.empty(thresholds.size)
    for k in range(thresholds.size):
        ramp = np.maximum(velocity - thresholds[k], 0.0)
        ramp -= ramp.mean()
        product, energy = np.sum(ramp * centred), np.sum(ramp * ramp)
        gains[k] = product / energy if energy > 0 else 0.0
        explained[k] = gains[k] * product
    return gains, explained


@dataclass(frozen=True)
class ReflexPath:
    """What a linear model of many reflex inputs says of one nonlinearity and one linear system.

    Parameters
    ----------
    nonlinearity : StaticNonlinearity
        Torque against delayed velocity.
    dynamics : ReflexDynamics
        Low-pass of unit gain that comes closest.
    rank_one : float
        Share of the reflex torque's variance that a single linear system explains; 1 for a Hammerstein system.
    low_pass : float
        Share of that system's response that the low-pass explains.
    """

    nonlinearity: StaticNonlinearity
    dynamics: object
    rank_one: float
    low_pass: float

    @property
    def parameters(self):
        """G [N·m·s/rad], threshold [rad/s] of a basis that can have one, ωn [rad/s], ζ, and the pole p [rad/s]."""
        gain, threshold, _ = self.nonlinearity.rectifier()
        found = {"G": gain} if self.nonlinearity.basis.kind == "rectifier" else {"G": gain, "threshold": threshold}
        return {**found, **{name: float(value) for name, value in self.dynamics.values.items()}}

    @property
    def diagnostics(self):
        """Curve of the nonlinearity, and how well the separation describes the model."""
        shares = {"rank_one": self.rank_one, "low_pass": self.low_pass}
        return {"nonlinearity": self.nonlinearity.curve(), "separation": shares}


def separate(matrices, inputs, basis, order=2):
    r"""Separate the reflex path of a linear model into a static nonlinearity and linear dynamics.

    The responses of a Hammerstein system to its basis functions are one response times a coefficient each. So the
    matrix of impulse responses, in the metric R of the inputs' covariance, is approximated by one of rank one,

    .. math:: \min_{g, c} \left\| (H - g c^T) R^{1/2} \right\|_F,

    and g by a low-pass (the two-stage idea of Bai 1998).

    Parameters
    ----------
    matrices : Matrices
        A, B, C, D from the basis functions to the reflex torque, at the identification rate.
    inputs : ndarray, shape (N, k)
        The basis functions on the record.
    basis : Basis
        What they are.
    order : {2, 3}
        Poles of the low-pass.

    Returns
    -------
    ReflexPath

    Raises
    ------
    DataError
        If the model has no reflex torque.

    References
    ----------
    E.-W. Bai, "An optimal two-stage identification algorithm for Hammerstein-Wiener nonlinear systems", Automatica
    34(3), 333-338, 1998.
    """
    s, power = once(inputs, "power", lambda: _power(inputs, 1.0 / matrices.dt))
    responses = matrices.frequency_response(np.exp(s * matrices.dt))
    root = once(inputs, "root", lambda: np.linalg.cholesky(_covariance(inputs)))
    own = np.einsum("fkk->fk", power)
    weight = np.mean(own / own.sum(axis=0), axis=1)
    weighted = np.sqrt(weight)[:, None] * (responses @ root)
    _, values, right = np.linalg.svd(np.vstack([weighted.real, weighted.imag]), full_matrices=False)
    if not values[0] > 0:
        raise DataError("the model has no reflex torque, so there is nothing to separate.")
    coefficients = np.linalg.solve(root.T, right[0])
    single = responses @ (root @ right[0])
    gain, dynamics, share = fit_dynamics(single, s, np.maximum(power @ coefficients @ coefficients, 0.0), order)
    return ReflexPath(
        StaticNonlinearity(basis, gain * coefficients),
        dynamics,
        float(values[0] ** 2 / np.sum(values**2)),
        share,
    )


@lru_cache(maxsize=8)
def _band(samples, rate):
    return Band(samples, rate, LOWEST, PASSBAND * rate)


def _power(inputs, rate):
    """Spectral matrices of the inputs, summed over bins, and the centre of each bin's power on the imaginary axis.

    About that centre a response that is nearly linear in a bin gives what all of its lines give.
    """
    band = _band(len(inputs), rate)
    centres, power = _binned(band.transform(inputs.T), band.frequency, max(1, round(BIN * len(inputs) / rate)))
    return 2j * np.pi * centres, power


@njit(cache=True)
def _binned(spectra, frequency, width):
    channels, lines = spectra.shape
    bins = -(-lines // width)
    own = np.zeros(channels)
    for k in range(channels):
        for f in range(lines):
            own[k] += abs(spectra[k, f]) ** 2
    power, centres = np.zeros((bins, channels, channels)), np.zeros(bins)
    for b in range(bins):
        weights = 0.0
        for f in range(b * width, min((b + 1) * width, lines)):
            weight = 0.0
            for i in range(channels):
                for j in range(i + 1):
                    power[b, i, j] += (spectra[i, f] * spectra[j, f].conjugate()).real
                weight += abs(spectra[i, f]) ** 2 / own[i]
            weights += weight
            centres[b] += weight * frequency[f]
        centres[b] /= weights
        for i in range(channels):
            power[b, :i, i] = power[b, i, :i]
    return centres, power


def _covariance(inputs):
    """Covariance of the inputs, with what keeps nearly dependent ones apart."""
    covariance = np.atleast_2d(np.cov(inputs, rowvar=False))
    return covariance + 1e-10 * np.diag(np.diag(covariance))


def response_gain(response, drive, rate, basis, order=2):
    """The same from the impulse response of a single reflex input.

    Parameters
    ----------
    response : ndarray, shape (lags,)
        Impulse response at the identification rate.
    drive : ndarray, shape (N,)
        The input on the record.
    rate : float
        Identification rate [Hz].
    basis : Basis
        What the input is.
    order : {2, 3}
        Poles of the low-pass.

    Returns
    -------
    ReflexPath
    """
    s, power = once(drive, "power", lambda: _power(drive[:, None], rate))
    frequency_response = np.polyval(response[::-1], np.exp(-s / rate))
    gain, dynamics, share = fit_dynamics(frequency_response, s, power[:, 0, 0], order)
    return ReflexPath(StaticNonlinearity(basis, np.array([gain])), dynamics, 1.0, share)
