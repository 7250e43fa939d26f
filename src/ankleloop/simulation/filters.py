"""Bessel filters of the experiment: anti-aliasing filter of the recorder, and low-pass of the voluntary torque."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from ankleloop.signals.statespace import companion, simulate_states, step_matrices
from ankleloop.simulation.settings import SimulationSettings

ANTIALIAS_ORDER = 4
# Bessel polynomials by order, from the highest power, and the frequency in rad/s at which their low-pass is at -3 dB;
# importing scipy.signal for them takes longer than simulating a trial.
BESSEL = {
    2: (np.array([1.0, 3.0, 3.0]), 1.3616541287161306),
    4: (np.array([1.0, 10.0, 45.0, 105.0, 105.0]), 2.1139176749042160),
}
VOLUNTARY_WARMUP = 5.0  # periods of its cutoff until the low-pass of voluntary torque has settled


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


@lru_cache
def bessel_denominator(order: int, cutoff: float) -> np.ndarray:
    """Denominator of the Bessel low-pass with a -3 dB frequency [rad/s].

    Shapes: returns (order + 1,).
    """
    coefficients, frequency = BESSEL[order]
    return coefficients * (cutoff / frequency) ** np.arange(order + 1)


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


def draw_slow_noise(
    rng: np.random.Generator, samples: int, rate: float, cutoff: float
) -> np.ndarray:
    """White noise behind a second-order Bessel low-pass, of unit standard deviation.

    Shapes: returns (samples,).
    """
    warmup = int(np.ceil(VOLUNTARY_WARMUP * rate / cutoff))
    lowpass, deviation = _slow_filter(rate, cutoff, warmup)
    return lowpass.run(rng.standard_normal(warmup + samples))[warmup:] / deviation


@lru_cache
def _slow_filter(rate: float, cutoff: float, warmup: int) -> tuple[DiscreteFilter, float]:
    """The low-pass by the bilinear transform, and the deviation of white noise behind it."""
    half_step = 0.5 / rate
    A, B, _ = companion(bessel_denominator(2, np.tan(np.pi * cutoff / rate) / half_step))
    inverse = np.linalg.inv(np.eye(2) - half_step * A)
    drive = half_step * (inverse @ B)[:, 0]
    # The output is the first state.
    lowpass = DiscreteFilter(2 * inverse - np.eye(2), 2 * drive, inverse[0], drive[0])
    response = lowpass.run(np.eye(1, 2 * warmup + 1)[0])
    return lowpass, float(np.linalg.norm(response))
