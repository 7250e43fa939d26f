"""Projections that show the extended observability matrix, with an explicit rank policy.

The rows of the input Hankel matrix may be dependent by construction (for an ankle: a delayed velocity among the
inputs is a shifted row of the velocity). Rank is therefore decided, never assumed, by one rule, all signals having been
scaled to unit variance: a direction counts if its singular value is above `rank_tolerance` times the largest one.

- Inputs: the singular values are those of the matrix whose row space is removed. It is U in the ordinary form. In the
  correlation form it is U Z', so a direction counts by its size times that of the instruments that show it.
- Instruments: the singular values of what is left of Z, against the largest one of Z itself. In the ordinary form Z is
  left without the inputs, in the correlation form all of it. Nothing may be left, so less than `LEAST_TOLERANCE` of the
  largest one never counts.

Both routes (this module and `gram_projection`) follow it.

This module takes a triangular factor of the Hankel rows, which is accurate whatever their condition. `gram_projection`
gives the same projection faster, from inner products.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ankleloop.errors import DataError
from ankleloop.kernels import kernel
from ankleloop.subspace.options import ProjectionForm

__all__ = [
    "LEAST_TOLERANCE",
    "Projection",
    "check_instrument_rank",
    "check_instrument_rows",
    "decompose_residual",
    "project",
    "subtract_fit",
]

LEAST_TOLERANCE = 1e-12  # of the directions of instruments: rounding of the rows
ACCURACY = 1e-7  # of squared singular values
SMALL = 24  # rows: singular vectors of so few take no longer than inner products and their eigenvectors
LONG = 1.5  # times as long as high: then a triangular factor of a matrix takes less time than its singular vectors


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


def project(
    R: np.ndarray, sizes: tuple[int, int], columns: int, form: ProjectionForm, rank_tolerance: float, order: int
) -> Projection:
    r"""Remove the future inputs from the future outputs, in the directions of the instruments.

    ``"ordinary"``: :math:`Y_f \Pi^\perp_{U_f}` in the row space of :math:`Z \Pi^\perp_{U_f}`, the factorisation of
    PI-MOESP with any instruments in the place of past inputs (without instruments: all of
    :math:`Y_f \Pi^\perp_{U_f}`, as in ordinary MOESP). In closed loop its term :math:`E_f U_f^T` does not vanish.

    ``"correlation"``: :math:`Y_f Z^T` without the row space of :math:`U_f Z^T`, the form of EIV-MOESP (Chou and
    Verhaegen 1997). It is consistent in closed loop when the instruments are uncorrelated with the future noise.

    Shapes: R (k, k).
    """
    step = _project_ordinary if form == "ordinary" else _project_correlation
    residual, ranks, condition = step(R, sizes, rank_tolerance, order)
    return decompose_residual(residual, ranks, condition, columns, form)


def _project_ordinary(
    R: np.ndarray, sizes: tuple[int, int], rank_tolerance: float, order: int
) -> tuple[np.ndarray, tuple[int, int], float]:
    """The matrix to decompose, the ranks of inputs and instruments, and the condition of the inputs.

    R is triangular: beside the inputs there are the directions of their own rows that do not count, and the rows below.
    """
    m, z = sizes
    others, input_rank, condition = _find_other_directions(R[:m, :m], rank_tolerance)
    residual = np.vstack([others.T @ R[:m, m:], R[m:, m:]]) if input_rank < m else R[m:, m:]
    if z == 0:
        return residual.T, (input_rank, 0), condition
    residual = residual[: m - input_rank + z]  # of more rows, only the outputs have components
    # Relative to the instruments before the inputs were removed, because the residual may be nothing but rounding.
    instruments = R[: m + z, m : m + z]
    tolerance = max(rank_tolerance, LEAST_TOLERANCE)
    if input_rank == m and _bound_smallest_value(residual[:, :z]) > tolerance * np.linalg.norm(instruments):
        check_instrument_rank(z, order)
        return residual[:, z:].T, (m, z), condition
    directions = _find_directions(residual[:, :z], instruments, tolerance)
    check_instrument_rank(directions.shape[1], order)
    return (directions.T @ residual[:, z:]).T, (input_rank, directions.shape[1]), condition


def _project_correlation(
    R: np.ndarray, sizes: tuple[int, int], rank_tolerance: float, order: int
) -> tuple[np.ndarray, tuple[int, int], float]:
    """The matrix to decompose, the ranks of inputs and instruments, and the condition of the inputs."""
    r_u, r_z, r_y = np.split(R, np.cumsum(sizes), axis=1)
    check_instrument_rows(r_z.shape[1], r_u.shape[1], order)
    residual, input_rank, condition = subtract_fit(r_z.T @ r_u, r_z.T @ r_y, rank_tolerance)
    values = np.linalg.svd(r_z[: sum(sizes)], compute_uv=False)
    rank = int(np.sum(values > max(rank_tolerance, LEAST_TOLERANCE) * values[0]))
    return residual.T, (input_rank, rank), condition


def _find_other_directions(matrix: np.ndarray, rank_tolerance: float) -> tuple[np.ndarray, int, float]:
    """Unit directions of a square matrix that do not count, the number of those that do, and their condition."""
    smallest, largest = _bound_smallest_value(matrix), np.linalg.norm(matrix)
    if smallest > max(rank_tolerance, LEAST_TOLERANCE) * largest:
        return matrix[:, :0], len(matrix), 1.0 / float(lapack.dtrcon(matrix)[0])
    left, values, _ = np.linalg.svd(matrix)
    rank = int(np.sum(values > rank_tolerance * values[0]))
    return left[:, rank:], rank, float(values[0] / values[rank - 1]) if rank else np.inf


def _bound_smallest_value(matrix: np.ndarray) -> float:
    """A number that the smallest singular value of a triangular matrix is not below: singular values take long."""
    inverse, info = lapack.dtrtri(matrix)
    return 0.0 if info else 1.0 / np.sqrt(_sum_squares_below(inverse)[0])


@kernel()
def _sum_squares_below(matrix):
    """Sums of the squares in each row of the upper triangle and all rows below it; the lower triangle is not read."""
    rows, columns = matrix.shape
    sums, total = np.empty(rows), 0.0
    for i in range(rows - 1, -1, -1):
        for j in range(i, columns):
            total += matrix[i, j] ** 2
        sums[i] = total
    return sums


def _find_directions(matrix: np.ndarray, total: np.ndarray, tolerance: float) -> np.ndarray:
    """Unit directions of columns whose singular values are above a fraction of the largest one of `total`.

    A pivoted QR factorisation takes an eighth of the time of singular vectors. It is enough where its bounds leave no
    doubt of the rank: no singular value that counts is below those of the upper left triangle, none that does not is
    above the norm of what lies below.
    """
    squares = np.einsum("ij,ij->j", total, total)
    low, high = tolerance * np.sqrt(squares.max()), tolerance * np.sqrt(squares.sum())  # bounds of the limit
    packed, _, tau, _, _ = lapack.dgeqp3(matrix)
    below = _sum_squares_below(packed[: len(tau)])
    rank = int(np.count_nonzero(below > low**2))
    if rank and _bound_smallest_value(packed[:rank, :rank]) > high:
        return lapack.dorgqr(packed[:, :rank], tau[:rank])[0]
    left, values, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, : int(np.sum(values > tolerance * np.linalg.norm(total, 2)))]


def subtract_fit(matrix: np.ndarray, others: np.ndarray, rank_tolerance: float) -> tuple[np.ndarray, int, float]:
    """Subtract from other columns their least-squares fit by the columns of a matrix that count.

    It takes half the time of a basis of the columns.

    Shapes: matrix, others (rows, k); returns residual (rows, l).
    """
    solution, _, rank, values = np.linalg.lstsq(matrix, others, rcond=rank_tolerance)
    condition = float(values[0] / values[rank - 1]) if rank else np.inf
    return others - matrix @ solution, int(rank), condition


def decompose_residual(
    residual: np.ndarray, ranks: tuple[int, int], condition: float, columns: int, form: ProjectionForm
) -> Projection:
    """Decompose the matrix whose left singular vectors show the extended observability matrix.

    Shapes: residual (block_rows * p, k).
    """
    left, values = _decompose_left(residual)
    # So that they do not grow with the record: a root mean square, or a correlation.
    values = values / (np.sqrt(columns) if form == "ordinary" else columns)
    return Projection(left, values, *ranks, condition)


def _decompose_left(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Left singular vectors and singular values; from inner products, in half of the time, where rounding allows it."""
    rows, columns = matrix.shape
    if SMALL < rows <= columns:
        squares, vectors = np.linalg.eigh(matrix @ matrix.T)
        if squares[0] > rows * np.finfo(float).eps / ACCURACY * squares[-1]:
            return vectors[:, ::-1], np.sqrt(squares[::-1])
    if columns > LONG * rows:
        # The right singular vectors are of no use: the triangular factor has all else.
        matrix = np.linalg.qr(matrix.T, mode="r").T  # type: ignore[attr-defined]  # an array in this mode
    left, values, _, info = lapack.dgesdd(matrix, full_matrices=0)
    if info:
        raise np.linalg.LinAlgError("the singular values of the projection did not converge")
    return left, values


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
