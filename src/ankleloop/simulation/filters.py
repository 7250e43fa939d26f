"""Bessel filters of the experiment: the recorder's anti-aliasing filter, and what shapes the voluntary torque.

By hand, because importing a filter library takes longer than simulating fifty trials.
"""

from functools import lru_cache
from math import factorial

import numpy as np
from numba import njit

from ankleloop.signals.discretisation import held_linearly, step_matrices

__all__ = ["antialias", "bessel_denominator", "companion", "run_filter", "voluntary_filter"]

ANTIALIAS_ORDER = 4


def bessel_denominator(order, cutoff):
    """Monic denominator of the Bessel low-pass of unit gain, constant term last.

    Parameters
    ----------
    order : int
        Its order.
    cutoff : float
        -3 dB frequency [rad/s].

    Returns
    -------
    ndarray, shape (order + 1,)

    Examples
    --------
    >>> bessel_denominator(1, 5.0).round(12).tolist()
    [1.0, 5.0]
    """
    # Reverse Bessel polynomial, lowest power first.
    powers = range(order + 1)
    plain = [factorial(2 * order - k) / (2.0 ** (order - k) * factorial(k) * factorial(order - k)) for k in powers]
    # |θ(iω)|² - 2 θ(0)² as a polynomial of ω: its positive root is the -3 dB frequency.
    along = np.array(plain) * 1j ** np.arange(order + 1)
    power = np.convolve(along, along.conj()).real
    power[0] -= 2.0 * plain[0] ** 2
    roots = np.roots(power[::-1])
    edge = roots[(abs(roots.imag) < 1e-9 * abs(roots)) & (roots.real > 0)].real.min()
    scaled = np.array(plain) * (edge / cutoff) ** np.arange(order + 1)
    return (scaled / scaled[-1])[::-1]


def companion(denominator):
    """State matrix whose states are the low-pass output and its derivatives, with the input column."""
    n = denominator.size - 1
    A = np.eye(n, k=1)
    A[-1] = -denominator[:0:-1]
    b = np.zeros(n)
    b[-1] = denominator[-1]
    return A, b


@njit(cache=True)
def run_filter(A, B, C, D, u):
    """Output of a single-input filter from rest, for each of several signals.

    Parameters
    ----------
    A, B, C, D : ndarray, shape (n, n), (n,), (n,), float
        The filter.
    u : ndarray, shape (signals, N)
        Its inputs.

    Returns
    -------
    ndarray, shape (signals, N)
    """
    n = B.size
    y = np.empty(u.shape)
    x, following = np.empty(n), np.empty(n)
    for k in range(u.shape[0]):
        x[:] = 0.0
        for t in range(u.shape[1]):
            total = D * u[k, t]
            for i in range(n):
                total += C[i] * x[i]
                driven = B[i] * u[k, t]
                for j in range(n):
                    driven += A[i, j] * x[j]
                following[i] = driven
            y[k, t] = total
            x[:] = following
    return y


@lru_cache
def _antialias_filter(cutoff, rate, hold):
    A, b = companion(bessel_denominator(ANTIALIAS_ORDER, 2 * np.pi * cutoff))
    C = np.eye(1, b.size)
    if hold == "foh":
        A, B, C, D = held_linearly(A, b[:, None], C, 1.0 / rate)
        return np.ascontiguousarray(A), B[:, 0].copy(), C[0].copy(), float(D[0, 0])
    F, before, after = step_matrices(A, b[:, None], 1.0 / rate)
    return np.ascontiguousarray(F), (before + after)[:, 0].copy(), C[0].copy(), 0.0


def antialias(x, simulation, hold):
    """Pass external signals through the recorder's anti-aliasing filter, exactly.

    Parameters
    ----------
    x : ndarray, shape (N,) or (trials, N)
        The signals at the recording rate.
    simulation : Simulation
        The parameters.
    hold : {"zoh", "foh"}
        Whether the signal is held over each sample or linear between samples.

    Returns
    -------
    ndarray, shape of `x`
    """
    recorder = simulation.recorder
    filtered = _antialias_filter(recorder.antialias_cutoff, recorder.recording_rate, hold)
    return run_filter(*filtered, np.ascontiguousarray(np.atleast_2d(x))).reshape(x.shape)


@lru_cache
def voluntary_filter(rate, cutoff):
    """Second-order Bessel low-pass in discrete time, by the bilinear transform with its cutoff kept.

    Parameters
    ----------
    rate : float
        Sampling rate [Hz].
    cutoff : float
        -3 dB frequency [Hz].

    Returns
    -------
    tuple
        A, B, C, D for `run_filter`; samples until it has settled; and the standard deviation that it leaves of white
        noise of unit variance.
    """
    double = 2.0 * rate
    _, slope, constant = bessel_denominator(2, double * np.tan(np.pi * cutoff / rate))
    a = np.array(
        [double**2 + slope * double + constant, 2 * (constant - double**2), double**2 - slope * double + constant]
    )
    b, a = constant * np.array([1.0, 2.0, 1.0]) / a[0], a / a[0]
    A = np.array([[-a[1], 1.0], [-a[2], 0.0]])
    system = A, b[1:] - a[1:] * b[0], np.array([1.0, 0.0]), float(b[0])
    warmup = int(np.ceil(5 * rate / cutoff))
    response = run_filter(*system, np.eye(1, 2 * warmup + 1))
    return *system, warmup, float(np.linalg.norm(response))
