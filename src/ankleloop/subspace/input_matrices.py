"""B, D, initial state and offset of a model with known A and C: a linear regression on simulated responses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack

from ankleloop.errors import DataError
from ankleloop.options import show_value
from ankleloop.signals.statespace import simulate_states

BLOCK = 16  # columns of a panel, or an eighth of all: narrow ones leave most of the work to matrix products


class InputMatrices(NamedTuple):
    """B, D and initial state, and the regression that gave them."""

    B: np.ndarray  # shape (n, m)
    D: np.ndarray  # shape (p, m)
    initial_state: (
        np.ndarray
    )  # shape (n,), of merged records (records, n): state at the first sample
    rank: int  # rank of the regression
    condition: float  # its condition


def simulate_response(
    A: np.ndarray,
    B: np.ndarray,
    C: np.ndarray,
    D: np.ndarray,
    u: np.ndarray,
    x0: ArrayLike | None = None,
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
    if (
        x0.shape != A.shape[:1] or A.shape != (B.shape[0],) * 2
    ):  # compiled code does not check its indices
        raise ValueError(
            f"A {A.shape}, B {B.shape} and x0 {x0.shape} must have one number of states."
        )
    A, B, drive = (
        np.ascontiguousarray(x, dtype=float) for x in (A, B, u)
    )  # one type, for which it is compiled
    states, _ = simulate_states(A, B, drive, x0)
    return states @ C.T + u @ D.T


class OutputRegression:
    r"""Regression of the outputs on their responses to the entries of D and B, the initial states and the offsets.

    The output is linear in them, :math:`y(t) = C A^t x_0 + \sum_k C A^{t-1-k} B u(k) + D u(t) + d`. Unless all inputs
    are `dynamic`, the columns of B of all others are zero (Eq. 11). Each record has an initial state and an offset of
    its own; without `offsets` all of these are zero.
    """

    def __init__(
        self,
        A: np.ndarray,
        C: np.ndarray,
        inputs: int,
        dynamic: ArrayLike | None,
        records: int,
        *,
        offsets: bool,
    ) -> None:
        flags = (
            np.ones(inputs, dtype=bool) if dynamic is None else np.asarray(dynamic, dtype=object)
        )
        if flags.shape != (inputs,) or not all(
            isinstance(flag, (bool, np.bool_)) for flag in flags
        ):
            raise ValueError(
                f"dynamic must be {inputs} flags, True or False for each input, got {show_value(dynamic)}."
            )
        self.A, self.C, self.inputs, self.records, self.offsets = A, C, inputs, records, offsets
        self.dynamic = np.flatnonzero(flags)
        p, n = C.shape
        # Where the unknowns of D end, of B, of the initial states, and of the offsets.
        self.edges = list(accumulate([inputs * p, n * self.dynamic.size, records * n, records * p]))

    def generate(self, chunks: Iterable[np.ndarray], record: int) -> Iterator[np.ndarray]:
        """Responses of every output to each unknown, and the outputs in the last column, chunk by chunk of a record.

        The response to a column of B is a row C (q - A)⁻¹ u(t) for each input and output, which follows from the row
        before: n numbers instead of the n² of a state for each entry. That to the initial state starts from C.

        Shapes: chunks (N, m + p); returns (N * p, unknowns + 1).
        """
        p, n = self.C.shape
        m, d_end, offset = self.inputs, self.edges[0], self.edges[2] + record * p
        blocks = [*range(self.dynamic.size), self.dynamic.size + record]
        transposed, states = np.ascontiguousarray(self.A.T), np.zeros((p, len(blocks), n))
        states[:, -1] = self.C
        for x in chunks:
            u, y = x[:, :m], x[:, m : m + p]
            drives = np.zeros((len(blocks), len(x), 1))
            drives[:-1, :, 0] = u.T[self.dynamic]
            rows = np.zeros((self.edges[-1] + 1, len(x), p))
            rows[-1] = y
            for i, row in enumerate(self.C):
                rows[i:d_end:p, :, i] = u.T
                for j, (block, drive) in enumerate(zip(blocks, drives, strict=True)):
                    response, states[i, j] = simulate_states(
                        transposed, row[:, None], drive, states[i, j]
                    )
                    rows[d_end + block * n :][:n, :, i] = response.T
                rows[offset + i, :, i] = self.offsets
            yield rows.reshape(len(rows), -1).T

    def solve(
        self,
        records: Iterable[Iterable[np.ndarray]],
        predicted: Sequence[np.ndarray] | None,
        rank_tolerance: float,
    ) -> InputMatrices:
        r"""Least squares by a triangular factor of the regressors, or with instruments.

        With instruments, the regressors are simulated a second time from noise-free predictions of the inputs, and the
        normal equations :math:`\Psi^T \Phi \theta = \Psi^T y` are solved: they are consistent where least squares is
        biased by feedback. Directions below a fraction of the largest one are left out (columns have unit norm).

        Shapes: records (N, m + p), predicted (N, m): then each record must be in one chunk.
        """
        (p, n), m, size = self.C.shape, self.inputs, self.edges[-1] + 1
        factor, products, squares, samples = (
            np.zeros((size, size), order="F"),
            np.zeros((size - 1, size)),
            0.0,
            0,
        )
        for number, record in enumerate(records):
            for rows in self.generate(record, number):
                samples += len(rows)
                if predicted is not None:
                    z = np.hstack([predicted[number], np.zeros((len(predicted[number]), p))])
                    psi = next(self.generate([z], number))[:, :-1]
                    products, squares = products + psi.T @ rows, squares + np.sum(psi**2, axis=0)
                factor = update_factor(factor, rows)
        if samples < size - 1:
            raise DataError(
                f"{samples} samples cannot determine {size - 1} entries of B, D, x0: record longer."
            )
        scale = np.linalg.norm(factor[:, :-1], axis=0)
        scale[scale == 0.0] = 1.0
        if predicted is not None:
            factor[:-1] = products / np.where(squares > 0.0, np.sqrt(squares), 1.0)[:, None]
        theta, _, rank, values = np.linalg.lstsq(
            factor[:-1, :-1] / scale, factor[:-1, -1], rcond=rank_tolerance
        )
        direct, dynamic, states, _ = np.split(theta / scale, self.edges[:-1])
        B = np.zeros((n, m))
        B[:, self.dynamic] = dynamic.reshape(-1, n).T
        states = states if self.records == 1 else states.reshape(-1, n)
        condition = float(values[0] / values[rank - 1]) if rank else np.inf
        return InputMatrices(B, direct.reshape(-1, p).T, states, int(rank), condition)


def update_factor(factor: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Triangular factor of the rows of a factor and of more rows, which it overwrites.

    Shapes: factor (k, k), rows (n, k); returns (k, k).
    """
    block = min(BLOCK, 1 + len(factor) // 8)
    return lapack.dtpqrt(0, block, factor, rows, overwrite_a=1, overwrite_b=1)[0]
