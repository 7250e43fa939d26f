"""Dynamics of the reflex, continuous in time (Eq. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from ankleloop.joint.model_fields import Stored
from ankleloop.signals.statespace import companion, lowpass_denominator, step_matrices

# Of the logarithm of a parameter, in rad/s or 1: no reflex is as fast, or as damped.
LARGEST_LOGARITHM = np.log(1e4)


@dataclass(frozen=True)
class ReflexDynamics:
    """Low-pass of unit gain, ωn² / (s² + 2ζωn s + ωn²), and p / (s + p) after it where there is a third pole."""

    omega_n: Annotated[float, Stored(unit="rad/s")]  # natural frequency
    zeta: Annotated[float, Stored()]  # damping [1]
    pole: Annotated[float | None, Stored(unit="rad/s")] = None  # third pole p

    @property
    def values(self) -> dict[str, float]:
        """Parameters by name."""
        return {name: value for name, value in vars(self).items() if value is not None}

    @property
    def fastest_pole(self) -> float:
        """Largest decay rate of the second-order part [rad/s]."""
        return float(self.omega_n * (self.zeta + np.sqrt(max(self.zeta**2 - 1.0, 0.0))))

    def scale(self, step: np.ndarray) -> ReflexDynamics:
        """Dynamics after a step of the logarithms of its parameters."""
        values = np.array(list(self.values.values())) * np.exp(step)
        return ReflexDynamics(*values.tolist())

    def response(self, s: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Frequency response, and its derivatives with respect to the logarithm of each parameter."""
        square = self.omega_n**2
        damped = 2 * self.zeta * self.omega_n * s
        denominator = s**2 + damped + square
        response = square / denominator
        relative = [2 - (damped + 2 * square) / denominator, -damped / denominator]
        if self.pole is not None:
            response = response * self.pole / (s + self.pole)
            relative.append(s / (s + self.pole))
        return response, [response * derivative for derivative in relative]

    def matrices(self, rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Discrete matrices A, B, C, D for an input that is linear between samples: a first-order hold."""
        A, B, C = companion(lowpass_denominator(self.omega_n, self.zeta, self.pole))
        F, before, now = step_matrices(A, B, 1.0 / rate)
        return F, F @ now + before, C, C @ now


# Candidates for the start of a search, by the number of poles; frequencies and poles in rad/s.
GRIDS = {
    2: [
        ReflexDynamics(omega, zeta)
        for omega in (10.0, 15.0, 22.0, 33.0, 50.0, 75.0)
        for zeta in (0.5, 1.0)
    ]
}
GRIDS[3] = [replace(dynamics, pole=pole) for pole in (15.0, 40.0, 120.0) for dynamics in GRIDS[2]]


def respond(candidates: Sequence[ReflexDynamics], s: np.ndarray) -> np.ndarray:
    """Frequency responses of several dynamics.

    Shapes: s (F,); returns (candidates, F).
    """
    return np.array([dynamics.response(s)[0] for dynamics in candidates])


def fit_dynamics(
    response: np.ndarray, s: np.ndarray, weight: np.ndarray, order: int = 2
) -> tuple[float, ReflexDynamics, float]:
    r"""Low-pass that is closest to a frequency response, its gain, and the share of the response that it explains.

    .. math:: \min_{G, \omega_n, \zeta, (p)} \sum_f w(f) \, |H(f) - G \, H_0(f; \omega_n, \zeta, p)|^2

    By nonlinear least squares, from the best of some starts.

    Shapes: response (F,), s (F,), weight (F,).
    """
    # Here, because its import takes time and riv does not need it.
    from scipy.optimize import leastsq

    root = np.sqrt(weight / np.sum(weight * np.abs(response) ** 2))
    target = root * response

    def split(unknowns: np.ndarray) -> tuple[float, ReflexDynamics]:
        """Gain and dynamics."""
        logarithms = np.clip(unknowns[1:], -LARGEST_LOGARITHM, LARGEST_LOGARITHM)
        return float(unknowns[0]), ReflexDynamics(*np.exp(logarithms).tolist())

    def error(unknowns: np.ndarray) -> np.ndarray:
        gain, dynamics = split(unknowns)
        return (gain * root * dynamics.response(s)[0] - target).view(float)

    def slopes(unknowns: np.ndarray) -> np.ndarray:
        gain, dynamics = split(unknowns)
        shape, derivatives = dynamics.response(s)
        rows = [shape, *(gain * derivative for derivative in derivatives)]
        return (root * np.array(rows)).view(float)

    # A response without a low-pass has no best one; how little is explained says so, so that the search need not.
    unknowns, *_ = leastsq(
        error,
        _choose_start(root, target, s, order),
        Dfun=slopes,
        col_deriv=True,
        xtol=1e-12,
        ftol=1e-14,
        gtol=1e-14,
        full_output=True,
    )
    gain, dynamics = split(unknowns)
    return gain, dynamics, float(1.0 - np.sum(error(unknowns) ** 2))


def _choose_start(root: np.ndarray, target: np.ndarray, s: np.ndarray, order: int) -> np.ndarray:
    """Gain and logarithms of the dynamics of the grid that explain most of a weighted response.

    Shapes: root (F,), target (F,), s (F,).
    """
    starts = GRIDS[order]
    shapes = root * respond(starts, s)
    products = np.real(shapes.conj() @ target)
    energies = np.sum(np.abs(shapes) ** 2, axis=1)
    best = np.argmax(products**2 / energies)
    parameters = list(starts[best].values.values())
    return np.array([products[best] / energies[best], *np.log(parameters)])
