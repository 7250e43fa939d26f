"""Projections that show the extended observability matrix, with an explicit rank policy.

The rows of the input Hankel matrix may be dependent by construction (for an ankle: a delayed velocity among the
inputs is a shifted row of the velocity). Rank is therefore decided, never assumed, by one rule, all signals having been
scaled to unit variance: a direction counts if its singular value is above `rank_tolerance` times the largest one.

- Inputs: the singular values are those of the matrix whose row space is removed. It is U in the ordinary form. In the
  correlation form it is U Z', so a direction counts by its size times that of the instruments that show it.
- Instruments: the singular values of what is left of Z, against the largest one of Z itself. In the ordinary form Z is
  left without the inputs, in the correlation form all of it. Nothing may be left, so less than `LEAST_TOLERANCE` of the
  largest one never counts.

Inner products of the rows are fast, and squaring costs half of the digits. Where these would count, the ordinary form
takes a triangular factor of the rows instead; the correlation form consists of inner products in any case.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from ankleloop.errors import DataError
from ankleloop.signals.least_squares import TINY

LEAST_TOLERANCE = 1e-6  # of the directions of instruments: weaker ones show rounding and noise
ROUNDING = 2e-16  # of a Gram matrix, relative to its largest eigenvalue
# Of squared singular values: a bound that adds magnitudes, a hundred times the size of the errors. Where it was 1.5e-4,
# a reflex torque differed by 1.2e-5 between kernels of OpenBLAS; 1e-5 is promised (benchmarks/processors.py).
ACCURACY = 1e-4
MARGIN = 4.0  # between an eigenvalue, or what is accurate, and its rounding


class Directions(NamedTuple):
    """Unit directions of rows that count by the rank policy."""

    coefficients: np.ndarray  # shape (m, k)
    largest: float  # eigenvalue, or a bound of it


class Realisation(NamedTuple):
    """A and C of a model."""

    A: np.ndarray  # shape (n, n)
    C: np.ndarray  # shape (p, n)
    poles: np.ndarray  # shape (n,)
    unstable_radius: float | None  # spectral radius by least squares, where that is unstable


@dataclass(frozen=True)
class Projection:
    """Outcome of a projection."""

    # Shape (block_rows * p, k): left singular vectors: the first n span the extended observability matrix.
    observability: np.ndarray
    # Shape (k,): they show the order; a root mean square, or a correlation.
    singular_values: np.ndarray
    input_rank: int  # directions of the inputs that count by the rank policy
    instrument_rank: int  # directions of the instruments that count by the rank policy


def project_gram(
    gram: np.ndarray, sizes: tuple[int, int], columns: int, rank_tolerance: float, order: int
) -> Projection | None:
    r"""Future outputs without the future inputs, in the directions of the instruments, from inner products of the rows.

    :math:`Y_f \Pi^\perp_{U_f}` in the row space of :math:`Z \Pi^\perp_{U_f}`, the factorisation of PI-MOESP with any
    instruments in the place of past inputs (without instruments: all of :math:`Y_f \Pi^\perp_{U_f}`, as in ordinary
    MOESP). In closed loop its term :math:`E_f U_f^T` does not vanish. None where rounding of the squares would count.

    Shapes: gram (k, k), its rows those of U, Z and Y.
    """
    m, z = sizes
    inputs = _find_directions(gram[:m, :m], rank_tolerance)
    if inputs is None:
        return None
    components = inputs.coefficients.T @ gram[:m, m:]
    residual = gram[m:, m:] - components.T @ components
    input_rank = inputs.coefficients.shape[1]
    rounding = ROUNDING * inputs.largest
    # Squared coefficients of the rows, by which their rounding is multiplied: here of the outputs less their fit.
    output_size = np.sum((inputs.coefficients @ components[:, z:]) ** 2) + len(gram) - m - z
    if z == 0:
        values, vectors = np.linalg.eigh(residual)
        if not MARGIN * rounding * output_size <= min(ACCURACY * values[-order], values[0]):
            return None
        singular_values = np.sqrt(values[::-1] / columns)
        return Projection(vectors[:, ::-1], singular_values, input_rank, 0)
    tolerance = max(rank_tolerance, LEAST_TOLERANCE)
    instruments = _find_directions(residual[:z, :z], tolerance, gram[m : m + z, m : m + z])
    if instruments is None:
        return None
    fit = instruments.coefficients.T @ residual[:z, z:]
    ranks = input_rank, instruments.coefficients.shape[1]
    projection = _decompose(fit.T, ranks, np.sqrt(columns), order)
    coefficients = instruments.coefficients @ fit
    input_coefficients = inputs.coefficients @ (components[:, :z] @ coefficients)
    fit_size = np.vdot(coefficients, coefficients) + np.vdot(input_coefficients, input_coefficients)
    error = rounding * (fit_size + 2.0 * np.sqrt(fit_size * output_size))
    if not MARGIN * error <= ACCURACY * columns * projection.singular_values[order - 1] ** 2:
        return None
    return projection


def project_factor(
    factor: np.ndarray, sizes: tuple[int, int], columns: int, rank_tolerance: float, order: int
) -> Projection:
    """The same from a triangular factor R of the rows, RᵀR = H Hᵀ, accurate whatever their condition.

    Shapes: factor (k, k).
    """
    m, z = sizes
    left, values, _ = np.linalg.svd(factor[:m, :m])
    rank = int(np.sum(values > rank_tolerance * values[0]))
    # Beside the inputs there are the directions of their own rows that do not count, and the rows below.
    residual = np.vstack([left[:, rank:].T @ factor[:m, m:], factor[m:, m:]])
    if z == 0:
        return _decompose(residual.T, (rank, 0), np.sqrt(columns))
    # Relative to the instruments before the inputs were removed, because the residual may be nothing but rounding.
    limit = max(rank_tolerance, LEAST_TOLERANCE) * np.linalg.norm(factor[:, m : m + z], 2)
    rotation, sizes_left, _ = np.linalg.svd(residual[:, :z], full_matrices=False)
    directions = rotation[:, sizes_left > limit]
    ranks = rank, directions.shape[1]
    return _decompose(residual[:, z:].T @ directions, ranks, np.sqrt(columns), order)


def project_correlation(
    gram: np.ndarray, sizes: tuple[int, int], columns: int, rank_tolerance: float, order: int
) -> Projection:
    r""":math:`Y_f Z^T` without the row space of :math:`U_f Z^T`, the form of EIV-MOESP (Chou and Verhaegen 1997).

    It is consistent in closed loop when the instruments are uncorrelated with the future noise.

    Shapes: gram (k, k), its rows those of U, Z and Y.
    """
    m, z = sizes
    if z < m + order:
        raise DataError(
            f"the correlation form has {z} rows of instruments, but needs at least {m + order} (inputs times block "
            "rows, plus the order): with fewer, nothing but rounding is left. Raise instrument_rows."
        )
    instruments = gram[m : m + z]
    inputs = instruments[:, :m]
    outputs = instruments[:, m + z :]
    solution, _, rank, _ = np.linalg.lstsq(inputs, outputs, rcond=rank_tolerance)
    squares = np.linalg.eigvalsh(instruments[:, m : m + z])
    limit = max(rank_tolerance**2, z * ROUNDING) * squares[-1]
    ranks = int(rank), int(np.sum(squares > limit))
    residual = outputs - inputs @ solution
    return _decompose(residual.T, ranks, columns)


def _find_directions(
    gram: np.ndarray, rank_tolerance: float, total: np.ndarray | None = None
) -> Directions | None:
    """Directions of rows that count, relative to the largest eigenvalue of `gram` or of `total`.

    None if rounding leaves open which directions count.
    """
    bound = np.abs(gram if total is None else total).sum(axis=0).max()  # of the largest eigenvalue
    rounding = MARGIN * len(gram) * ROUNDING
    limit = rank_tolerance**2
    factor, failure = lapack.dpotrf(gram)
    if not failure:
        inverse, failure = lapack.dtrtri(factor)
    if not failure and max(rounding, limit) * bound * np.vdot(inverse, inverse) < 1.0:
        return Directions(inverse, bound)  # all count
    if limit < rounding:
        return None
    values, vectors = np.linalg.eigh(gram)
    largest = values[-1]
    if total is not None and np.any((values > limit * largest) & (values <= limit * bound)):
        largest = np.linalg.eigvalsh(total)[-1]  # between the two: only here it makes a difference
    count = int(np.sum(values > limit * largest))
    first = len(values) - count
    coefficients = vectors[:, first:] / np.sqrt(values[first:])
    return Directions(coefficients, float(largest))


def _decompose(
    residual: np.ndarray, ranks: tuple[int, int], scale: float, order: int = 0
) -> Projection:
    """Decompose the matrix whose left singular vectors show the extended observability matrix.

    Instruments that leave fewer directions than the order are refused.
    """
    if ranks[1] < order:
        raise DataError(
            f"the instruments have rank {ranks[1]} beside the future inputs, but order {order} needs at least {order}: "
            "use more instrument_rows, a richer reference, or a lower order."
        )
    left, values, _ = np.linalg.svd(residual, full_matrices=False)
    return Projection(left, values / scale, *ranks)


def choose_order(singular_values: np.ndarray, largest: int) -> int:
    """Order at the largest drop between consecutive singular values; of a single one 1."""
    values = singular_values[: largest + 1]
    if values.size < 2:
        return 1
    drops = values[:-1] / np.maximum(values[1:], TINY)
    return int(np.argmax(drops)) + 1


def realise(
    observability: np.ndarray, outputs: int, order: int, *, stable: bool = True
) -> Realisation:
    """A and C by shift invariance of the extended observability matrix, on request stable in any case.

    Where least squares gives an unstable A, the shifted matrix is extended by a block of zeros instead: with
    orthonormal columns, A is then a contraction (Maciejowski 1995, Guaranteed stability with subspace methods).

    Shapes: observability (block_rows * p, k).
    """
    columns = observability[:, :order]
    C = columns[:outputs]
    shifted = columns[outputs:]
    A = np.linalg.lstsq(columns[:-outputs], shifted, rcond=None)[0]
    poles = np.linalg.eigvals(A)
    radius = float(np.max(np.abs(poles)))
    if radius < 1.0:
        return Realisation(A, C, poles, unstable_radius=None)
    if stable:
        A = columns.T @ np.vstack([shifted, np.zeros((outputs, order))])
        poles = np.linalg.eigvals(A)
    return Realisation(A, C, poles, unstable_radius=radius)
