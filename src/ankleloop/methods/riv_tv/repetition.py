"""What repeats with the cycle, or changes slowly: it is taken out of torque, regressors and instruments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy import linalg

from ankleloop.joint.time_varying_course import Course, Splines
from ankleloop.methods.riv_tv.whitening import DEPENDENT_SPLINES, PaddedTransform, Weighting

MEAN_SPLINES = 24  # of what repeats with the cycle, or changes slowly
FEWEST_SPLINES = 5
SPLINE_DISTANCE = 0.25  # s, between those over time
EVERY = slice(0, None)  # sample of a signal
DEPENDENT_DIRECTIONS = 1e-12  # of the largest eigenvalue


@dataclass(frozen=True, eq=False)
class CycleMean:
    """Mean over cycles of equal length."""

    rows: slice | np.ndarray  # samples of whole cycles
    length: int  # samples of a cycle
    since: np.ndarray  # shape (N,): samples since the onset of a cycle

    @classmethod
    def of(cls, course: Course) -> Self:
        """That of a record; cycles go on before and after those that count."""
        length = course.equal_cycles
        since = [np.arange(part.place.size) - part.row_numbers[0] for part in course.parts]
        return cls(course.rows, length, np.concatenate(since) % length)

    def deviation(self, signals: np.ndarray) -> np.ndarray:
        """All samples of signals less their mean over the cycles, shape (..., N)."""
        cycles = signals[..., self.rows].reshape(*signals.shape[:-1], -1, self.length)
        return signals - cycles.mean(axis=-2)[..., self.since]

    def weighted(self, weighting: Weighting) -> CycleMean:
        """What repeats of weighted signals, which are of whole cycles alone: weights repeat, too."""
        return CycleMean(EVERY, self.length, self.since[self.rows])


@dataclass(frozen=True, eq=False)
class SmoothPart:
    """Part of signals that is a smooth function of the place, over a cycle, a schedule or time."""

    rows: slice | np.ndarray  # samples that count
    directions: np.ndarray  # shape (directions, N)
    fit: np.ndarray  # shape (rows, directions): the matrix that fits them to the samples that count
    transform: PaddedTransform

    @classmethod
    def of(cls, course: Course, transform: PaddedTransform) -> Self:
        """That of a record."""
        count = MEAN_SPLINES
        if course.dimension == "time":
            low, high = course.limits
            # More would follow the mean perturbation of short trials, which filters change.
            count = min(count, max(FEWEST_SPLINES, round((high - low) / SPLINE_DISTANCE)))
        splines = Splines(count, course.periodic)(course.place).T
        fit = linalg.pinv(splines[:, course.rows], rtol=DEPENDENT_SPLINES)
        return cls(course.rows, splines, fit, transform)

    def part(self, signals: np.ndarray) -> np.ndarray:
        """The smooth part at all samples of signals, shape (..., N)."""
        return (signals[..., self.rows] @ self.fit) @ self.directions

    def deviation(self, signals: np.ndarray) -> np.ndarray:
        """All samples of signals less their smooth part, shape (..., N)."""
        return signals - self.part(signals)

    def weighted(self, weighting: Weighting) -> SmoothPart:
        """What changes slowly of weighted signals, which are of the samples that count alone."""
        slow = weighting(self.transform.spectra(self.directions))
        values, vectors = np.linalg.eigh(slow @ slow.T)
        independent = values > DEPENDENT_DIRECTIONS * values[-1]
        orthonormal = vectors[:, independent] / np.sqrt(values[independent])
        directions = orthonormal.T @ slow
        return SmoothPart(EVERY, directions, directions.T, self.transform)
