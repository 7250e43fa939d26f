"""Dynamics of the reflex, continuous in time (Eq. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated

import numpy as np

from ankleloop.joint.model_fields import Stored
from ankleloop.signals.statespace import companion, lowpass_denominator, step_matrices

STARTS = [(omega, zeta) for omega in (10.0, 15.0, 22.0, 33.0, 50.0, 75.0) for zeta in (0.5, 1.0)]
POLES = (15.0, 40.0, 120.0)  # rad/s
MAX_ITERATIONS, STEP_TOLERANCE = 100, 1e-6
LARGEST = 1e4  # rad/s, or 1: no reflex is as fast, or as damped


@dataclass(frozen=True)
class ReflexDynamics:
    """Low-pass of unit gain, ωn² / (s² + 2ζωn s + ωn²), and p / (s + p) after it where there is a third pole."""

    omega_n: Annotated[float, Stored(unit="rad/s")]  # natural frequency
    zeta: Annotated[float, Stored()]  # damping [1]
    pole: Annotated[float | None, Stored(unit="rad/s")] = None  # third pole p

    @property
    def values(self) -> dict[str, float]:
        """Parameters by name."""
        values = {"omega_n": self.omega_n, "zeta": self.zeta}
        return values if self.pole is None else {**values, "pole": self.pole}

    @staticmethod
    @cache
    def grid(order: int) -> tuple[ReflexDynamics, ...]:
        """Candidates for the start of a search."""
        poles: Sequence[float | None] = [None] if order == 2 else POLES
        return tuple(ReflexDynamics(omega, zeta, pole) for pole in poles for omega, zeta in STARTS)

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
        """Discrete matrices A, B, C, D for an input that is linear between samples: a first-order hold."""
        A, B, C = companion(lowpass_denominator(self.omega_n, self.zeta, self.pole))
        F, before, now = step_matrices(A, B, 1.0 / rate)
        return F, F @ now + before, C, C @ now


def respond(grid: Sequence[ReflexDynamics], s: np.ndarray) -> np.ndarray:
    """Frequency responses of several dynamics.

    Shapes: s (F,); returns (size, F).
    """
    return np.array([dynamics.response(s)[0] for dynamics in grid])


def fit_dynamics(
    response: np.ndarray, s: np.ndarray, weight: np.ndarray, order: int = 2
) -> tuple[float, ReflexDynamics, float]:
    r"""Low-pass that is closest to a frequency response, its gain, and the share of the response that it explains.

    .. math:: \min_{G, \omega_n, \zeta, (p)} \sum_f w(f) \, |H(f) - G \, H_0(f; \omega_n, \zeta, p)|^2

    By the method of Levenberg and Marquardt from the best of some starts. Symmetric secant updates add the curvature
    that the slopes do not show; poor fits converge by them.

    Shapes: response (F,), s (F,), weight (F,).
    """
    root = np.sqrt(weight / np.sum(weight * np.abs(response) ** 2))
    target = root * response
    starts = ReflexDynamics.grid(order)
    shapes = root * respond(starts, s)
    explained = np.real(shapes.conj() @ target) ** 2 / np.sum(np.abs(shapes) ** 2, axis=1)
    dynamics = starts[int(np.argmax(explained))]
    gain, residual, normal, descent = _project_gain(dynamics, s, root, target)
    damping, curvature = 1e-6, np.zeros_like(normal)
    for _ in range(MAX_ITERATIONS):
        hessian = normal + curvature
        if np.linalg.eigvalsh(hessian)[0] <= 0:
            hessian = normal
        step = np.linalg.solve(hessian + damping * np.diag(normal.diagonal() + 1e-30), descent)
        candidate = dynamics.scale(np.clip(step, -1.0, 1.0))
        trial = _project_gain(candidate, s, root, target)
        sizes = list(candidate.values.values())
        if trial[1] <= residual and min(sizes) > 1.0 / LARGEST and max(sizes) < LARGEST:
            defect = descent - trial[3] - (trial[2] + curvature) @ step
            size = defect @ step
            if abs(size) > 1e-8 * np.sqrt((defect @ defect) * (step @ step)):
                curvature = curvature + np.outer(defect, defect) / size
            dynamics, (gain, residual, normal, descent) = candidate, trial
            damping = max(damping / 10.0, 1e-12)
        else:
            damping, curvature = 10.0 * damping, np.zeros_like(curvature)
        if np.max(np.abs(step)) < STEP_TOLERANCE or damping > 1e9:
            break
    return gain, dynamics, 1.0 - residual


def _project_gain(
    dynamics: ReflexDynamics, s: np.ndarray, root: np.ndarray, target: np.ndarray
) -> tuple[float, float, np.ndarray, np.ndarray]:
    """Gain, residual, and normal equations of the slopes: the gain is projected out (Golub and Pereyra 1973)."""
    shape, slopes = dynamics.response(s)
    rows = root * np.array([shape, *slopes])
    products = (rows.conj() @ np.vstack([rows, target]).T).real
    energy, gain = float(products[0, 0]), float(products[0, -1] / products[0, 0])
    aligned, descent = products[1:, 0], products[1:, -1] - gain * products[1:, 0]
    normal = gain**2 * (products[1:, 1:-1] - np.outer(aligned, aligned) / energy) + np.outer(descent, descent) / energy
    error = target - gain * rows[0]
    return gain, float(np.vdot(error, error).real), normal, gain * descent
