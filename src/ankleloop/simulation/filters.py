"""Bessel filters of the experiment: anti-aliasing filter of the recorder, and low-pass of the voluntary torque."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from ankleloop.signals.statespace import companion, simulate_states, step_matrices
from ankleloop.simulation.settings import SimulationSettings

ANTIALIAS_ORDER = 4
VOLUNTARY_WARMUP = (
    5.0  # periods of its cutoff until the low-pass of the voluntary torque has settled
)
# Upper poles of Bessel low-passes whose -3 dB frequency is 1 rad/s, those of `scipy.signal.besselap(n, norm="mag")`:
# importing that takes longer than simulating fifty trials.
POLES = {
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
        return (
            simulate_states(self.A, self.B[:, None], u[:, None], np.zeros(self.B.size))[0] @ self.C
            + self.D * u
        )


def bessel_denominator(order: int, cutoff: float) -> np.ndarray:
    """Denominator of the Bessel low-pass of order 2 or 4 with a -3 dB frequency [rad/s].

    Shapes: returns (order + 1,).
    """
    poles = cutoff * np.array(POLES[order])
    return np.poly(np.concatenate([poles, poles.conj()])).real


@lru_cache
def _antialias_filter(cutoff: float, rate: float, hold: str) -> DiscreteFilter:
    A, B, C = companion(bessel_denominator(ANTIALIAS_ORDER, 2 * np.pi * cutoff))
    F, before, now = step_matrices(A, B, 1.0 / rate)
    B, D = (F @ now + before, float(C[0] @ now[:, 0])) if hold == "foh" else (before + now, 0.0)
    return DiscreteFilter(np.ascontiguousarray(F), B[:, 0].copy(), C[0], D)


def antialias(
    x: np.ndarray, settings: SimulationSettings, hold: Literal["zoh", "foh"]
) -> np.ndarray:
    """Pass external signals through the anti-aliasing filter of the recorder, exactly; unchanged if it has none.

    Shapes: x (N,).
    """
    if settings.antialias_cutoff is None:
        return x
    return _antialias_filter(settings.antialias_cutoff, settings.recording_rate, hold).run(x)


@lru_cache
def voluntary_filter(rate: float, cutoff: float) -> tuple[DiscreteFilter, int, float]:
    """Second-order Bessel low-pass in discrete time, by the bilinear transform with prewarped cutoff."""
    double = 2.0 * rate
    _, slope, constant = bessel_denominator(2, double * np.tan(np.pi * cutoff / rate))
    a = np.array(
        [
            double**2 + slope * double + constant,
            2 * (constant - double**2),
            double**2 - slope * double + constant,
        ]
    )
    b, a = constant * np.array([1.0, 2.0, 1.0]) / a[0], a / a[0]
    A = np.array([[-a[1], 1.0], [-a[2], 0.0]])
    system = DiscreteFilter(A, b[1:] - a[1:] * b[0], np.array([1.0, 0.0]), float(b[0]))
    warmup = int(np.ceil(VOLUNTARY_WARMUP * rate / cutoff))
    response = system.run(np.eye(1, 2 * warmup + 1)[0])
    return system, warmup, float(np.linalg.norm(response))
