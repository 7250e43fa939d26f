"""What repeats with the cycle, or changes slowly: it is taken out of torque, regressors and instruments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy import linalg

from ankleloop.joint.time_varying_course import Course, Splines
from ankleloop.methods.riv_tv.whitening import DEPENDENT_SPLINES, PaddedTransform, Weighting

MEAN_SPLINES = 24  # of what repeats with the cycle, or changes slowly
DEPENDENT_DIRECTIONS = 1e-12  # of the largest eigenvalue


@dataclass(frozen=True)
class CycleMean:
    """Mean over cycles of equal length."""

    rows: slice  # samples of whole cycles
    length: int  # samples of a cycle

    def remove(self, signals: np.ndarray) -> np.ndarray:
        """Signals of the samples that count less their mean over the cycles, shape (..., rows)."""
        cycles = signals.reshape(*signals.shape[:-1], -1, self.length)
        return (cycles - cycles.mean(axis=-2, keepdims=True)).reshape(signals.shape)

    def deviation(self, signals: np.ndarray) -> np.ndarray:
        """All samples of signals less their mean over the cycles, shape (..., N)."""
        cycles = signals[..., self.rows].reshape(*signals.shape[:-1], -1, self.length)
        since_onset = (np.arange(signals.shape[-1]) - self.rows.start) % self.length
        return signals - cycles.mean(axis=-2)[..., since_onset]

    def weighted(self, weighting: Weighting) -> CycleMean:
        """What repeats of weighted signals: the same mean, as weights repeat, too."""
        return self


class SmoothPart:
    """Part of signals that is a smooth function of the place: over a cycle, a schedule or time."""

    def __init__(self, course: Course, transform: PaddedTransform) -> None:
        self.rows = course.rows
        self.splines = Splines(MEAN_SPLINES, course.periodic)(course.place).T  # (splines, N)
        self._spectra = transform.spectra(self.splines)
        # The matrix that fits them to the samples that count, shape (rows, splines).
        self._fit = linalg.pinv(self.splines[:, self.rows], rtol=DEPENDENT_SPLINES)

    def part(self, signals: np.ndarray) -> np.ndarray:
        """The smooth part at all samples of a record, shape (..., N)."""
        return (signals[..., self.rows] @ self._fit) @ self.splines

    def deviation(self, signals: np.ndarray) -> np.ndarray:
        """All samples of signals less their smooth part, shape (..., N)."""
        return signals - self.part(signals)

    def weighted(self, weighting: Weighting) -> SlowDirections:
        """What changes slowly of weighted signals."""
        return SlowDirections.of(weighting(self._spectra))


@dataclass(frozen=True, eq=False)
class SlowDirections:
    """Directions of what changes slowly, in signals that are weighted and filtered."""

    directions: np.ndarray  # shape (directions, rows)

    @classmethod
    def of(cls, slow: np.ndarray) -> Self:
        """Those of slow signals with the same weights.

        Shapes: slow (splines, rows).
        """
        values, vectors = np.linalg.eigh(slow @ slow.T)
        independent = values > DEPENDENT_DIRECTIONS * values[-1]
        directions = vectors[:, independent] / np.sqrt(values[independent])
        return cls(directions.T @ slow)

    def remove(self, signals: np.ndarray) -> np.ndarray:
        """Signals without their part along the directions, shape (..., rows)."""
        return signals - (signals @ self.directions.T) @ self.directions
