"""B, D, initial state and offset of a model with known A and C: a linear regression on simulated responses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack, solve_discrete_are

from ankleloop.errors import DataError
from ankleloop.options import show_value
from ankleloop.signals.least_squares import ScaledFit, fit_columns
from ankleloop.signals.statespace import simulate_states

PANEL = 16  # columns, or an eighth of all: narrow ones leave most of the work to matrix products
# Of the largest singular value: what rounding leaves of the responses of dependent inputs, and of products of these.
RESPONSE_ROUNDING = 1e-10
PRODUCT_ROUNDING = 1e-15
STATE_NOISE = 1e-8  # of the output noise, in the filter of an unstable model: it moves poles off the unit circle


class InputMatrices(NamedTuple):
    """B, D, initial state and offset, and the regression that gave them."""

    B: np.ndarray  # shape (n, m)
    D: np.ndarray  # shape (p, m)
    initial_state: np.ndarray  # shape (records, n): state at the first sample
    offsets: np.ndarray  # shape (records, p), of the outputs
    unknowns: int  # of the regression
    rank: int  # rank of the regression
    determined: bool  # whether the inputs are rich enough for B and D


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
    u : ndarray, shape (N, m); of one input also (N,)
        Inputs.
    x0 : array_like, shape (n,), optional
        Initial state; zero by default.

    Returns
    -------
    ndarray, shape (N, p)

    Raises
    ------
    ValueError
        If the matrices, inputs and initial state differ in their number of states, inputs or outputs.

    Examples
    --------
    >>> A, B, C, D = (np.array([[value]]) for value in (0.5, 1.0, 1.0, 0.0))
    >>> simulate_response(A, B, C, D, np.array([[1.0], [0.0], [0.0]])).ravel()
    array([0. , 1. , 0.5])
    """
    inputs = np.column_stack([np.asarray(u, dtype=float)])
    start = np.zeros(len(A)) if x0 is None else np.asarray(x0, dtype=float)
    _check_sizes(A, B, C, D, inputs, start)
    # One type, for which it is compiled.
    dynamics, gains, drive = (np.ascontiguousarray(x, dtype=float) for x in (A, B, inputs))
    states = simulate_states(dynamics, gains, drive, start)
    return states @ C.T + inputs @ D.T


def _check_sizes(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, u: np.ndarray, x0: np.ndarray
) -> None:
    """Refuse shapes that do not agree: compiled code does not check its indices."""
    n = len(A)
    m = B.shape[-1]
    p = len(C)
    shapes = [array.shape for array in (A, B, C, D, u, x0)]
    if shapes != [(n, n), (n, m), (p, n), (p, m), (len(u), m), (n,)]:
        raise ValueError(
            f"A, B, C, D, u and x0 have shapes {', '.join(map(str, shapes))}: with n states, m inputs and p outputs "
            "they must be (n, n), (n, m), (p, n), (p, m), (N, m) and (n,)."
        )


