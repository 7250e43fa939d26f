"""B, D, initial state and offset of a model with known A and C: a linear regression on simulated responses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack

from ankleloop.errors import DataError
from ankleloop.options import check_flag, check_number, show_value
from ankleloop.signals.statespace import simulate_states
from ankleloop.subspace.records import are_merged, list_records

BLOCK = 16  # columns of a panel: narrow ones leave most of the work to matrix products

Chunks = Iterable[tuple[np.ndarray, np.ndarray]]  # inputs and outputs of a record, some samples at a time


@dataclass(frozen=True)
class InputMatrices:
    """B, D, initial state and output offset, and the regression that gave them."""

    B: np.ndarray  # shape (n, m)
    D: np.ndarray  # shape (p, m)
    initial_state: np.ndarray  # shape (n,), of merged records (records, n): state at the first sample
    offset: np.ndarray  # shape (p,), of merged records (records, p): output without state and input
    rank: int  # rank of the regression
    condition: float  # its condition


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
    states, x = simulate_states(np.ascontiguousarray(A), np.ascontiguousarray(u @ B.T), x0)
    return states @ C.T + u @ D.T, x


class OutputRegression:
    """Regression of the outputs on their responses to the entries of D and B, the initial states and the offsets.

    Parameters
    ----------
    A, C : ndarray, shape (n, n), (p, n)
        State and output matrix.
    inputs : int
        Number of inputs m.
    dynamic : array_like of bool, shape (m,), optional
        Inputs that drive the state; all, by default.
    records : int
        Records, each with an initial state and an offset of its own.
    offsets : bool
        False takes all offsets to be zero: their columns, too.
    """

    def __init__(
        self,
        A: np.ndarray,
        C: np.ndarray,
        inputs: int,
        dynamic: ArrayLike | None = None,
        records: int = 1,
        *,
        offsets: bool = True,
    ) -> None:
        self.A, self.C, self.inputs, self.records, self.offsets = A, C, inputs, records, offsets
        self.dynamic = np.arange(inputs) if dynamic is None else _list_dynamic(dynamic, inputs)
        p, n = C.shape
        self.edges = inputs * p, inputs * p + n * self.dynamic.size  # the unknowns of D end here, and those of B
        self.unknowns = self.edges[1] + records * (n + p)

    def generate(self, chunks: Chunks, record: int = 0) -> Iterator[np.ndarray]:
        """Responses of every output to each unknown, and the outputs in the last column, chunk by chunk of a record.

        The response to a column of B is a row C (q - A)⁻¹ u(t) for each input and output, which follows from the row
        before: n numbers instead of the n² of a state for each entry.

        Shapes: returns (N * p, unknowns + 1).
        """
        p, n = self.C.shape
        d_end, b_end = self.edges
        start, transposed = b_end + record * (n + p), np.ascontiguousarray(self.A.T)
        free, forced = list(self.C), [[np.zeros(n)] * self.dynamic.size for _ in range(p)]
        for u, y in chunks:
            rows = np.zeros((self.unknowns + 1, len(u), p))
            rows[-1] = y
            for i, row in enumerate(self.C):
                rows[i:d_end:p, :, i] = u.T
                for j, k in enumerate(self.dynamic):
                    response, forced[i][j] = simulate_states(transposed, u[:, k, None] * row, forced[i][j])
                    rows[d_end + j : b_end : self.dynamic.size, :, i] = response.T
                response, free[i] = simulate_states(transposed, np.zeros((len(u), n)), free[i])
                rows[start : start + n, :, i] = response.T
                rows[start + n + i, :, i] = self.offsets
            yield rows.reshape(len(rows), -1).T

    def unpack(self, theta: np.ndarray, rank: int, condition: float) -> InputMatrices:
        """B, D, initial states and offsets from the unknowns of all records."""
        p, n = self.C.shape
        d_end, b_end = self.edges
        B = np.zeros((n, self.inputs))
        B[:, self.dynamic] = theta[d_end:b_end].reshape(n, -1)
        D = theta[:d_end].reshape(-1, p).T
        rest = theta[b_end:].reshape(self.records, n + p)
        rest = rest[0] if self.records == 1 else rest
        return InputMatrices(B, D, rest[..., :n], rest[..., n:], rank, condition)


def _list_dynamic(dynamic: ArrayLike, inputs: int) -> np.ndarray:
    """Inputs that drive the state, from a flag for each."""
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
    regression = OutputRegression(A, C, inputs[0].shape[1], dynamic, len(inputs), offsets=offsets)
    records = ([pair] for pair in zip(inputs, outputs, strict=True))
    return solve_regression(regression, records, instruments, rank_tolerance)


def solve_regression(
    regression: OutputRegression, records: Iterable[Chunks], instruments: list[np.ndarray] | None, rank_tolerance: float
) -> InputMatrices:
    """B, D, x0 and offset of checked records, by a triangular factor of their regressors or with instruments.

    Shapes: instruments (N, m).
    """
    size = regression.unknowns + 1
    factor, products, squares, samples = np.zeros((size, size), order="F"), np.zeros((size - 1, size)), 0.0, 0
    for number, chunks in enumerate(records):
        for rows in regression.generate(chunks, number):
            samples += len(rows)
            if instruments is not None:
                y = np.zeros((len(instruments[number]), len(regression.C)))
                psi = next(regression.generate([(instruments[number], y)], number))[:, :-1]
                products, squares = products + psi.T @ rows, squares + np.sum(psi**2, axis=0)
            factor = update_factor(factor, rows)
    if samples < regression.unknowns:
        raise DataError(f"{samples} samples cannot determine {size - 1} entries of B, D, x0: record longer.")
    scale = np.linalg.norm(factor[:, :-1], axis=0)
    scale[scale == 0.0] = 1.0
    if instruments is not None:
        factor[:-1] = products / np.where(squares > 0.0, np.sqrt(squares), 1.0)[:, None]
    theta, _, rank, values = np.linalg.lstsq(factor[:-1, :-1] / scale, factor[:-1, -1], rcond=rank_tolerance)
    return regression.unpack(theta / scale, int(rank), float(values[0] / values[rank - 1]) if rank else np.inf)


def update_factor(factor: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Triangular factor of the rows of a factor and of more rows, which it overwrites.

    Shapes: factor (k, k), rows (n, k); returns (k, k).
    """
    return lapack.dtpqrt(0, min(BLOCK, len(factor)), factor, rows, overwrite_a=1, overwrite_b=1)[0]
