"""From the extended observability matrix to A and C."""

from __future__ import annotations

import numpy as np

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

    Shapes: observability (block_rows * p, k); returns A (n, n), C (p, n), poles (n,), and the spectral radius of an
    unstable A that was replaced.
    """
    columns = observability[:, :order]
    C, shifted = columns[:outputs], columns[outputs:]
    A = np.linalg.lstsq(columns[:-outputs], shifted, rcond=None)[0]
    poles = np.linalg.eigvals(A)
    radius = float(np.max(np.abs(poles)))
    if radius < 1.0:
        return A, C, poles, None
    A = columns.T @ np.vstack([shifted, np.zeros((outputs, order))])
    return A, C, np.linalg.eigvals(A), radius
