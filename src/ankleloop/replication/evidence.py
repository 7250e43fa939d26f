"""Results that claims are checked against: means over the trials of a point, with their intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.signals.vaf import confidence_margin

__all__ = ["Evidence", "Mean", "MissingEvidence", "StudyResults"]


class MissingEvidence(Exception):
    """A claim cannot be judged, because results that it needs do not exist."""


@dataclass(frozen=True)
class Mean:
    """Mean over trials with half of its 95 % interval, which is nan for a single trial.

    Examples
    --------
    >>> Mean.of(pd.Series([90.0, 92.0])).text
    '91 ± 13'
    """

    value: float
    margin: float

    @classmethod
    def of(cls, values: pd.Series) -> Mean:
        """Mean of a sample."""
        return cls(float(values.mean()), float(confidence_margin(values.std(), values.size)))

    @property
    def text(self) -> str:
        """The mean and its interval in words."""
        return f"{self.value:.4g} ± {self.margin:.2g}"

    def __abs__(self) -> Mean:
        return Mean(abs(self.value), self.margin)

    def __sub__(self, other: Mean) -> Mean:
        """Difference of independent means."""
        return Mean(self.value - other.value, float(np.hypot(self.margin, other.margin)))

    def is_within(self, tolerance: float) -> bool | None:
        """Whether its magnitude is within a tolerance.

        Parameters
        ----------
        tolerance : float
            Largest magnitude that is accepted.

        Returns
        -------
        bool or None
            None if the interval is wider than the tolerance and contains it.

        Examples
        --------
        >>> Mean(1.0, 0.1).is_within(2.0), Mean(2.5, 0.1).is_within(2.0), Mean(4.0, 3.0).is_within(2.0)
        (True, False, None)
        """
        size = abs(self.value)
        if np.nan_to_num(self.margin, nan=np.inf) <= tolerance or size + self.margin <= tolerance:
            return bool(size <= tolerance)
        return False if size - self.margin > tolerance else None

    def exceeds(self, smallest: float) -> bool | None:
        """Whether it is above 0 beyond its interval, and large enough to count.

        Parameters
        ----------
        smallest : float
            Smallest value that counts.

        Returns
        -------
        bool or None
            None if the interval leaves it open.

        Examples
        --------
        >>> Mean(6.0, 1.0).exceeds(5.0), Mean(3.0, 1.0).exceeds(5.0), Mean(4.0, 2.0).exceeds(5.0)
        (True, False, None)
        """
        if self.value > self.margin and self.value >= smallest:
            return True
        return False if self.value + self.margin < smallest else None


@dataclass(frozen=True)
class StudyResults:
    """Results of one study: tables with a row for each trial.

    Parameters
    ----------
    kind : str
        "simulation" or "recordings".
    points : dict of str to dict
        Simulation settings of each point.
    scores, parameters : pandas.DataFrame
        Rows of `ankleloop.assessment.scores.evaluate` and `parameter_row`, with columns `point`, `method` and `trial`.
    labels : dict of str to str
        Readable name of each method.
    """

    kind: str
    points: Mapping[str, Mapping[str, Any]]
    scores: pd.DataFrame
    parameters: pd.DataFrame
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def first_point(self) -> str:
        """Name of the first point."""
        return next(iter(self.points))

    def points_with(self, **settings: Any) -> list[str]:
        """Names of the points with some values of their settings, in the order of the study."""
        return [
            name
            for name, values in self.points.items()
            if all(values.get(setting) == value for setting, value in settings.items())
        ]

    def mean_vaf(self, point: str, method: str, torque: str, against: str = "true") -> Mean:
        """Mean VAF of a torque [%].

        Raises
        ------
        MissingEvidence
            If there are no such results.
        """
        return _mean(self.scores, "vaf", point, method, torque=torque, against=against)

    def mean_parameter(self, name: str, point: str, method: str) -> Mean:
        """Mean of a column of `parameters`.

        Raises
        ------
        MissingEvidence
            If there are no such results.
        """
        return _mean(self.parameters, name, point, method)

    def stiffness_error(self, point: str, method: str) -> Mean:
        """Mean error of K [% of the true K]."""
        truth = self.points[point]["stiffness"]
        k = self.mean_parameter("K", point, method)
        return Mean(100 * (k.value / truth - 1), 100 * k.margin / truth)

    def vaf_difference(self, point: str, methods: tuple[str, str], torque: str, against: str) -> Mean:
        """Mean difference of the VAF of two methods on the same trials [points].

        Raises
        ------
        MissingEvidence
            If one of the methods has no results.
        """
        table = self.scores
        rows = table[(table["point"] == point) & (table["torque"] == torque) & (table["against"] == against)]
        by_trial = rows.pivot(index="trial", columns="method", values="vaf")
        if not set(methods) <= set(by_trial):
            raise MissingEvidence(f"there are no results of {' and '.join(methods)} at {point}.")
        return Mean.of(by_trial[methods[0]] - by_trial[methods[1]])


def _mean(table: pd.DataFrame, column: str, point: str, method: str, **keys: str) -> Mean:
    """Mean of a column over the rows of a point and a method with some values in other columns."""
    rows = table[(table["point"] == point) & (table["method"] == method)]
    for name, value in keys.items():
        rows = rows[rows[name] == value]
    if rows.empty:
        condition = ", ".join(f"{name} {value}" for name, value in keys.items())
        raise MissingEvidence(f"there are no results of {method} at {point}" + (f" ({condition})." if keys else "."))
    return Mean.of(rows[column])


@dataclass(frozen=True)
class Evidence:
    """Everything that claims are checked against.

    Parameters
    ----------
    studies : dict of str to StudyResults
        Results by study.
    measurements : dict of str to float
        Further measurements by quantity.
    tables : dict of str to pandas.DataFrame
        Published tables.
    """

    studies: Mapping[str, StudyResults]
    measurements: Mapping[str, float]
    tables: Mapping[str, pd.DataFrame]

    def study(self, name: str) -> StudyResults:
        """Results of a study.

        Raises
        ------
        MissingEvidence
            If it was not run.
        """
        if name not in self.studies:
            raise MissingEvidence(f"the study {name} was not run.")
        return self.studies[name]

    def point(self, study: str, **settings: Any) -> str:
        """First point of a study with some values of its settings.

        Raises
        ------
        MissingEvidence
            If there is none.
        """
        points = self.study(study).points_with(**settings)
        if not points:
            condition = ", ".join(f"{name} = {value}" for name, value in settings.items())
            raise MissingEvidence(f"the study {study} has no point with {condition}.")
        return points[0]

    def measurement(self, quantity: str) -> float:
        """A further measurement.

        Raises
        ------
        MissingEvidence
            If it was not made.
        """
        if quantity not in self.measurements:
            raise MissingEvidence(f"{quantity} was not measured.")
        return self.measurements[quantity]
