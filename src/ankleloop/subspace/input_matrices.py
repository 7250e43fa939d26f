"""B, D, initial state and offset of a model with known A and C: a linear regression on simulated responses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg
from scipy.linalg import blas, lapack

from ankleloop.arguments import check_flag, check_number, show_value
from ankleloop.errors import DataError
from ankleloop.kernels import kernel
from ankleloop.subspace.records import are_merged, list_records

__all__ = [
    "InputMatrices",
    "OutputRegression",
    "Solution",
    "continue_response",
    "estimate_input_matrices",
    "simulate_response",
    "simulate_states",
    "solve_least_squares",
    "solve_regression",
]

CHUNK = 1024  # samples
NEGLIGIBLE = 1e-200  # size of a response that has died away; smaller numbers slow the arithmetic down
LEAST_RATIO = 1e-4  # of singular values, for which normal equations keep eight digits

Solution = tuple[np.ndarray, int, float]  # unknowns, rank and condition of a regression


@dataclass(frozen=True)
class InputMatrices:
    """B, D, initial state and output offset, and the regression that gave them.

    Parameters
    ----------
    B, D : ndarray, shape (n, m), (p, m)
        The matrices.
    initial_state, offset : ndarray, shape (n,), (p,); of merged records (records, n), (records, p)
        State at the first sample, and output without state and input.
    rank : int
        Rank of the regression.
    condition : float
        Its condition.
    """

    B: np.ndarray
    D: np.ndarray
    initial_state: np.ndarray
    offset: np.ndarray
    rank: int
    condition: float


@kernel()
def simulate_states(A, drive, x0):
    """States of x(t+1) = A x(t) + drive(t).

    Shapes: A (n, n), drive (N, n), x0 (n,); returns (N, n).
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


def simulate_response(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, u: np.ndarray, x0: ArrayLike | None = None
) -> np.ndarray:
    """Output of a state-space model.

    Parameters
    ----------
    A, B, C, D : ndarray
        The model.
    u : ndarray, shape (N, m)
        Inputs.
    x0 : array_like, shape (n,), optional
        Initial state; zero by default.

    Returns
    -------
    ndarray, shape (N, p)

    Raises
    ------
    ValueError
        If A, B and the initial state differ in their number of states.

    Examples
    --------
    >>> A, B, C, D = (np.array([[value]]) for value in (0.5, 1.0, 1.0, 0.0))
    >>> simulate_response(A, B, C, D, np.array([[1.0], [0.0], [0.0]])).ravel()
    array([0. , 1. , 0.5])
    """
    x0 = np.zeros(A.shape[0]) if x0 is None else np.asarray(x0, dtype=float)
    if x0.shape != A.shape[:1] or A.shape != (B.shape[0],) * 2:  # compiled code does not check its indices
        raise ValueError(f"A {A.shape}, B {B.shape} and x0 {x0.shape} must have one number of states.")
    return continue_response(A, B, C, D, u, x0)[0]


