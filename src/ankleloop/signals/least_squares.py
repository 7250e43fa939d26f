"""Least squares of quantities that differ in unit: scaled first, so that the rank does not depend on units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

SINGULAR = 1e-12  # of the largest singular value of scaled equations
TINY = np.finfo(float).tiny


class ScaledFit(NamedTuple):
    """Least squares of scaled columns."""

    coefficients: np.ndarray  # shape (k,), of the columns as they were
    rank: int
    singular_values: np.ndarray  # shape (k,), of the scaled columns


def solve_scaled(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve normal equations whose unknowns differ in unit; directions without information get zero.

    Shapes: normal (k, k), right (k,) or (k, n); returns as right.
    """
    power = np.maximum(np.abs(np.diag(normal)), TINY)
    scale = 1.0 / np.sqrt(power)
    scaled_normal = normal * (scale[:, None] * scale)
    scaled_right = (right.T * scale).T
    solution = np.linalg.lstsq(scaled_normal, scaled_right, rcond=SINGULAR)[0]
    return (solution.T * scale).T


def unexplained_share(columns: np.ndarray, target: np.ndarray, ridge: float) -> float:
    """Share of the variance of a target that columns leave, all less their means; all of it of a constant target.

    The ridge is a share of the power of each column.

    Shapes: columns (N, k), target (N,).
    """
    columns = columns - columns.mean(axis=0)
    target = target - target.mean()
    power = target @ target
    if not power > 0.0:
        return 1.0
    normal = columns.T @ columns
    normal += ridge * np.diag(normal.diagonal())
    right = columns.T @ target
    return float(1.0 - right @ solve_scaled(normal, right) / power)


def invert_scaled(normal: np.ndarray) -> np.ndarray:
    """Inverse of normal equations as `solve_scaled` solves them, shape (k, k)."""
    return solve_scaled(normal, np.eye(len(normal)))


def fit_scaled(regressors: np.ndarray, target: np.ndarray, rank_tolerance: float) -> np.ndarray:
    """Least squares of a target on regressors that differ in unit, all of them without means.

    Shapes: regressors (N, k), target (N,); returns (k,).
    """
    deviation = np.maximum(regressors.std(axis=0), TINY)
    return fit_columns(regressors, target, deviation, rank_tolerance).coefficients


def fit_columns(
    columns: np.ndarray, target: np.ndarray, scale: np.ndarray, rank_tolerance: float
) -> ScaledFit:
    """Least squares of a target on columns that are divided by a scale first.

    Shapes: columns (N, k), target (N,), scale (k,).
    """
    solution, _, rank, values = np.linalg.lstsq(columns / scale, target, rcond=rank_tolerance)
    return ScaledFit(solution / scale, int(rank), values)
