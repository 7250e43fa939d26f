"""B, D, initial state and offset, given A and C: a linear regression on simulated responses."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.subspace.batches import are_batches, as_batches

__all__ = ["InputMatrices", "estimate_input_matrices", "response", "state_trajectory"]


@dataclass(frozen=True)
class InputMatrices:
    """B, D, initial state and output offset (rows for data batches), rank and condition of their regression."""

    B: np.ndarray
    D: np.ndarray
    initial_state: np.ndarray
    offset: np.ndarray
    rank: int
    condition: float


@njit(cache=True)
def state_trajectory(A, drive, x0):
    """States of x(t+1) = A x(t) + drive(t).

    Parameters
    ----------
    A : ndarray, shape (n, n)
        State matrix.
    drive : ndarray, shape (N, n)
        B u(t).
    x0 : ndarray, shape (n,)
        Initial state.

    Returns
    -------
    ndarray, shape (N, n)
    """
    samples, n = drive.shape
    states = np.empty((samples, n))
    x, x_next = x0.copy(), np.empty(n)
    for t in range(samples):
        states[t] = x
        for i in range(n):
            total = drive[t, i]
            for j in range(n):
                total += A[i, j] * x[j]
            x_next[i] = total
        x, x_next = x_next, x
    return states


def response(A, B, C, D, u, x0=None):
    """Output of a state-space model.

    Parameters
    ----------
    A, B, C, D : ndarray
        The model.
    u : ndarray, shape (N, m)
        Inputs.
    x0 : ndarray, shape (n,), optional
        Initial state; zero by default.

    Returns
    -------
    ndarray, shape (N, p)

    Examples
    --------
    >>> A, B, C, D = (np.array([[value]]) for value in (0.5, 1.0, 1.0, 0.0))
    >>> response(A, B, C, D, np.array([[1.0], [0.0], [0.0]])).ravel()
    array([0. , 1. , 0.5])
    """
    x0 = np.zeros(A.shape[0]) if x0 is None else np.asarray(x0, dtype=float)
    states = state_trajectory(np.ascontiguousarray(A), np.ascontiguousarray(u @ B.T), x0)
    return states @ C.T + u @ D.T


def _responses(A, C, u, dynamic):
    """Responses of every output to D and B, shape (N, p, m·p + n·(dynamic inputs))."""
    (samples, m), n, p = u.shape, A.shape[0], C.shape[0]
    blocks = [np.einsum("tj,ik->tijk", u, np.eye(p)).reshape(samples, p, m * p)]
    for j in np.flatnonzero(dynamic):
        for state in range(n):
            drive = np.zeros((samples, n))
            drive[:, state] = u[:, j]
            blocks.append((state_trajectory(A, drive, np.zeros(n)) @ C.T)[:, :, None])
    return np.concatenate(blocks, axis=2)


def _transients(A, C, samples):
    """Responses of every output to the initial state and the offset, shape (N, p, n + p)."""
    n, p = A.shape[0], C.shape[0]
    nothing = np.zeros((samples, n))
    blocks = [(state_trajectory(A, nothing, start) @ C.T)[:, :, None] for start in np.eye(n)]
    blocks.append(np.broadcast_to(np.eye(p), (samples, p, p)))
    return np.concatenate(blocks, axis=2)


def _regressors(A, C, batches, dynamic):
    """Regressors for D and B, which all records share, and for the initial state and offset of each."""
    A = np.ascontiguousarray(A)
    flat = [_responses(A, C, u, dynamic) for u in batches]
    shared = np.concatenate([part.reshape(-1, part.shape[2]) for part in flat])
    own = [_transients(A, C, len(u)) for u in batches]
    return np.hstack([shared, linalg.block_diag(*(part.reshape(-1, part.shape[2]) for part in own))])


def estimate_input_matrices(A, C, u, y, dynamic=None, instrument_inputs=None, rank_tolerance=1e-10):
    r"""B, D, x0 and offset by least squares, or with instruments.

    The output is linear in them, :math:`y(t) = C A^t x_0 + \sum_k C A^{t-1-k} B u(k) + D u(t) + d`. With instruments,
    the regressors are simulated a second time from noise-free predictions of the inputs, and the normal equations
    :math:`\Psi^T \Phi \theta = \Psi^T y` are solved: they are consistent where least squares is biased by feedback.

    Parameters
    ----------
    A, C : ndarray, shape (n, n), (p, n)
        The model so far.
    u, y : ndarray, shape (N, m), (N, p), or lists of those
        Inputs and outputs, of similar size; of one record, or of several data batches.
    dynamic : ndarray of bool, shape (m,), optional
        Inputs that drive the state; the rows of B of all others are zero (Eq. 11). All, by default.
    instrument_inputs : ndarray, shape (N, m), or list of those, optional
        Predicted noise-free inputs; None for least squares.
    rank_tolerance : float
        Directions below this fraction of the largest one are left out (columns have unit norm).

    Returns
    -------
    InputMatrices

    Raises
    ------
    DataError
        If there are fewer samples than unknowns.
    """
    several = are_batches(u)
    u, y = as_batches(u, several), as_batches(y, several)
    m, n, p = u[0].shape[1], A.shape[0], C.shape[0]
    dynamic = np.ones(m, dtype=bool) if dynamic is None else np.asarray(dynamic, dtype=bool)
    phi = _regressors(A, C, u, dynamic)
    if phi.shape[0] < phi.shape[1]:
        raise DataError(f"{phi.shape[0]} samples cannot determine {phi.shape[1]} entries of B, D, x0: record longer.")
    scale = np.linalg.norm(phi, axis=0)
    scale[scale == 0] = 1.0
    left, right = phi / scale, np.concatenate([record.reshape(-1) for record in y])
    if instrument_inputs is not None:
        psi = _regressors(A, C, as_batches(instrument_inputs, several), dynamic)
        psi_scale = np.linalg.norm(psi, axis=0)
        psi = psi / np.where(psi_scale == 0, 1.0, psi_scale)
        left, right = psi.T @ left, psi.T @ right
    theta, _, rank, values = linalg.lstsq(left, right, cond=rank_tolerance, lapack_driver="gelsd")
    return _matrices(theta / scale, (m, n, p), dynamic, len(u), int(rank), float(values[0] / values[rank - 1]))


def _matrices(theta, sizes, dynamic, records, rank, condition):
    m, n, p = sizes
    count = int(dynamic.sum())
    direct, driven, own = np.split(theta, [m * p, m * p + n * count])
    B = np.zeros((n, m))
    B[:, dynamic] = driven.reshape(count, n).T
    own = own.reshape(records, n + p)
    own = own if records > 1 else own[0]
    return InputMatrices(B, direct.reshape(m, p).T, own[..., :n], own[..., n:], rank, condition)
