"""Projections that leave the extended observability matrix, with an explicit rank policy.

The rows of the input Hankel matrix may be dependent by construction (for an ankle: a delayed velocity among the
inputs is a shifted row of the velocity). Rank is therefore decided, never assumed: a direction counts if its singular
value is above `rank_tolerance` times the largest one, all signals having been scaled to unit variance.

Here the Hankel matrices are factorised, which is accurate whatever their condition. `gram_projection` has the fast
route to the same projection.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError

__all__ = [
    "PROJECTIONS",
    "Projection",
    "check_form",
    "check_instrument_rank",
    "check_instrument_rows",
    "decomposed",
    "left_over",
    "project",
    "project_factor",
]

PROJECTIONS = ("ordinary", "correlation")


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
        Directions that the rank policy kept.
    condition : float
        Ratio of the largest to the smallest kept singular value of the input directions, or, by the fast route and
        where all are kept, an estimate of it from norms.
    """

    observability: np.ndarray
    singular_values: np.ndarray
    input_rank: int
    instrument_rank: int
    condition: float


def _column_space(matrix, rank_tolerance):
    """Orthonormal basis of the columns that count, and the ratio of their largest to smallest singular value."""
    if matrix.shape[1] == 0:
        return matrix, 1.0
    left, values, _ = np.linalg.svd(matrix, full_matrices=False)
    kept = values > rank_tolerance * values[0] if values[0] > 0 else np.zeros(values.size, dtype=bool)
    condition = values[0] / values[kept][-1] if kept.any() else np.inf
    return left[:, kept], float(condition)


def left_over(matrix, others, rank_tolerance):
    """What the columns of a matrix that count leave of others; how many count, and their condition.

    By least squares of that rank, which takes half the time of a basis of the columns.
    """
    solution, _, rank, values = np.linalg.lstsq(matrix, others, rcond=rank_tolerance)
    condition = float(values[0] / values[rank - 1]) if rank else np.inf
    return others - matrix @ solution, int(rank), condition


def project(U, Y, Z, form, rank_tolerance, order):
    r"""Remove the future inputs from the future outputs, in the directions of the instruments.

    ``"ordinary"``: :math:`Y_f \Pi^\perp_{U_f}` in the row space of :math:`Z \Pi^\perp_{U_f}`, the factorisation of
    PI-MOESP with other instruments in its place (without instruments: all of :math:`Y_f \Pi^\perp_{U_f}`, as in
    ordinary MOESP). In closed loop the term :math:`E_f U_f^T` does not vanish in it.

    ``"correlation"``: :math:`Y_f Z^T` without the row space of :math:`U_f Z^T`, the form of EIV-MOESP (Chou and
    Verhaegen 1997). It is consistent in closed loop when the instruments are uncorrelated with the future noise.

    Parameters
    ----------
    U : ndarray, shape (m * block_rows, columns)
        Hankel matrix of future inputs, rows of similar size.
    Y : ndarray, shape (p * block_rows, columns)
        Hankel matrix of future outputs.
    Z : ndarray, shape (k, columns)
        Instruments; k may be 0.
    form : {"ordinary", "correlation"}
        Form of the projection.
    rank_tolerance : float
        Singular values below this fraction of the largest one are rounding.
    order : int
        Order to be found; the instruments have to leave at least that many directions.

    Returns
    -------
    Projection

    Raises
    ------
    DataError
        If too few columns or instruments are left to see the order.
    """
    check_form(form)
    sizes, columns = (U.shape[0], Z.shape[0]), U.shape[1]
    stacked = np.vstack([U, Z, Y])
    # A constant offset is one more input whose Hankel rows are all alike: its projection is the mean of every row.
    stacked = stacked - stacked.mean(axis=1, keepdims=True)
    if stacked.shape[1] < stacked.shape[0]:
        raise DataError(
            f"the record leaves {stacked.shape[1]} columns for {stacked.shape[0]} Hankel rows (inputs, instruments, "
            "outputs): use a longer record, fewer block_rows or fewer instrument_rows."
        )
    # The triangular factor has the row spaces of the long matrix, and all of its inner products.
    R = linalg.qr(stacked.T, mode="r", check_finite=False)[0][: stacked.shape[0]]
    return project_factor(R, sizes, columns, form, rank_tolerance, order)


