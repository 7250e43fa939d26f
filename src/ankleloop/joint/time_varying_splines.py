"""Parameters of a joint as functions of phase, time or a scheduling variable: uniform B-splines and their roughness."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

__all__ = ["Splines"]


@dataclass(frozen=True)
class Splines:
    """Uniform cubic B-splines over 0 … 1, or the indicators of equal intervals.

    Parameters
    ----------
    size : int
        Number of splines; 4 at least for a basis of degree 3.
    periodic : bool
        Whether 1 is the same place as 0.
    degree : {3, 0}
        Cubic splines, or indicators.
    """

    size: int
    periodic: bool
    degree: int = 3

    def __call__(self, place: np.ndarray) -> np.ndarray:
        """Values of the splines at places within 0 … 1, shape (N, size)."""
        intervals = self.size if self.periodic or self.degree == 0 else self.size - 3
        scaled = np.clip(place, 0.0, 1.0) * intervals
        first = np.minimum(scaled.astype(int), intervals - 1)
        values, rows = np.zeros((place.size, self.size)), np.arange(place.size)
        if self.degree == 0:
            values[rows, first] = 1.0
            return values
        u = scaled - first
        pieces = ((1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3)
        for k, piece in enumerate(pieces):
            np.add.at(values, (rows, (first + k) % self.size), piece / 6.0)
        return values

    @cached_property
    def penalty(self) -> np.ndarray:
        """Sum of the squares of second differences of the coefficients as a matrix; none for indicators."""
        if self.degree == 0:
            return np.zeros((self.size, self.size))
        if self.periodic:
            unit = np.eye(self.size)
            differences = np.roll(unit, 1, axis=0) - 2 * unit + np.roll(unit, -1, axis=0)
        else:
            differences = np.diff(np.eye(self.size), 2, axis=0)
        return differences.T @ differences

    @property
    def rank(self) -> int:
        """Rank of the penalty: coefficients of a constant, and of a straight line if not periodic, cost nothing."""
        return 0 if self.degree == 0 else self.size - (1 if self.periodic else 2)
