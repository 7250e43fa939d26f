"""Bessel filters of the experiment: anti-aliasing filter of the recorder, and low-pass of the voluntary torque.

They are designed here, because importing a filter library takes longer than simulating fifty trials.
"""

from __future__ import annotations

from functools import lru_cache
from math import factorial
from typing import Literal, NamedTuple

import numpy as np

from ankleloop.kernels import kernel
from ankleloop.signals.discretisation import companion, discretise_foh, step_matrices
from ankleloop.simulation.settings import SimulationSettings

__all__ = [
    "DiscreteFilter",
    "antialias",
    "antialias_denominator",
    "bessel_denominator",
    "run_filter",
    "voluntary_filter",
]

ANTIALIAS_ORDER = 4
VOLUNTARY_WARMUP = 5.0  # periods of its cutoff until the low-pass of the voluntary torque has settled


class DiscreteFilter(NamedTuple):
    """State-space matrices of a discrete single-input filter, shapes (n, n), (n,), (n,) and a float."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: float


def bessel_denominator(order: int, cutoff: float) -> np.ndarray:
    """Denominator of the Bessel low-pass of unit gain.

    Shapes: returns (order + 1,).
    """
    # Reverse Bessel polynomial, lowest power first.
    powers = range(order + 1)
    theta = [factorial(2 * order - k) / (2.0 ** (order - k) * factorial(k) * factorial(order - k)) for k in powers]
    # |θ(iω)|² - 2 θ(0)² as a polynomial of ω: its positive root is the -3 dB frequency.
    axis = np.array(theta) * 1j ** np.arange(order + 1)
    power = np.convolve(axis, axis.conj()).real
    power[0] -= 2.0 * theta[0] ** 2
    roots = np.roots(power[::-1])
    edge = roots[(abs(roots.imag) < 1e-9 * abs(roots)) & (roots.real > 0)].real.min()
    coefficients = np.array(theta) * (edge / cutoff) ** np.arange(order + 1)
    return (coefficients / coefficients[-1])[::-1]


def antialias_denominator(cutoff: float) -> np.ndarray:
    """Denominator of the anti-aliasing filter with a -3 dB frequency [Hz], shape (5,); see `bessel_denominator`."""
    return bessel_denominator(ANTIALIAS_ORDER, 2 * np.pi * cutoff)


@kernel()
def run_filter(A, B, C, D, u):
    """Output of a single-input filter from rest, for each of several signals.

    Shapes: A, B, C, D (n, n), u (signals, N); returns (signals, N).
    """
    n = B.size
    y = np.empty(u.shape)
    x, x_next = np.empty(n), np.empty(n)
    for k in range(u.shape[0]):
        x[:] = 0.0
        for t in range(u.shape[1]):
            output = D * u[k, t]
            for i in range(n):
                output += C[i] * x[i]
                state = B[i] * u[k, t]
                for j in range(n):
                    state += A[i, j] * x[j]
                x_next[i] = state
            y[k, t] = output
            x[:] = x_next
    return y


@lru_cache
def _antialias_filter(cutoff: float, rate: float, hold: str) -> DiscreteFilter:
    A, B, C = companion(antialias_denominator(cutoff))
    if hold == "foh":
        A, B, C, D = discretise_foh(A, B, C, 1.0 / rate)
        return DiscreteFilter(np.ascontiguousarray(A), B[:, 0].copy(), C[0].copy(), float(D[0, 0]))
    F, before, now = step_matrices(A, B, 1.0 / rate)
    return DiscreteFilter(np.ascontiguousarray(F), (before + now)[:, 0].copy(), C[0].copy(), 0.0)


def antialias(x: np.ndarray, settings: SimulationSettings, hold: Literal["zoh", "foh"]) -> np.ndarray:
    """Pass external signals through the anti-aliasing filter of the recorder, exactly; unchanged if it has none.

    Shapes: x (N,).
    """
    if settings.antialias_cutoff is None:
        return x
    system = _antialias_filter(settings.antialias_cutoff, settings.recording_rate, hold)
    return run_filter(*system, np.ascontiguousarray(np.atleast_2d(x))).reshape(x.shape)


@lru_cache
def voluntary_filter(rate: float, cutoff: float) -> tuple[DiscreteFilter, int, float]:
    """Second-order Bessel low-pass in discrete time, by the bilinear transform with prewarped cutoff."""
    double = 2.0 * rate
    _, slope, constant = bessel_denominator(2, double * np.tan(np.pi * cutoff / rate))
    a = np.array(
        [double**2 + slope * double + constant, 2 * (constant - double**2), double**2 - slope * double + constant]
    )
    b, a = constant * np.array([1.0, 2.0, 1.0]) / a[0], a / a[0]
    A = np.array([[-a[1], 1.0], [-a[2], 0.0]])
    system = DiscreteFilter(A, b[1:] - a[1:] * b[0], np.array([1.0, 0.0]), float(b[0]))
    warmup = int(np.ceil(VOLUNTARY_WARMUP * rate / cutoff))
    response = run_filter(*system, np.eye(1, 2 * warmup + 1))
    return system, warmup, float(np.linalg.norm(response))
