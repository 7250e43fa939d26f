"""Dynamics of the reflex, continuous in time (Eq. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ankleloop.kernels import kernel
from ankleloop.signals.statespace import companion, discretise_foh, lowpass_denominator

__all__ = ["ReflexDynamics", "fit_dynamics"]

STARTS = [(omega, zeta) for omega in (10.0, 15.0, 22.0, 33.0, 50.0, 75.0) for zeta in (0.5, 1.0)]
POLES = (15.0, 40.0, 120.0)  # rad/s
MAX_ITERATIONS, STEP_TOLERANCE = 100, 1e-6
LARGEST = 1e4  # rad/s, or 1: no reflex is as fast, or as damped


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
    def values(self) -> dict[str, float]:
        """Parameters by name."""
        values = {"omega_n": self.omega_n, "zeta": self.zeta, "pole": self.pole}
        return {name: value for name, value in values.items() if value is not None}

    @classmethod
    def grid(cls, order: int) -> list[ReflexDynamics]:
        """Candidates for the start of a search."""
        poles: Sequence[float | None] = [None] if order == 2 else POLES
        return [cls(omega, zeta, pole) for pole in poles for omega, zeta in STARTS]

    def scale(self, step: np.ndarray) -> ReflexDynamics:
        """Dynamics after a step of the logarithms of its parameters."""
        return ReflexDynamics(*(np.array(list(self.values.values())) * np.exp(step)).tolist())

    def response(self, s: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Frequency response, and its derivatives with respect to the logarithm of each parameter."""
        square, damped = self.omega_n**2, 2 * self.zeta * self.omega_n * s
        denominator = s**2 + damped + square
        response = square / denominator
        relative = [2 - (damped + 2 * square) / denominator, -damped / denominator]
        if self.pole is not None:
            response = response * self.pole / (s + self.pole)
            relative.append(s / (s + self.pole))
        return response, [response * part for part in relative]

    def matrices(self, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Discrete matrices A, B, C, D for an input that is linear between samples."""
        denominator = lowpass_denominator(self.omega_n, self.zeta, self.pole)
        return discretise_foh(*companion(denominator), 1.0 / rate)


def fit_dynamics(
    response: np.ndarray, s: np.ndarray, weight: np.ndarray, order: int = 2
) -> tuple[float, ReflexDynamics, float]:
    r"""Low-pass that is closest to a frequency response, and its gain.

    .. math:: \min_{G, \omega_n, \zeta, (p)} \sum_f w(f) \, |H(f) - G \, H_0(f; \omega_n, \zeta, p)|^2

    Shapes: response (F,), s (F,), weight (F,).
    """
    weight = weight / np.sum(weight * np.abs(response) ** 2)
    starts = np.array([list(dynamics.values.values()) for dynamics in ReflexDynamics.grid(order)])
    values, gain, residual = _search(starts, s.imag.copy(), weight, np.ascontiguousarray(response, dtype=complex))
    return float(gain), ReflexDynamics(*values.tolist()), float(1.0 - residual)


@kernel()
def _search(starts, omega, weight, target):
    """Parameters, gain and residual, from the best of some starts (Levenberg and Marquardt).

    Symmetric secant updates add the curvature that the slopes do not show; poor fits converge by them.
    """
    values = starts[0]
    gain, residual, normal, descent = _project_gain(values, omega, weight, target)
    for start in starts[1:]:
        trial = _project_gain(start, omega, weight, target)
        if trial[1] < residual:
            values, (gain, residual, normal, descent) = start, trial
    damping, curvature = 1e-6, np.zeros_like(normal)
    for _ in range(MAX_ITERATIONS):
        hessian = normal + curvature
        if np.linalg.eigvalsh(hessian)[0] <= 0:
            hessian = normal.copy()
        for i in range(values.size):
            hessian[i, i] += damping * (normal[i, i] + 1e-30)
        step = np.linalg.solve(hessian, descent)
        candidate = values * np.exp(np.minimum(np.maximum(step, -1.0), 1.0))
        trial = _project_gain(candidate, omega, weight, target)
        if trial[1] <= residual and candidate.min() > 1.0 / LARGEST and candidate.max() < LARGEST:
            defect = descent - trial[3] - (trial[2] + curvature) @ step
            size = defect @ step
            if abs(size) > 1e-8 * np.sqrt((defect @ defect) * (step @ step)):
                curvature = curvature + np.outer(defect, defect) / size
            values, (gain, residual, normal, descent) = candidate, trial
            damping = max(damping / 10.0, 1e-12)
        else:
            damping, curvature = 10.0 * damping, np.zeros_like(curvature)
        if np.max(np.abs(step)) < STEP_TOLERANCE or damping > 1e9:
            break
    return values, gain, residual


@kernel()
def _project_gain(values, omega, weight, target):
    """Gain, residual, and normal equations of the slopes: the gain is projected out (Golub and Pereyra 1973)."""
    n, size = values.size, omega.size
    square, damping = values[0] ** 2, 2.0 * values[0] * values[1]
    shape, slopes = np.empty(size, dtype=np.complex128), np.empty((n, size), dtype=np.complex128)
    energy, product = 0.0, 0.0
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
        energy += weight[f] * (h.real**2 + h.imag**2)
        product += weight[f] * (h.real * target[f].real + h.imag * target[f].imag)
    gain, residual = product / energy, 0.0
    aligned, descent, normal = np.zeros(n), np.zeros(n), np.zeros((n, n))
    for f in range(size):
        h, error = shape[f], target[f] - gain * shape[f]
        residual += weight[f] * (error.real**2 + error.imag**2)
        for i in range(n):
            a = slopes[i, f]
            aligned[i] += weight[f] * (a.real * h.real + a.imag * h.imag)
            descent[i] += weight[f] * (a.real * error.real + a.imag * error.imag)
            for j in range(i + 1):
                b = slopes[j, f]
                normal[i, j] += weight[f] * (a.real * b.real + a.imag * b.imag)
    for i in range(n):
        for j in range(i + 1):
            value = gain**2 * (normal[i, j] - aligned[i] * aligned[j] / energy) + descent[i] * descent[j] / energy
            normal[i, j], normal[j, i] = value, value
    return gain, residual, normal, gain * descent