class OutputRegression:
    r"""Regression of the outputs on their responses to the entries of D and B, the initial states and the offsets.

    The output is linear in them, :math:`y(t) = C A^t x_0 + \sum_k C A^{t-1-k} B u(k) + D u(t) + d`. Unless all inputs
    are `dynamic`, the columns of B of all others are zero (Eq. 11). Each record has an initial state and an offset of
    its own; without `offsets` all of these are zero.

    Responses of an unstable A grow without bound. So the regression goes through a filter: with a gain K that makes
    :math:`A - K C` stable, both sides are multiplied by :math:`M(q) = I - C (q - A + K C)^{-1} K`, which turns
    :math:`C (q - A)^{-1}` into :math:`C (q - A + K C)^{-1}`. K mirrors the unstable poles at the unit circle, so that M
    hardly weights frequencies (Forssell and Ljung 2000).
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
        stable: bool = True,
    ) -> None:
        flags = np.ones(inputs, dtype=bool) if dynamic is None else np.asarray(dynamic)
        if flags.shape != (inputs,) or flags.dtype != bool:
            raise ValueError(
                f"dynamic must be {inputs} flags, True or False for each input, got {show_value(dynamic)}."
            )
        p, n = C.shape
        self.C = np.ascontiguousarray(C)
        self.inputs = inputs
        self.offsets = offsets
        self.dynamic = np.flatnonzero(flags)
        self.gain = None if stable else find_gain(A, C)
        self.A = A if self.gain is None else A - self.gain @ C
        # Where the unknowns of D end, of B, of the initial states, and of the offsets.
        self.edges = np.cumsum([inputs * p, self.dynamic.size * n, records * n, records * p])

    def respond(self, u: np.ndarray, y: np.ndarray, record: int) -> np.ndarray:
        """Responses of every output to each unknown, and the outputs in the last column, of a record.

        The response to a column of B is a row C (q - A)⁻¹ u(t) for each input and output, which follows from the row
        before: n numbers instead of the n² of a state for each entry. That to the initial state starts from C.

        Shapes: u (N, m), y (N, p); returns (N * p, unknowns + 1).
        """
        p, n = self.C.shape
        samples = len(u)
        columns = np.zeros((self.edges[-1] + 1, samples, p))
        d_end, b_end, state_end, _ = self.edges
        direct = columns[:d_end].reshape(self.inputs, p, samples, p)
        dynamic = columns[d_end:b_end].reshape(self.dynamic.size, n, samples, p)
        initial = columns[b_end + record * n :][:n]
        offset = columns[state_end + record * p :][:p]
        columns[-1] = y
        transposed = np.ascontiguousarray(self.A.T)
        rest = np.zeros(n)
        silence = np.zeros((samples, 1))
        for i, row in enumerate(self.C):
            direct[:, i, :, i] = u.T
            offset[i, :, i] = self.offsets
            response = simulate_states(transposed, row[:, None], silence, row)
            initial[:, :, i] = response.T
            for entries, channel in zip(dynamic, self.dynamic, strict=True):
                response = simulate_states(transposed, row[:, None], u[:, [channel]], rest)
                entries[:, :, i] = response.T
        if self.gain is not None:
            for signals in (*columns[:d_end], *offset, columns[-1]):
                signals[:] = simulate_response(self.A, self.gain, -self.C, np.eye(p), signals)
        return columns.reshape(len(columns), -1).T

    def solve(
        self,
        records: Sequence[np.ndarray],
        predicted: Sequence[np.ndarray] | None,
        rank_tolerance: float,
    ) -> InputMatrices:
        r"""Least squares by a triangular factor of the regressors, or with instruments.

        With instruments, the regressors are simulated a second time from noise-free predictions of the inputs, and the
        normal equations :math:`\Psi^T \Phi \theta = \Psi^T y` are solved: they are consistent where least squares is
        biased by feedback. Directions below a fraction of the largest one are left out (columns have unit norm).

        Shapes: records (N, m + p) or more, predicted (N, m).
        """
        unknowns = self.edges[-1]
        factor = np.zeros((unknowns + 1, unknowns + 1), order="F")
        products = np.zeros((unknowns, unknowns + 1))
        squares = np.zeros(unknowns)
        samples = sum(map(len, records)) * len(self.C)
        if samples < unknowns:
            raise DataError(
                f"{samples} samples cannot determine {unknowns} entries of B, D, x0: record longer."
            )
        for number, record in enumerate(records):
            u = record[:, : self.inputs]
            y = record[:, self.inputs :][:, : len(self.C)]
            rows = self.respond(u, y, number)
            if predicted is not None:
                instruments = self.respond(predicted[number], y, number)[:, :-1]
                products += instruments.T @ rows
                squares += np.sum(instruments**2, axis=0)
            factor = update_factor(factor, rows)
        scale = np.linalg.norm(factor[:, :-1], axis=0)
        scale[scale == 0.0] = 1.0
        equations = factor[:-1]
        rounding = RESPONSE_ROUNDING
        if predicted is not None:
            rounding = PRODUCT_ROUNDING
            sizes = np.where(squares > 0.0, np.sqrt(squares), 1.0)
            equations = products / sizes[:, None]
        fit = fit_columns(equations[:, :-1], equations[:, -1], scale, rank_tolerance)
        determined = self._determines_inputs(
            equations[:, :-1] / scale, fit.singular_values, min(rank_tolerance, rounding)
        )
        return self._sort_unknowns(fit, determined)

    def _sort_unknowns(self, fit: ScaledFit, determined: bool) -> InputMatrices:
        """B, D, initial states and offsets from the solution of the regression."""
        p, n = self.C.shape
        direct, dynamic, states, offsets = np.split(fit.coefficients, self.edges[:-1])
        B = np.zeros((n, self.inputs))
        B[:, self.dynamic] = dynamic.reshape(-1, n).T
        return InputMatrices(
            B=B,
            D=direct.reshape(-1, p).T,
            initial_state=states.reshape(-1, n),
            offsets=offsets.reshape(-1, p),
            unknowns=fit.coefficients.size,
            rank=fit.rank,
            determined=determined,
        )

    def _determines_inputs(
        self, columns: np.ndarray, singular_values: np.ndarray, rank_tolerance: float
    ) -> bool:
        """Whether no entry of D and B depends on other unknowns.

        Initial states and offsets may depend on each other: records may be short.
        """
        limit = rank_tolerance * singular_values[0]
        unknowns = self.edges[1]
        others = np.linalg.svd(columns[:, unknowns:], compute_uv=False)
        rank = np.count_nonzero(singular_values > limit)
        return bool(rank - np.count_nonzero(others > limit) == unknowns)


def find_gain(A: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Gain K that makes A - K C stable: that of a Kalman filter almost without noise of the states.

    Shapes: A (n, n), C (p, n); returns (n, p).
    """
    p, n = C.shape
    covariance = solve_discrete_are(A.T, C.T, STATE_NOISE * np.eye(n), np.eye(p))
    innovation = np.eye(p) + C @ covariance @ C.T
    return np.linalg.solve(innovation, C @ covariance @ A.T).T


def update_factor(factor: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Triangular factor of the rows of a factor and of more rows, which it overwrites.

    Shapes: factor (k, k), rows (n, k); returns (k, k).
    """
    block = min(PANEL, 1 + len(factor) // 8)
    return lapack.dtpqrt(0, block, factor, rows, overwrite_a=1, overwrite_b=1)[0]
