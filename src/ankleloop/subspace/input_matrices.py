"""B, D, initial state and offset, given A and C: a linear regression on simulated responses."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import linalg
from scipy.linalg import blas

from ankleloop.errors import DataError
from ankleloop.subspace.records import are_batches, as_batches

__all__ = [
    "InputMatrices",
    "continued",
    "driving",
    "estimate_input_matrices",
    "least_squares",
    "matrices_of",
    "response",
    "sensitivities",
    "state_trajectory",
]

BLOCK = 1024  # samples
SQUARED = 1e-4  # least ratio of singular values for which normal equations keep eight digits


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
    return continued(A, B, C, D, u, x0)[0]


def continued(A, B, C, D, u, x0):
    """Output of a state-space model, and the state that follows, so that a record can come in chunks.

    Parameters
    ----------
    A, B, C, D, u, x0
        As `response` takes them; the state has to be given.

    Returns
    -------
    y : ndarray, shape (N, p)
    x : ndarray, shape (n,)
    """
    drive = np.ascontiguousarray(u @ B.T)
    states = state_trajectory(np.ascontiguousarray(A), drive, x0)
    return states @ C.T + u @ D.T, A @ states[-1] + drive[-1]


def driving(dynamic, inputs):
    """Mask of the inputs that drive the state; all of them, by default."""
    return np.ones(inputs, dtype=bool) if dynamic is None else np.asarray(dynamic, dtype=bool)


# Contraction lets the compiler use fused multiply-adds; sums are not reordered.
@njit(cache=True, fastmath={"contract"})
def _follow(A, u, c, states, out):
    """Rows v(t+1) = v(t) A + u(t) c of some inputs side by side into `out`, from states that are carried on.

    The first entry of all rows comes first, then the second one: the innermost loops run over the inputs.
    """
    n, count = A.shape[0], u.shape[1]
    for t in range(out.shape[0]):
        row = out[t]
        for k in range(n * count):
            row[k] = states[k]
        for k in range(n):
            for j in range(count):
                total = c[k] * u[t, j]
                for i in range(n):
                    total += A[i, k] * row[i * count + j]
                states[k * count + j] = total


def sensitivities(A, C, u, dynamic, observed, driven, out=None):
    """Responses of every output to the entries of D and B, the initial state and the offset.

    The response to a column of B is a row C (q - A)⁻¹ u(t) for each input and output, which follows from the last one:
    n numbers instead of the n² of a state for each entry. Both kinds of rows are carried on in place, so that a record
    can come in chunks.

    Parameters
    ----------
    A, C : ndarray, shape (n, n), (p, n)
        The model so far.
    u : ndarray, shape (N, m)
        Inputs.
    dynamic : ndarray of int
        Inputs that drive the state.
    observed : ndarray, shape (p, n)
        C Aᵗ at the first sample.
    driven : ndarray, shape (p, n * inputs that drive the state)
        The rows at the first sample, the first entry of all of them first.
    out : ndarray, optional
        Where to put them, with zeros between the outputs: memory that is used again costs less than new one.

    Returns
    -------
    ndarray, shape (N, p, m * p + n * dynamic inputs + n + p)
    """
    (samples, m), (p, n) = u.shape, C.shape
    phi = np.zeros((samples, p, m * p + n * dynamic.size + n + p)) if out is None else out
    A, C, undriven = np.ascontiguousarray(A), np.ascontiguousarray(C), np.zeros((samples, 1))
    driving_inputs = np.ascontiguousarray(u if dynamic.size == m else u[:, dynamic])
    for i in range(p):
        phi[:, i, i : m * p : p] = u
        _follow(A, driving_inputs, C[i], driven[i], phi[:, i, m * p : -n - p])
        _follow(A, undriven, C[i], observed[i], phi[:, i, -n - p : -p])
        phi[:, i, i - p] = 1.0
    return phi


def _regressors(A, C, u, dynamic):
    """Regressors of one record, for D and B, its initial state and its offset."""
    phi = sensitivities(A, C, u, dynamic, np.array(C), np.zeros((len(C), len(A) * dynamic.size)))
    return phi.reshape(-1, phi.shape[2])


def _stacked(parts, shared):
    """Regressors of all records: the first columns are theirs together, the others belong to one record each."""
    if len(parts) == 1:
        return parts[0]
    own = linalg.block_diag(*(part[:, shared:] for part in parts))
    return np.hstack([np.concatenate([part[:, :shared] for part in parts]), own])


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
    dynamic = driving(dynamic, m)
    which = np.flatnonzero(dynamic)
    shared = m * p + n * which.size
    if instrument_inputs is None and len(u) == 1:
        found = _by_normal_equations(A, C, u[0], y[0], which, rank_tolerance)
        if found is not None:
            return matrices_of(found[0], (m, n, p), dynamic, 1, *found[1:])
    phi = _stacked([_regressors(A, C, record, which) for record in u], shared)
    if phi.shape[0] < phi.shape[1]:
        raise DataError(f"{phi.shape[0]} samples cannot determine {phi.shape[1]} entries of B, D, x0: record longer.")
    target = np.concatenate([record.reshape(-1) for record in y])
    psi = None
    if instrument_inputs is not None:
        predicted = as_batches(instrument_inputs, several)
        psi = _stacked([_regressors(A, C, record, which) for record in predicted], shared)
    if psi is None:
        theta, rank, condition = least_squares(phi, target, rank_tolerance)
    else:
        theta, rank, condition = _instrumental(phi, target, psi, rank_tolerance)
    return matrices_of(theta, (m, n, p), dynamic, len(u), rank, condition)


def _by_normal_equations(A, C, u, y, which, rank_tolerance):
    """Unknowns, rank and condition for one record; None where squares are not accurate enough.

    The regressors are made a block at a time, which stays in the cache, and are not kept.
    """
    p, n = C.shape
    observed, driven = np.array(C), np.zeros((p, n * which.size))
    space = np.zeros((min(BLOCK, len(u)), p, u.shape[1] * p + n * which.size + n + p))
    gram, right = 0.0, 0.0
    for start in range(0, len(u), BLOCK):
        rows = slice(start, start + BLOCK)
        phi = sensitivities(A, C, u[rows], which, observed, driven, space[: len(u) - start])
        phi = phi.reshape(-1, phi.shape[2])
        gram = gram + blas.dsyrk(1.0, phi.T)  # its upper triangle
        right = right + y[rows].reshape(-1) @ phi
    scale = np.sqrt(np.diag(gram))
    if scale.size > y.size or not scale.all():
        return None
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale), UPLO="U")
    # Squares lose twice the digits that the condition takes.
    if not values[0] > max(SQUARED, 2.0 * rank_tolerance) ** 2 * values[-1]:
        return None
    theta = vectors @ ((vectors.T @ (right / scale)) / values)
    return theta / scale, len(values), float(np.sqrt(values[-1] / values[0]))


def _instrumental(phi, target, psi, rank_tolerance):
    scale, other = _norms(phi), _norms(psi)
    left, right = (psi.T @ phi) / np.outer(other, scale), (psi.T @ target) / other
    theta, _, rank, values = linalg.lstsq(left, right, cond=rank_tolerance, lapack_driver="gelsd")
    return theta / scale, int(rank), float(values[0] / values[rank - 1])


def least_squares(phi, target, rank_tolerance):
    """Least squares from columns of unit norm.

    Parameters
    ----------
    phi : ndarray, shape (N, k)
        Regressors, or a triangular factor of them.
    target : ndarray, shape (N,)
        What they explain.
    rank_tolerance : float
        Directions below this fraction of the largest one are left out.

    Returns
    -------
    theta : ndarray, shape (k,)
    rank : int
    condition : float
        Ratio of the largest to the smallest singular value that counts.
    """
    scale = _norms(phi)
    theta, _, rank, values = linalg.lstsq(phi / scale, target, cond=rank_tolerance, lapack_driver="gelsd")
    return theta / scale, int(rank), float(values[0] / values[rank - 1])


def _norms(phi):
    norms = np.linalg.norm(phi, axis=0)
    norms[norms == 0] = 1.0
    return norms


def matrices_of(theta, sizes, dynamic, records, rank, condition):
    """The unknowns of the regression, sorted into matrices; `sizes` are those of inputs, state and outputs."""
    m, n, p = sizes
    count = int(dynamic.sum())
    direct, driven, own = np.split(theta, [m * p, m * p + n * count])
    B = np.zeros((n, m))
    B[:, dynamic] = driven.reshape(n, count)
    own = own.reshape(records, n + p)
    own = own if records > 1 else own[0]
    return InputMatrices(B, direct.reshape(m, p).T, own[..., :n], own[..., n:], rank, condition)
