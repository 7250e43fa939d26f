"""Excitation of the loop from outside: perturbation, voluntary torque, measurement noise."""

from __future__ import annotations

import numpy as np

from ankleloop.simulation.filters import run_filter, voluntary_filter

__all__ = ["draw_noise", "draw_prbs", "draw_pulses", "draw_voluntary_torque"]


def draw_prbs(rng: np.random.Generator, samples: int, interval: int, amplitude: float) -> np.ndarray:
    """Draw a pseudorandom binary sequence that switches at random multiples of an interval.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of randomness.
    samples : int
        Length.
    interval : int
        Switching interval in samples.
    amplitude : float
        Peak-to-peak amplitude.

    Returns
    -------
    ndarray, shape (samples,)
        Values ±amplitude / 2.

    Examples
    --------
    >>> sorted(set(draw_prbs(np.random.default_rng(1), 1000, 100, 0.04).tolist()))
    [-0.02, 0.02]
    """
    levels = rng.integers(0, 2, size=-(-samples // interval)) - 0.5
    return amplitude * np.repeat(levels, interval)[:samples]


def draw_pulses(rng: np.random.Generator, samples: int, interval: int, length: int, amplitude: float) -> np.ndarray:
    """Draw short pulses of independent random sign at random multiples of an interval, with zeros in between.

    A pulse ends before its reflex begins, and its sign is independent of the next one. So the position and its
    derivatives are uncorrelated with the reflex torque, except for the smearing by the actuator.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of randomness.
    samples : int
        Length.
    interval, length : int
        Interval and length of the pulses in samples; half of the intervals have one.
    amplitude : float
        Peak-to-peak amplitude: pulses reach ± half of it.

    Returns
    -------
    ndarray, shape (samples,)
        Values 0 and ±amplitude / 2.

    Examples
    --------
    >>> sorted(set(draw_pulses(np.random.default_rng(1), 1000, 100, 20, 0.04).tolist()))
    [-0.02, 0.0, 0.02]
    """
    signs = rng.choice([-0.5, 0.0, 0.0, 0.5], size=-(-samples // interval))
    shape = (np.arange(interval) < length).astype(float)
    return amplitude * np.outer(signs, shape).ravel()[:samples]


def draw_voluntary_torque(rng: np.random.Generator, samples: int, rate: float, cutoff: float) -> np.ndarray:
    """Draw Gaussian noise through a second-order Bessel low-pass, of unit standard deviation.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of randomness.
    samples : int
        Length.
    rate : float
        Sampling rate [Hz].
    cutoff : float
        -3 dB frequency [Hz].

    Returns
    -------
    ndarray, shape (samples,)
        A stationary record; 1 is the standard deviation of the process, not of this sample.

    Examples
    --------
    >>> x = draw_voluntary_torque(np.random.default_rng(1), 200_000, 1000.0, 2.0)
    >>> bool(abs(x.std() - 1) < 0.1)
    True
    """
    system, warmup, deviation = voluntary_filter(rate, cutoff)
    return run_filter(*system, rng.standard_normal((1, warmup + samples)))[0, warmup:] / deviation


def draw_noise(rng: np.random.Generator, samples: int, hold: int) -> np.ndarray:
    """Draw white Gaussian noise of unit standard deviation, each value of which is held for some samples.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of randomness.
    samples, hold : int
        Length, and samples for which each value is held.

    Returns
    -------
    ndarray, shape (samples,)

    Examples
    --------
    >>> bool(np.all(np.diff(draw_noise(np.random.default_rng(1), 30, 10).reshape(3, 10)) == 0))
    True
    """
    return np.repeat(rng.standard_normal(-(-samples // hold)), hold)[:samples]