def project_factor(R, sizes, columns, form, rank_tolerance, order):
    """The projection from a triangular factor of the rows of U, Z and Y, each less its mean.

    Parameters
    ----------
    R : ndarray, shape (k, k)
        The factor, Rᵀ R being the inner products of the rows.
    sizes : tuple of int
        Rows of U and of Z.
    columns : int
        Columns of the Hankel matrices.
    form, rank_tolerance, order
        As `project` takes them.

    Returns
    -------
    Projection
    """
    r_u, r_z, r_y = np.split(R, np.cumsum(sizes), axis=1)
    step = _ordinary if form == "ordinary" else _correlation
    residual, input_rank, instrument_rank, condition = step(r_u, r_y, r_z, rank_tolerance, order)
    return decomposed(residual, input_rank, instrument_rank, condition, columns, form)


def check_form(form):
    """Refuse an unknown form of the projection."""
    if form not in PROJECTIONS:
        raise ValueError(f"unknown projection {form!r}; known: {', '.join(PROJECTIONS)}.")


def decomposed(residual, input_rank, instrument_rank, condition, columns, form):
    """Outcome of a projection from the matrix whose left singular vectors it is about."""
    # The right singular vectors are of no use: the triangular factor has all else.
    left, values, _ = np.linalg.svd(np.linalg.qr(residual.T, mode="r").T, full_matrices=False)
    # So that they do not grow with the record: a root mean square, or a correlation.
    values = values / (np.sqrt(columns) if form == "ordinary" else columns)
    return Projection(left, values, input_rank, instrument_rank, condition)


def _ordinary(r_u, r_y, r_z, rank_tolerance, order):
    inputs, condition = _column_space(r_u, rank_tolerance)
    y_left = r_y - inputs @ (inputs.T @ r_y)
    if r_z.shape[1] == 0:
        return y_left.T, inputs.shape[1], 0, condition
    z_left = r_z - inputs @ (inputs.T @ r_z)
    left, values, _ = linalg.svd(z_left, full_matrices=False)
    # Judged against the instruments before the inputs were removed: what is left may be nothing but rounding.
    rank = int(np.sum(values > max(rank_tolerance, 1e-12) * linalg.norm(r_z, 2)))
    check_instrument_rank(rank, order)
    return (left[:, :rank].T @ y_left).T, inputs.shape[1], rank, condition


def check_instrument_rank(rank, order):
    """Refuse instruments that leave fewer directions than the order."""
    if rank < order:
        raise DataError(
            f"the instruments have rank {rank} beside the future inputs, but order {order} needs at least {order}: "
            "use more instrument_rows, a richer reference, or a lower order."
        )


def check_instrument_rows(rows, inputs, order):
    """Refuse a correlation form that leaves nothing but rounding."""
    if rows < inputs + order:
        raise DataError(
            f"the correlation form has {rows} rows of instruments, but needs at least {inputs + order} (inputs times "
            "block rows, plus the order): with fewer, nothing but rounding is left. Raise instrument_rows."
        )


def _correlation(r_u, r_y, r_z, rank_tolerance, order):
    check_instrument_rows(r_z.shape[1], r_u.shape[1], order)
    residual, inputs, condition = left_over(r_z.T @ r_u, r_z.T @ r_y, rank_tolerance)
    rank = int(np.linalg.matrix_rank(r_z, tol=max(rank_tolerance, 1e-12) * linalg.norm(r_z, 2)))
    return residual.T, inputs, rank, condition
