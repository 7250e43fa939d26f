"""Projections that show the extended observability matrix, with an explicit rank policy.

The rows of the input Hankel matrix may be dependent by construction (for an ankle: a delayed velocity among the
inputs is a shifted row of the velocity). Rank is therefore decided, never assumed: a direction counts if its singular
value is above `rank_tolerance` times the largest one, all signals having been scaled to unit variance.

This module factorises the Hankel matrices, which is accurate whatever their condition. `gram_projection` gives the same
projection faster, from inner products.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.subspace.options import ProjectionForm

__all__ = [
    "Projection",
    "check_instrument_rank",
    "check_instrument_rows",
    "decompose_residual",
    "factor_rows",
    "project",
    "subtract_fit",
]


@dataclass(frozen=True)
class Projection:
    """Outcome of a projection.

    Parameters
    ----------
    observability : ndarray, shape (block_rows * p, k)
        Left singular vectors: the first n span the extended observability matrix.
    singular_values : ndarray, shape (k,)
        They show the order.
    input_rank, instrument_rank : int
        Directions that count by the rank policy.
    condition : float
        Ratio of the largest to the smallest singular value of the input directions that count; by `gram_projection` and
        where all count, an estimate of it from norms.
    """

    observability: np.ndarray
    singular_values: np.ndarray
    input_rank: int
    instrument_rank: int
    condition: float


def factor_rows(U: np.ndarray, Z: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Triangular factor of the rows of U, Z and Y, each less its mean.

    Parameters
    ----------
    U, Z, Y : ndarray, shape (rows, columns)
        Hankel matrices of future inputs, instruments (possibly without rows) and future outputs; rows of similar size.

    Returns
    -------
    ndarray, shape (k, k)
        It has the row spaces and the inner products of all k rows.

    Raises
    ------
    DataError
        If there are fewer columns than rows.
    """
    stacked = np.vstack([U, Z, Y])
    # A constant offset is one more input whose Hankel rows are all alike: its projection is the mean of every row.
    stacked = stacked - stacked.mean(axis=1, keepdims=True)
    if stacked.shape[1] < stacked.shape[0]:
        raise DataError(
            f"the record leaves {stacked.shape[1]} columns for {stacked.shape[0]} Hankel rows (inputs, instruments, "
            "outputs): use a longer record, fewer block_rows or fewer instrument_rows."
        )
    return linalg.qr(stacked.T, mode="r", check_finite=False)[0][: stacked.shape[0]]


def project(
    R: np.ndarray, sizes: tuple[int, int], columns: int, form: ProjectionForm, rank_tolerance: float, order: int
) -> Projection:
    r"""Remove the future inputs from the future outputs, in the directions of the instruments.

    ``"ordinary"``: :math:`Y_f \Pi^\perp_{U_f}` in the row space of :math:`Z \Pi^\perp_{U_f}`, the factorisation of
    PI-MOESP with any instruments in the place of past inputs (without instruments: all of
    :math:`Y_f \Pi^\perp_{U_f}`, as in ordinary MOESP). In closed loop its term :math:`E_f U_f^T` does not vanish.

    ``"correlation"``: :math:`Y_f Z^T` without the row space of :math:`U_f Z^T`, the form of EIV-MOESP (Chou and
    Verhaegen 1997). It is consistent in closed loop when the instruments are uncorrelated with the future noise.

    Parameters
    ----------
    R : ndarray, shape (k, k)
        Triangular factor of the Hankel rows of future inputs U, instruments Z and future outputs Y, from `factor_rows`.
    sizes : tuple of int
        Rows of U and of Z; Z may have none.
    columns : int
        Columns of the Hankel matrices.
    form : {"ordinary", "correlation"}
        Form of the projection.
    rank_tolerance : float
        Singular values below this fraction of the largest one are rounding.
    order : int
        Order of the model; the instruments need at least that many directions beside the inputs.

    Returns
    -------
    Projection

    Raises
    ------
    DataError
        If there are too few instruments for the order.
    """
    r_u, r_z, r_y = np.split(R, np.cumsum(sizes), axis=1)
    step = _project_ordinary if form == "ordinary" else _project_correlation
    residual, ranks, condition = step(r_u, r_y, r_z, rank_tolerance, order)
    return decompose_residual(residual, ranks, condition, columns, form)


