"""Results that claims are checked against; points are found by the values of their settings."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.paper.captions import label_setting
from ankleloop.paper.judgement import Mean, Measurement
from ankleloop.simulation.settings import SimulationSettings


class MissingEvidence(Exception):
    """A claim cannot be judged, because results that it needs do not exist."""


def parse_settings(text: Any) -> dict[str, list[Any]]:
    """Settings of the points that a claim needs, as its row in a table gives them."""
    settings: dict[str, list[Any]] = {}
    for part in text.split() if isinstance(text, str) else []:
        name, _, values = part.partition("=")
        if name not in SimulationSettings.model_fields or not values:
            raise ValueError(f"{part!r} is not a setting of the simulation with its value, such as reflex_gain=13.")
        if ":" in values:
            first, last, step = map(float, values.split(":"))
            settings[name] = [first + step * k for k in range(round((last - first) / step) + 1)]
        else:
            settings[name] = [_parse_value(value) for value in values.split("|")]
    return settings


def _parse_value(text: str) -> Any:
    """A number, true, false or null; any other text is itself."""
    try:
        return json.loads(text)
    except ValueError:
        return text


@dataclass(frozen=True)
class StudyResults:
    """Results of one study: tables with a row for each trial."""

    kind: str  # "simulation" or "recordings"
    points: Mapping[str, Mapping[str, Any]]  # simulation settings of each point
    # Rows of `ankleloop.assessment.scores.evaluate`, with columns `point`, `method` and `trial`.
    scores: pd.DataFrame
    parameters: pd.DataFrame  # rows of `parameter_row`, with the same columns
    labels: Mapping[str, str] = field(default_factory=dict)  # readable name of each method
    name: str = ""  # name of the study, for messages

    def label(self, method: str) -> str:
        """Readable name of a method."""
        return self.labels.get(method, method)

    @property
    def varied(self) -> set[str]:
        """Names of the settings that differ between the points."""
        first, *others = self.points.values()
        return {name for name, value in first.items() if any(other.get(name) != value for other in others)}

    def point(self, **settings: Any) -> str:
        """Name of the point with some values of its settings.

        Of several such points, that with the defaults of the simulation in everything by which they differ: a further
        point of the study changes nothing.
        """
        points = [
            name
            for name, values in self.points.items()
            if all(name in values and values[name] == value for name, value in settings.items())
        ]
        if len(points) > 1:
            first = self.points[points[0]]
            varied = [name for name in first if any(self.points[point].get(name) != first[name] for point in points)]
            defaults = SimulationSettings.defaults()
            points = [point for point in points if all(self.points[point][name] == defaults[name] for name in varied)]
        if len(points) != 1:
            condition = ", ".join(f"{label_setting(name)[0]} {value}" for name, value in settings.items())
            number = "several points" if points else "no point"
            raise MissingEvidence(
                f"the study {self.name} has {number} with {condition or 'the settings of the claim'}."
            )
        return points[0]

    def vafs(self, point: str, method: str, torque: str, against: str = "true") -> pd.Series:
        """VAF of a torque in each trial [%]."""
        return self._select(self.scores, "vaf", point, method, torque=torque, against=against)

    def mean_vaf(self, point: str, method: str, torque: str, against: str = "true") -> Mean:
        """Mean VAF of a torque [%]; raises `MissingEvidence` if there are no such results."""
        return Mean.of(self.vafs(point, method, torque, against))

    def vaf_difference(self, point: str, *arms: tuple[str, str, str]) -> Mean:
        """Mean difference of two VAFs on the same trials [points]."""
        first, second = (self.vafs(point, *arm) for arm in arms)
        return Mean.of(first - second)  # nan where a trial is in one of them only

    def parameter_values(self, name: str, point: str, method: str) -> pd.Series:
        """A column of `parameters` in each trial; raises `MissingEvidence` if there are no such results."""
        if name not in self.parameters:
            raise MissingEvidence(f"the study {self.name} has no results for {name}.")
        return self._select(self.parameters, name, point, method)

    def mean_parameter(self, name: str, point: str, method: str) -> Mean:
        """Mean of a column of `parameters`; raises `MissingEvidence` if there are no such results."""
        return Mean.of(self.parameter_values(name, point, method))

    def stiffness_errors(self, point: str, method: str) -> pd.Series:
        """Error of K in each trial [% of the true K]; raises `MissingEvidence` if there are no such results."""
        return 100.0 * (self.parameter_values("K", point, method) / self.points[point]["stiffness"] - 1.0)

    def stiffness_error(self, point: str, method: str) -> Mean:
        """Mean error of K [% of the true K]; raises `MissingEvidence` if there are no such results."""
        return Mean.of(self.stiffness_errors(point, method))

    def _select(self, table: pd.DataFrame, column: str, point: str, method: str, **keys: str) -> pd.Series:
        """A column of the rows of a point and a method with some values in other columns, by trial."""
        rows = table[(table["point"] == point) & (table["method"] == method)] if len(table) else table
        for name, value in keys.items():
            rows = rows[rows[name] == value] if len(rows) else rows
        if rows.empty:
            condition = ", ".join(f"{name} {value}" for name, value in keys.items())
            raise MissingEvidence(
                f"the study {self.name} has no results of {method} at {point}" + (f" ({condition})." if keys else ".")
            )
        return rows.set_index("trial")[column]


@dataclass(frozen=True)
class Evidence:
    """Everything that claims are checked against."""

    studies: Mapping[str, StudyResults]  # results by study
    # Further measurements by `quantity`: columns `value`, `low` and `high`, the ends of the 95 % interval.
    measurements: pd.DataFrame
    tables: Mapping[str, pd.DataFrame]  # published tables

    def study(self, name: str) -> StudyResults:
        """Results of a study."""
        if name not in self.studies:
            raise MissingEvidence(f"the study {name} was not run.")
        return self.studies[name]

    def pooled_stiffness_error(self, arms: Mapping[str, str], **settings: Any) -> Mean:
        """Mean error of K over the trials of several studies with equal settings [% of the true K]."""
        parts = [
            self.studies[study].stiffness_errors(self.studies[study].point(**settings), method)
            for study, method in arms.items()
            if study in self.studies
        ]
        if not parts:
            raise MissingEvidence(f"none of the studies {', '.join(arms)} was run.")
        return Mean.of(np.concatenate(parts))

    def measurement(self, quantity: str) -> Measurement:
        """A further measurement with its interval."""
        if quantity not in self.measurements.index:
            raise MissingEvidence(f"{quantity} was not measured.")
        return Measurement(
            *(float(self.measurements.loc[quantity].get(name, np.nan)) for name in ("value", "low", "high"))
        )
