"""Low-pass filters as state-space systems, their exact discretisation, and the recursion of their states."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from ankleloop.kernels import kernel

LARGEST_ENTRY = 1e12  # of a matrix whose exponential needs no balancing


def lowpass_denominator(frequency: float, damping: float, pole: float | None = None) -> np.ndarray:
    r"""Denominator of a second-order low-pass, with or without a further real pole.

    .. math:: (s^2 + 2 \zeta \omega_n s + \omega_n^2) \, (s + p)

    Shapes: returns (3,), with a further pole (4,).
    """
    denominator = np.array([1.0, 2 * damping * frequency, frequency**2])
    if pole is None:
        return denominator
    return np.convolve(denominator, [1.0, pole])


def companion(denominator: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State-space form of a low-pass of unit gain whose state is its output with the derivatives of it.

    Shapes: denominator (n + 1,); returns A, B, C (n, n).
    """
    n = denominator.size - 1
    A = np.eye(n, k=1)
    A[-1] = -denominator[:0:-1]
    B = np.zeros((n, 1))
    B[-1] = denominator[-1]
    return A, B, np.eye(1, n)


def step_matrices(
    A: np.ndarray, B: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Matrices of one step, :math:`x^+ = F x + G_0 u + G_1 u^+`, exact for inputs that are linear over it.

    Shapes: A, B (n, n); returns F, G0, G1 (n, n).
    """
    n, m = B.shape
    M = np.zeros((n + 2 * m, n + 2 * m))
    M[:n, :n] = A * step
    M[:n, n : n + m] = B * step
    M[n : n + m, n + m :] = np.eye(m)
    scale = np.ones(len(M))
    # The states of a fast filter differ by many powers of ten: they are scaled alike.
    if np.abs(M).max() >= LARGEST_ENTRY:
        # SciPy converts scales to the numbers of a permutation, which is not used.
        with np.errstate(invalid="ignore"):
            M, (scale, _) = linalg.matrix_balance(M, permute=False, separate=True)
    E = linalg.expm(M) * scale[:, None] / scale
    constant = E[:n, n : n + m]
    slope = E[:n, n + m :]
    return E[:n, :n], constant - slope, slope


@kernel()
def simulate_states(A: np.ndarray, B: np.ndarray, u: np.ndarray, x0: np.ndarray) -> np.ndarray:
    """States of x(t+1) = A x(t) + B u(t).

    Shapes: A (n, n), B (n, m), u (N, m), x0 (n,); returns (N, n).
    """
    states = np.empty((len(u) + 1, len(A)))
    states[0] = x0
    for t in range(len(u)):
        x = states[t]
        x_next = states[t + 1]
        drive = u[t]
        for i in range(len(A)):
            total = 0.0
            for j in range(B.shape[1]):
                total += B[i, j] * drive[j]
            for j in range(len(A)):
                total += A[i, j] * x[j]
            x_next[i] = total
    return states[:-1]
