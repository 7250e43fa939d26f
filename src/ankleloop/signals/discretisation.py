"""Exact discretisation of linear systems whose inputs are linear between samples."""

import numpy as np
from scipy import linalg

__all__ = ["held_linearly", "step_matrices"]


def step_matrices(A, B, step):
    r"""Matrices of one step, :math:`x^+ = F x + G_0 u + G_1 u^+`, exact for inputs that are linear over it.

    Parameters
    ----------
    A, B : ndarray, shape (n, n), (n, m)
        Continuous system, dx/dt = A x + B u.
    step : float
        Length of the step [s].

    Returns
    -------
    F, G0, G1 : ndarray, shape (n, n), (n, m), (n, m)

    Examples
    --------
    >>> F, G0, G1 = step_matrices(np.zeros((1, 1)), np.eye(1), 0.2)
    >>> F.item(), round(G0.item(), 12), round(G1.item(), 12)
    (1.0, 0.1, 0.1)
    """
    n, m = B.shape
    M = np.zeros((n + 2 * m, n + 2 * m))
    M[:n, :n], M[:n, n : n + m] = A * step, B * step
    M[n : n + m, n + m :] = np.eye(m)
    E = linalg.expm(M)
    F, constant, slope = E[:n, :n], E[:n, n : n + m], E[:n, n + m :]
    return F, constant - slope, slope


def held_linearly(A, B, C, step):
    """Discrete state-space matrices of a system without feedthrough, for inputs linear between samples.

    Parameters
    ----------
    A, B, C : ndarray, shape (n, n), (n, m), (p, n)
        Continuous system.
    step : float
        Sampling interval [s].

    Returns
    -------
    A, B, C, D : ndarray
        Discrete system; its state is the continuous one less what the present input has given to it.

    Examples
    --------
    >>> A, B, C, D = held_linearly(np.zeros((1, 1)), np.eye(1), np.eye(1), 0.2)
    >>> [round(matrix.item(), 12) for matrix in (A, B, C, D)]
    [1.0, 0.2, 1.0, 0.1]
    """
    F, before, now = step_matrices(A, B, step)
    return F, F @ now + before, C, C @ now