def continue_response(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, u: np.ndarray, x0: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Output of a state-space model, and the state that follows, for a record that comes in chunks.

    Shapes: x0 (n,); returns y (N, p), x (n,).
    """
    drive = np.ascontiguousarray(u @ B.T)
    states = simulate_states(np.ascontiguousarray(A), drive, x0)
    return states @ C.T + u @ D.T, A @ states[-1] + drive[-1]


# Contraction lets the compiler use fused multiply-adds; sums are not reordered.
@kernel(fastmath={"contract"})
def _propagate_rows(A, u, c, states, out):
    """Rows v(t+1) = v(t) A + u(t) c of some inputs side by side into `out`; `states` become those that follow.

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


@kernel()
def _fill_regressors(A, C, u, dynamic_inputs, offset, states, regressors):
    """Responses of every output to each unknown; `states`, free and forced, become those that follow."""
    samples, inputs = u.shape
    (p, n), (free, forced) = C.shape, states
    d_end = inputs * p
    b_end = d_end + forced.shape[1]
    no_input = np.zeros((samples, 1))
    for i in range(p):
        for t in range(samples):
            for k in range(inputs):
                regressors[t, i, k * p + i] = u[t, k]
            regressors[t, i, b_end + n + i] = offset
        _propagate_rows(A, dynamic_inputs, C[i], forced[i], regressors[:, i, d_end:b_end])
        _propagate_rows(A, no_input, C[i], free[i], regressors[:, i, b_end : b_end + n])


class OutputRegression:
    """Regression of the outputs on their responses to the entries of D and B, the initial state and the offset.

    Parameters
    ----------
    A, C : ndarray, shape (n, n), (p, n)
        State and output matrix.
    inputs : int
        Number of inputs m.
    dynamic : array_like of bool, shape (m,), optional
        Inputs that drive the state; all, by default.
    offsets : bool
        False takes the offset of every output to be zero: its column, too.
    """

    def __init__(
        self, A: np.ndarray, C: np.ndarray, inputs: int, dynamic: ArrayLike | None = None, *, offsets: bool = True
    ) -> None:
        self.offset = 1.0 if offsets else 0.0
        self.A, self.C, self.inputs = np.ascontiguousarray(A), np.ascontiguousarray(C), inputs
        self.dynamic = np.arange(inputs) if dynamic is None else _list_dynamic(dynamic, inputs)
        p, n = C.shape
        self.edges = [inputs * p, inputs * p + n * self.dynamic.size]  # the unknowns of D end here, and those of B
        self.unknowns = self.edges[1] + n + p

    def generate_regressors(self, chunks: Iterable[np.ndarray]) -> Iterator[np.ndarray]:
        """Responses of every output to each unknown, for one record chunk by chunk.

        The response to a column of B is a row C (q - A)⁻¹ u(t) for each input and output, which follows from the row
        before: n numbers instead of the n² of a state for each entry.

        Shapes: chunks (N, m); returns (N * p, unknowns).
        """
        A, C = self.A, self.C
        p = len(C)
        d_end, b_end = self.edges
        # Free and forced responses at the first sample of a chunk: C Aᵗ, and the rows of all dynamic inputs.
        free, forced = C.copy(), np.zeros((p, b_end - d_end))
        memory = np.zeros((0, p, self.unknowns))  # zero between the outputs
        for u in chunks:
            if len(u) > len(memory):
                memory = np.zeros((len(u), p, self.unknowns))
            phi, u = memory[: len(u)], np.ascontiguousarray(u)
            dynamic_inputs = u if self.dynamic.size == self.inputs else np.ascontiguousarray(u[:, self.dynamic])
            _fill_regressors(A, C, u, dynamic_inputs, self.offset, (free, forced), phi)
            free[np.abs(free) < NEGLIGIBLE] = 0.0
            yield phi.reshape(-1, self.unknowns)

    def merge_regressors(self, records: Sequence[np.ndarray]) -> np.ndarray:
        """Regressors of all records: D and B are common to them, initial state and offset belong to one each."""
        parts = [next(self.generate_regressors([record])) for record in records]
        if len(parts) == 1:
            return parts[0]
        common, individual = zip(*(np.split(part, self.edges[1:], axis=1) for part in parts), strict=True)
        return np.hstack([np.concatenate(common), linalg.block_diag(*individual)])

    def unpack(self, solution: Solution, records: int = 1) -> InputMatrices:
        """Sort the unknowns into matrices."""
        theta, rank, condition = solution
        p, n = self.C.shape
        d, b, rest = np.split(theta, self.edges)
        B = np.zeros((n, self.inputs))
        B[:, self.dynamic] = b.reshape(n, self.dynamic.size)
        rest = rest.reshape((records, n + p) if records > 1 else n + p)
        return InputMatrices(B, d.reshape(self.inputs, p).T, rest[..., :n], rest[..., n:], rank, condition)


def _list_dynamic(dynamic: ArrayLike, inputs: int) -> np.ndarray:
    """Numbers of the inputs that drive the state."""
    flags = dynamic if isinstance(dynamic, np.ndarray) else np.array(dynamic, dtype=object)
    if flags.shape != (inputs,) or not all(isinstance(flag, (bool, np.bool_)) for flag in flags):
        raise ValueError(f"dynamic must be {inputs} flags, True or False for each input, got {show_value(dynamic)}.")
    return np.flatnonzero(flags)


def estimate_input_matrices(
    A: np.ndarray,
    C: np.ndarray,
    u: Any,
    y: Any,
    dynamic: ArrayLike | None = None,
    instrument_inputs: Any = None,
    rank_tolerance: float = 1e-10,
    *,
    offsets: bool = True,
) -> InputMatrices:
    r"""B, D, x0 and offset by least squares, or with instruments.

    The output is linear in them, :math:`y(t) = C A^t x_0 + \sum_k C A^{t-1-k} B u(k) + D u(t) + d`. With instruments,
    the regressors are simulated a second time from noise-free predictions of the inputs, and the normal equations
    :math:`\Psi^T \Phi \theta = \Psi^T y` are solved: they are consistent where least squares is biased by feedback.

    Parameters
    ----------
    A, C : ndarray, shape (n, n), (p, n)
        State and output matrix.
    u, y : ndarray, shape (N, m), (N, p), or lists of those
        Inputs and outputs, of similar size; of one record or of several.
    dynamic : array_like of bool, shape (m,), optional
        Inputs that drive the state; the rows of B of all others are zero (Eq. 11). All, by default.
    instrument_inputs : ndarray, shape (N, m), or list of those, optional
        Predicted noise-free inputs; None for least squares.
    rank_tolerance : float
        Directions below this fraction of the largest one are left out (columns have unit norm).
    offsets : bool
        False estimates no offsets: the data are deviations from an equilibrium.

    Returns
    -------
    InputMatrices

    Raises
    ------
    DataError
        If there are fewer samples than unknowns.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> A, B, C, D = np.array([[0.5]]), np.array([[2.0]]), np.array([[1.0]]), np.array([[0.1]])
    >>> u = rng.standard_normal((100, 1))
    >>> y = simulate_response(A, B, C, D, u)
    >>> fit = estimate_input_matrices(A, C, u, y)
    >>> bool(np.allclose(fit.B, B)), bool(np.allclose(fit.D, D))
    (True, True)
    """
    rank_tolerance = check_number("estimate_input_matrices", "rank_tolerance", rank_tolerance, ge=0, lt=1)
    offsets = check_flag("estimate_input_matrices", "offsets", offsets)
    merged = are_merged(u)
    inputs, outputs = list_records(u, merged, "input"), list_records(y, merged, "output")
    instruments = None
    if instrument_inputs is not None:
        instruments = list_records(instrument_inputs, merged, "instrument_inputs")
    regression = OutputRegression(A, C, inputs[0].shape[1], dynamic, offsets=offsets)
    return solve_regression(regression, inputs, outputs, instruments, rank_tolerance)


def solve_regression(
    regression: OutputRegression,
    inputs: Sequence[np.ndarray],
    outputs: Sequence[np.ndarray],
    instrument_inputs: Sequence[np.ndarray] | None,
    rank_tolerance: float,
) -> InputMatrices:
    """B, D, x0 and offset of records that have been checked.

    Shapes: inputs, outputs (N, m), instrument_inputs (N, m).
    """
    if instrument_inputs is None and len(inputs) == 1:
        solution = _solve_normal_equations(regression, inputs[0], outputs[0], rank_tolerance)
        if solution is not None:
            return regression.unpack(solution)
    phi = regression.merge_regressors(inputs)
    if phi.shape[0] < phi.shape[1]:
        raise DataError(f"{phi.shape[0]} samples cannot determine {phi.shape[1]} entries of B, D, x0: record longer.")
    target = np.concatenate([record.reshape(-1) for record in outputs])
    if instrument_inputs is None:
        solution = solve_least_squares(phi, target, rank_tolerance)
    else:
        psi = regression.merge_regressors(instrument_inputs)
        solution = _solve_instruments(phi, target, psi, rank_tolerance)
    return regression.unpack(solution, len(inputs))


def _solve_normal_equations(
    regression: OutputRegression, u: np.ndarray, y: np.ndarray, rank_tolerance: float
) -> Solution | None:
    """Unknowns, rank and condition for one record; None where squares are not accurate enough.

    The regressors are not kept: they are computed and used chunk by chunk, because a chunk stays in the cache.
    """
    chunks = [slice(start, start + CHUNK) for start in range(0, len(u), CHUNK)]
    gram: Any = 0.0
    right: Any = 0.0
    for chunk, phi in zip(chunks, regression.generate_regressors(u[chunk] for chunk in chunks), strict=True):
        gram = gram + blas.dsyrk(1.0, phi.T)  # its upper triangle
        right = right + y[chunk].reshape(-1) @ phi
    scale = np.sqrt(np.diag(gram))
    if scale.size > y.size or not scale.all():
        return None
    values, vectors, info = lapack.dsyevd(gram / (scale[:, None] * scale))  # of the upper triangle
    # Squares lose twice the digits that the condition takes.
    if info or not values[0] > max(LEAST_RATIO, 2.0 * rank_tolerance) ** 2 * values[-1]:
        return None
    theta = vectors @ ((vectors.T @ (right / scale)) / values)
    return theta / scale, len(values), float(np.sqrt(values[-1] / values[0]))


def _solve_instruments(phi: np.ndarray, target: np.ndarray, psi: np.ndarray, rank_tolerance: float) -> Solution:
    """Unknowns, rank and condition from the normal equations with instruments psi."""
    scale, psi_scale = _column_norms(phi), _column_norms(psi)
    left, right = (psi.T @ phi) / np.outer(psi_scale, scale), (psi.T @ target) / psi_scale
    return _solve(left, right, scale, rank_tolerance)


def solve_least_squares(phi: np.ndarray, target: np.ndarray, rank_tolerance: float) -> Solution:
    """Least squares from columns that are scaled to unit norm.

    Shapes: phi (N, k), target (N,); returns theta (k,).
    """
    scale = _column_norms(phi)
    return _solve(phi / scale, target, scale, rank_tolerance)


def _solve(phi: np.ndarray, target: np.ndarray, scale: np.ndarray, rank_tolerance: float) -> Solution:
    theta, _, rank, values = linalg.lstsq(phi, target, cond=rank_tolerance, lapack_driver="gelsd")
    return theta / scale, int(rank), float(values[0] / values[rank - 1]) if rank else np.inf


def _column_norms(phi: np.ndarray) -> np.ndarray:
    """Norms of columns, 1 for columns of zeros."""
    norms = np.linalg.norm(phi, axis=0)
    norms[norms == 0] = 1.0
    return norms
