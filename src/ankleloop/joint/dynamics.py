"""Dynamics of the reflex, continuous in time (Eq. 2)."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from ankleloop.signals.discretisation import held_linearly

__all__ = ["ReflexDynamics", "fit_dynamics"]

STARTS = [(omega, zeta) for omega in (10.0, 15.0, 22.0, 33.0, 50.0, 75.0) for zeta in (0.5, 1.0)]
POLES = (15.0, 40.0, 120.0)  # rad/s
ITERATIONS, CONVERGED = 100, 1e-6
FURTHEST = 1e4  # rad/s, or 1: no reflex is as fast, or as damped


@dataclass(frozen=True)
class ReflexDynamics:
    """Low-pass of unit gain, ωn² / (s² + 2ζωn s + ωn²), and p / (s + p) after it where there is a third pole.

    Parameters
    ----------
    omega_n : float
        Natural frequency [rad/s].
    zeta : float
        Damping [1].
    pole : float, optional
        Third pole p [rad/s].
    """

    omega_n: float
    zeta: float
    pole: float | None = None

    @property
    def values(self):
        """Parameters by name."""
        given = {"omega_n": self.omega_n, "zeta": self.zeta, "pole": self.pole}
        return {name: value for name, value in given.items() if value is not None}

    @classmethod
    def grid(cls, order):
        """Dynamics to start a search from.

        Parameters
        ----------
        order : {2, 3}
            Number of poles.

        Returns
        -------
        list of ReflexDynamics
        """
        poles = [None] if order == 2 else POLES
        return [cls(omega, zeta, pole) for pole in poles for omega, zeta in STARTS]

    def moved(self, step):
        """Dynamics after a step of the logarithms of its parameters."""
        return ReflexDynamics(*(np.array(list(self.values.values())) * np.exp(step)).tolist())

    def response(self, s):
        """Frequency response, and its derivatives with respect to the logarithm of each parameter.

        Parameters
        ----------
        s : ndarray of complex
            Laplace variable [rad/s].

        Returns
        -------
        response : ndarray
        derivatives : list of ndarray
        """
        square, damped = self.omega_n**2, 2 * self.zeta * self.omega_n * s
        denominator = s**2 + damped + square
        response = square / denominator
        relative = [2 - (damped + 2 * square) / denominator, -damped / denominator]
        if self.pole is not None:
            response = response * self.pole / (s + self.pole)
            relative.append(s / (s + self.pole))
        return response, [response * part for part in relative]

    def matrices(self, rate):
        """Discrete matrices A, B, C, D for an input that is linear between samples.

        Parameters
        ----------
        rate : float
            Sampling rate [Hz].

        Returns
        -------
        tuple of ndarray
        """
        denominator = np.array([1.0, 2 * self.zeta * self.omega_n, self.omega_n**2])
        if self.pole is not None:
            denominator = np.convolve(denominator, [1.0, self.pole])
        n = denominator.size - 1
        A = np.diag(np.ones(n - 1), 1)
        A[-1] = -denominator[:0:-1]
        B, C = np.zeros((n, 1)), np.zeros((1, n))
        B[-1], C[0, 0] = denominator[-1], 1.0
        return held_linearly(A, B, C, 1.0 / rate)


def fit_dynamics(response, s, weight, order=2):
    r"""Low-pass that comes closest to a frequency response, and its gain.

    .. math:: \min_{G, \omega_n, \zeta, (p)} \sum_f w(f) \, |H(f) - G \, H_0(f; \omega_n, \zeta, p)|^2

    Parameters
    ----------
    response : ndarray of complex, shape (F,)
        Frequency response.
    s : ndarray of complex, shape (F,)
        Laplace variable [rad/s].
    weight : ndarray, shape (F,)
        Weights, the spectrum of the input: then it is the torque that the low-pass comes close to.
    order : {2, 3}
        Number of poles.

    Returns
    -------
    gain : float
    dynamics : ReflexDynamics
    share : float
        Share of the weighted response that the low-pass explains.

    Examples
    --------
    >>> s = 2j * np.pi * np.linspace(0.1, 30, 200)
    >>> gain, dynamics, share = fit_dynamics(5.0 * ReflexDynamics(40.0, 0.9).response(s)[0], s, np.ones(200))
    >>> round(gain, 6), round(dynamics.omega_n, 6), round(dynamics.zeta, 6), round(share, 6)
    (5.0, 40.0, 0.9, 1.0)
    """
    weight = weight / np.sum(weight * np.abs(response) ** 2)
    starts = np.array([list(dynamics.values.values()) for dynamics in ReflexDynamics.grid(order)])
    values, gain, left = _search(starts, s.imag.copy(), weight, np.ascontiguousarray(response, dtype=complex))
    return float(gain), ReflexDynamics(*values.tolist()), float(1.0 - left)


@njit(cache=True)
def _search(starts, omega, weight, target):
    """Parameters, gain and what they leave, from the best of some starts (Levenberg and Marquardt).

    What the slopes leave out of the curvature is learnt by symmetric secant updates: a poor fit converges by it.
    """
    values = starts[0]
    gain, left, normal, downhill = _projected(values, omega, weight, target)
    for start in starts[1:]:
        found = _projected(start, omega, weight, target)
        if found[1] < left:
            values, (gain, left, normal, downhill) = start, found
    damping, bend = 1e-6, np.zeros_like(normal)
    for _ in range(ITERATIONS):
        curved = normal + bend
        if np.linalg.eigvalsh(curved)[0] <= 0:
            curved = normal.copy()
        for i in range(values.size):
            curved[i, i] += damping * (normal[i, i] + 1e-30)
        step = np.linalg.solve(curved, downhill)
        tried = values * np.exp(np.minimum(np.maximum(step, -1.0), 1.0))
        found = _projected(tried, omega, weight, target)
        if found[1] <= left and tried.min() > 1.0 / FURTHEST and tried.max() < FURTHEST:
            missing = downhill - found[3] - (found[2] + bend) @ step
            size = missing @ step
            if abs(size) > 1e-8 * np.sqrt((missing @ missing) * (step @ step)):
                bend = bend + np.outer(missing, missing) / size
            values, (gain, left, normal, downhill) = tried, found
            damping = max(damping / 10.0, 1e-12)
        else:
            damping, bend = 10.0 * damping, np.zeros_like(bend)
        if np.max(np.abs(step)) < CONVERGED or damping > 1e9:
            break
    return values, gain, left


@njit(cache=True)
def _projected(values, omega, weight, target):
    """Gain, what it leaves, and normal equations of the slopes: the gain is projected out (Golub and Pereyra 1973)."""
    n, size = values.size, omega.size
    square, damping = values[0] ** 2, 2.0 * values[0] * values[1]
    shape, slopes = np.empty(size, dtype=np.complex128), np.empty((n, size), dtype=np.complex128)
    own, answer = 0.0, 0.0
    for f in range(size):
        s = 1j * omega[f]
        denominator = s * s + damping * s + square
        h = square / denominator
        if n == 3:
            h = h * values[2] / (s + values[2])
            slopes[2, f] = h * s / (s + values[2])
        slopes[0, f] = h * (2.0 - (damping * s + 2.0 * square) / denominator)
        slopes[1, f] = -h * damping * s / denominator
        shape[f] = h
        own += weight[f] * (h.real**2 + h.imag**2)
        answer += weight[f] * (h.real * target[f].real + h.imag * target[f].imag)
    gain, left = answer / own, 0.0
    along, downhill, normal = np.zeros(n), np.zeros(n), np.zeros((n, n))
    for f in range(size):
        h, miss = shape[f], target[f] - gain * shape[f]
        left += weight[f] * (miss.real**2 + miss.imag**2)
        for i in range(n):
            a = slopes[i, f]
            along[i] += weight[f] * (a.real * h.real + a.imag * h.imag)
            downhill[i] += weight[f] * (a.real * miss.real + a.imag * miss.imag)
            for j in range(i + 1):
                b = slopes[j, f]
                normal[i, j] += weight[f] * (a.real * b.real + a.imag * b.imag)
    for i in range(n):
        for j in range(i + 1):
            aside = gain**2 * (normal[i, j] - along[i] * along[j] / own) + downhill[i] * downhill[j] / own
            normal[i, j], normal[j, i] = aside, aside
    return gain, left, normal, gain * downhill
