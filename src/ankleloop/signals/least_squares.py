"""Least squares of quantities that differ in unit: scaled first, so that the rank does not depend on units."""

from __future__ import annotations

import numpy as np

SINGULAR = 1e-12  # of the largest singular value of scaled equations
TINY = np.finfo(float).tiny


def solve_scaled(
    normal: np.ndarray, right: np.ndarray, rank_tolerance: float = SINGULAR
) -> np.ndarray:
    """Solve normal equations whose unknowns differ in unit; directions without information get zero.

    Shapes: normal (k, k), right (k,) or (k, n); returns as right.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(normal)), TINY))
    scaled = normal * (scale[:, None] * scale)
    solution = np.linalg.lstsq(scaled, (right.T * scale).T, rcond=rank_tolerance)[0]
    return (solution.T * scale).T


def fit_scaled(regressors: np.ndarray, target: np.ndarray, rank_tolerance: float) -> np.ndarray:
    """Least squares of a target on regressors that differ in unit, all of them without means.

    Shapes: regressors (N, k), target (N,); returns (k,).
    """
    scale = np.maximum(regressors.std(axis=0), TINY)
    return np.linalg.lstsq(regressors / scale, target, rcond=rank_tolerance)[0] / scale