def _project_ordinary(
    r_u: np.ndarray, r_y: np.ndarray, r_z: np.ndarray, rank_tolerance: float, order: int
) -> tuple[np.ndarray, tuple[int, int], float]:
    """The matrix to decompose, the ranks of inputs and instruments, and the condition of the inputs."""
    inputs, condition = _column_space(r_u, rank_tolerance)
    y_residual = r_y - inputs @ (inputs.T @ r_y)
    if r_z.shape[1] == 0:
        return y_residual.T, (inputs.shape[1], 0), condition
    z_residual = r_z - inputs @ (inputs.T @ r_z)
    left, values, _ = linalg.svd(z_residual, full_matrices=False)
    # Relative to the instruments before the inputs were removed, because the residual may be nothing but rounding.
    rank = int(np.sum(values > max(rank_tolerance, 1e-12) * linalg.norm(r_z, 2)))
    check_instrument_rank(rank, order)
    return (left[:, :rank].T @ y_residual).T, (inputs.shape[1], rank), condition


def _project_correlation(
    r_u: np.ndarray, r_y: np.ndarray, r_z: np.ndarray, rank_tolerance: float, order: int
) -> tuple[np.ndarray, tuple[int, int], float]:
    """The matrix to decompose, the ranks of inputs and instruments, and the condition of the inputs."""
    check_instrument_rows(r_z.shape[1], r_u.shape[1], order)
    residual, input_rank, condition = subtract_fit(r_z.T @ r_u, r_z.T @ r_y, rank_tolerance)
    rank = int(np.linalg.matrix_rank(r_z, tol=max(rank_tolerance, 1e-12) * linalg.norm(r_z, 2)))
    return residual.T, (input_rank, rank), condition


def _column_space(matrix: np.ndarray, rank_tolerance: float) -> tuple[np.ndarray, float]:
    """Orthonormal basis of the columns that count, and the ratio of their largest to smallest singular value."""
    if matrix.shape[1] == 0:
        return matrix, 1.0
    left, values, _ = np.linalg.svd(matrix, full_matrices=False)
    mask = values > rank_tolerance * values[0] if values[0] > 0 else np.zeros(values.size, dtype=bool)
    condition = values[0] / values[mask][-1] if mask.any() else np.inf
    return left[:, mask], float(condition)


def subtract_fit(matrix: np.ndarray, others: np.ndarray, rank_tolerance: float) -> tuple[np.ndarray, int, float]:
    """Subtract from other columns their least-squares fit by the columns of a matrix that count.

    It takes half the time of a basis of the columns.

    Parameters
    ----------
    matrix, others : ndarray, shape (rows, k), (rows, l)
        The columns.
    rank_tolerance : float
        Singular values below this fraction of the largest one are rounding.

    Returns
    -------
    residual : ndarray, shape (rows, l)
    rank : int
        How many columns count.
    condition : float
        Ratio of their largest to smallest singular value.
    """
    solution, _, rank, values = np.linalg.lstsq(matrix, others, rcond=rank_tolerance)
    condition = float(values[0] / values[rank - 1]) if rank else np.inf
    return others - matrix @ solution, int(rank), condition


def decompose_residual(
    residual: np.ndarray, ranks: tuple[int, int], condition: float, columns: int, form: ProjectionForm
) -> Projection:
    """Decompose the matrix whose left singular vectors show the extended observability matrix.

    Parameters
    ----------
    residual : ndarray, shape (block_rows * p, k)
        The matrix.
    ranks : tuple of int
        Ranks of inputs and of instruments.
    condition : float
        Condition of the inputs.
    columns : int
        Columns of the Hankel matrices.
    form : {"ordinary", "correlation"}
        Form of the projection.

    Returns
    -------
    Projection
    """
    # The right singular vectors are of no use: the triangular factor has all else.
    factor = np.linalg.qr(residual.T, mode="r").T  # type: ignore[attr-defined]  # an array in this mode
    left, values, _ = np.linalg.svd(factor, full_matrices=False)
    # So that they do not grow with the record: a root mean square, or a correlation.
    values = values / (np.sqrt(columns) if form == "ordinary" else columns)
    return Projection(left, values, *ranks, condition)


def check_instrument_rank(rank: int, order: int) -> None:
    """Refuse instruments that leave fewer directions than the order."""
    if rank < order:
        raise DataError(
            f"the instruments have rank {rank} beside the future inputs, but order {order} needs at least {order}: "
            "use more instrument_rows, a richer reference, or a lower order."
        )


def check_instrument_rows(rows: int, inputs: int, order: int) -> None:
    """Refuse a correlation form in which the projection would leave nothing but rounding."""
    if rows < inputs + order:
        raise DataError(
            f"the correlation form has {rows} rows of instruments, but needs at least {inputs + order} (inputs times "
            "block rows, plus the order): with fewer, nothing but rounding is left. Raise instrument_rows."
        )
