"""Excitation of the loop from outside: perturbation, voluntary torque, measurement noise."""

from __future__ import annotations

import numpy as np

from ankleloop.simulation.filters import voluntary_filter

__all__ = ["draw_noise", "draw_prbs", "draw_pulses", "draw_voluntary_torque"]


def draw_prbs(rng: np.random.Generator, samples: int, interval: int, amplitude: float) -> np.ndarray:
    """Draw a pseudorandom binary sequence that switches at random multiples of an interval.

    Shapes: returns (samples,).
    """
    levels = rng.integers(0, 2, size=-(-samples // interval)) - 0.5
    return amplitude * np.repeat(levels, interval)[:samples]


def draw_pulses(rng: np.random.Generator, samples: int, interval: int, length: int, amplitude: float) -> np.ndarray:
    """Draw short pulses of independent random sign at random multiples of an interval, with zeros in between.

    A pulse ends before its reflex begins, and its sign is independent of the next one. So the position and its
    derivatives are uncorrelated with the reflex torque, except for the smearing by the actuator.

    Shapes: returns (samples,).
    """
    signs = rng.choice([-0.5, 0.0, 0.0, 0.5], size=-(-samples // interval))
    shape = (np.arange(interval) < length).astype(float)
    return amplitude * np.outer(signs, shape).ravel()[:samples]


def draw_voluntary_torque(rng: np.random.Generator, samples: int, rate: float, cutoff: float) -> np.ndarray:
    """Draw Gaussian noise through a second-order Bessel low-pass, of unit standard deviation.

    Shapes: returns (samples,).
    """
    system, warmup, deviation = voluntary_filter(rate, cutoff)
    return system.run(rng.standard_normal(warmup + samples))[warmup:] / deviation


def draw_noise(rng: np.random.Generator, samples: int, hold: int) -> np.ndarray:
    """Draw white Gaussian noise of unit standard deviation, each value of which is held for some samples.

    Shapes: returns (samples,).
    """
    return np.repeat(rng.standard_normal(-(-samples // hold)), hold)[:samples]
