"""From the extended observability matrix to A and C."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

__all__ = ["choose_order", "realise"]


def choose_order(singular_values: np.ndarray, largest: int) -> int:
    """Order at the largest drop between consecutive singular values."""
    values = singular_values[: largest + 1]
    return int(np.argmax(values[:-1] / np.maximum(values[1:], np.finfo(float).tiny))) + 1


def realise(
    observability: np.ndarray, outputs: int, order: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float | None]:
    """A and C by shift invariance of the extended observability matrix, stable in any case.

    Where least squares gives an unstable A, the shifted matrix is extended by a block of zeros instead: with
    orthonormal columns, A is then a contraction (Maciejowski 1995, Guaranteed stability with subspace methods).

    Shapes: observability (block_rows * p, k); returns A (n, n), C (p, n), poles (n,).
    """
    columns = observability[:, :order]
    A = _solve_least_squares(columns[:-outputs], columns[outputs:])
    poles = _find_eigenvalues(A)
    radius = float(np.max(np.abs(poles)))
    C = columns[:outputs]
    if radius < 1.0:
        return A, C, poles, None
    shifted = np.vstack([columns[outputs:], np.zeros((outputs, order))])
    A = columns.T @ shifted
    return A, C, _find_eigenvalues(A), radius


# For matrices of so few rows, most of the time of NumPy's functions is not LAPACK's.
def _solve_least_squares(matrix: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Least-squares solution, of least norm where columns depend on each other."""
    rows, columns = matrix.shape
    tolerance = max(rows, columns) * np.finfo(float).eps
    work = 2 * columns + max(3 * columns + 1, target.shape[1]) + columns
    _, solution, _, _, info = lapack.dgelsy(matrix, target, np.zeros(columns, dtype=np.int32), tolerance, work)
    if info:
        raise np.linalg.LinAlgError(f"DGELSY ended with info {info}")
    return solution[:columns]


def _find_eigenvalues(matrix: np.ndarray) -> np.ndarray:
    """Eigenvalues; complex only where any of them is."""
    real, imaginary, _, _, info = lapack.dgeev(matrix, compute_vl=0, compute_vr=0)
    if info:
        raise np.linalg.LinAlgError("the eigenvalues of A did not converge")
    return real + 1j * imaginary if imaginary.any() else real
