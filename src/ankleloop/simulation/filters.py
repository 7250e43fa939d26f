"""Bessel filters of the experiment: anti-aliasing filter of the recorder, and low-pass of the voluntary torque."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from ankleloop.signals.statespace import companion, simulate_states, step_matrices
from ankleloop.simulation.settings import SimulationSettings

ANTIALIAS_ORDER = 4
VOLUNTARY_WARMUP = 5.0  # periods of its cutoff until the low-pass of voluntary torque has settled
# Upper poles of Bessel low-passes whose -3 dB frequency is 1 rad/s, those of `scipy.signal.besselap(n, norm="mag")`:
# importing that takes longer than simulating fifty trials.
BESSEL_POLES = {
    2: (-1.1016013305921608 + 0.636009824757034j,),
    4: (-0.995208764350272 + 1.257105739454664j, -1.3700678305514422 + 0.41024971749375155j),
}


class DiscreteFilter(NamedTuple):
    """State-space matrices of a discrete single-input filter, shapes (n, n), (n,), (n,) and a float."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: float

    def run(self, u: np.ndarray) -> np.ndarray:
        """Output from rest.

        Shapes: u (N,); returns (N,).
        """
        rest = np.zeros(self.B.size)
        states = simulate_states(self.A, self.B[:, None], u[:, None], rest)
        return states @ self.C + self.D * u


def bessel_denominator(order: int, cutoff: float) -> np.ndarray:
    """Denominator of the Bessel low-pass of order 2 or 4 with a -3 dB frequency [rad/s].

    Shapes: returns (order + 1,).
    """
    poles = cutoff * np.array(BESSEL_POLES[order])
    return np.poly(np.concatenate([poles, poles.conj()])).real


@lru_cache
def _antialias_filter(cutoff: float, rate: float, hold: str) -> DiscreteFilter:
    """The anti-aliasing filter for inputs that are held, or linear, over a sample."""
    A, B, C = companion(bessel_denominator(ANTIALIAS_ORDER, 2 * np.pi * cutoff))
    F, before, now = step_matrices(A, B, 1.0 / rate)
    drive = before + now
    feedthrough = 0.0
    if hold == "foh":
        drive = before + F @ now
        feedthrough = now[0, 0]
    return DiscreteFilter(np.ascontiguousarray(F), drive[:, 0].copy(), C[0], feedthrough)


def antialias(
    x: np.ndarray, settings: SimulationSettings, hold: Literal["zoh", "foh"]
) -> np.ndarray:
    """Pass external signals through the anti-aliasing filter of the recorder, exactly; unchanged if it has none.

    Shapes: x (N,).
    """
    if settings.antialias_cutoff is None or not x.any():
        return x
    return _antialias_filter(settings.antialias_cutoff, settings.recording_rate, hold).run(x)


@lru_cache
def voluntary_filter(rate: float, cutoff: float) -> tuple[DiscreteFilter, int, float]:
    """Second-order Bessel low-pass in discrete time, by the bilinear transform with prewarped cutoff."""
    double = 2.0 * rate
    square = double**2
    _, slope, constant = bessel_denominator(2, double * np.tan(np.pi * cutoff / rate))
    linear = slope * double
    leading = square + linear + constant
    a1 = 2 * (constant - square) / leading
    a2 = (square - linear + constant) / leading
    gain = constant / leading  # the numerator is gain · (1, 2, 1)
    A = np.array([[-a1, 1.0], [-a2, 0.0]])
    B = np.array([2 * gain - a1 * gain, gain - a2 * gain])
    system = DiscreteFilter(A, B, np.array([1.0, 0.0]), float(gain))
    warmup = int(np.ceil(VOLUNTARY_WARMUP * rate / cutoff))
    impulse = np.eye(1, 2 * warmup + 1)[0]
    return system, warmup, float(np.linalg.norm(system.run(impulse)))
