"""A claim with the results that it is checked against; points are found by the values of their settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
import yaml

from ankleloop.paper.captions import label_setting
from ankleloop.paper.judgement import Comparison, Mean, Measurement, Quantity
from ankleloop.simulation.settings import SimulationSettings

# What Table 1 scores each torque against.
VAF_COLUMNS = {"net": "vaf_net_measured", "intrinsic": "vaf_intrinsic_true", "reflex": "vaf_reflex_true"}


class MissingEvidence(Exception):
    """A claim cannot be judged, because results that it needs do not exist."""


def parse_settings(text: Any) -> dict[str, list[Any]]:
    """Settings of the points that a claim needs, as its row in a table gives them."""
    settings: dict[str, list[Any]] = {}
    for part in text.split() if isinstance(text, str) else []:
        name, _, values = part.partition("=")
        if ":" in values:
            first, last, step = map(float, values.split(":"))
            settings[name] = [first + step * k for k in range(round((last - first) / step) + 1)]
        else:
            settings[name] = [yaml.safe_load(value) for value in values.split("|")]
    return settings


@dataclass(frozen=True)
class StudyResults:
    """Results of one study."""

    kind: str  # "simulation" or "recordings"
    points: Mapping[str, Mapping[str, Any]]  # simulation settings of each point
    table: pd.DataFrame  # its trials, as `ankleloop.paper.trial_tables.read_trial_table` reads them
    labels: Mapping[str, str] = field(default_factory=dict)  # readable name of each method
    name: str = ""  # name of the study, for messages

    def point(self, settings: Mapping[str, Any]) -> str:
        """Name of the point with some values of its settings.

        Of several such points, that with the defaults of the simulation in everything by which they differ: a further
        point of the study changes nothing.
        """
        points = [point for point, values in self.points.items() if settings.items() <= values.items()]
        if len(points) > 1:
            first, defaults = self.points[points[0]], SimulationSettings.defaults()
            varied = [name for name in first if any(self.points[point].get(name) != first[name] for point in points)]
            points = [point for point in points if all(self.points[point][name] == defaults[name] for name in varied)]
        if len(points) != 1:
            condition = ", ".join(f"{label_setting(name)[0]} {value}" for name, value in settings.items())
            number = "several points" if points else "no point"
            raise MissingEvidence(
                f"the study {self.name} has {number} with {condition or 'the settings of the claim'}."
            )
        return points[0]

    def values(self, column: str, method: str, settings: Mapping[str, Any]) -> pd.Series:
        """A column of the table in each trial, or `K_error` [%]; a failed trial has no VAF, and nan for a parameter."""
        point = self.point(settings)
        if column == "K_error":
            return 100.0 * (self.values("K", method, settings) / self.points[point]["stiffness"] - 1.0)
        rows = self.table[(self.table["point"] == point) & (self.table["method"] == method)].set_index("trial")
        values = rows.reindex(columns=[column])[column].astype(float)
        values = values.dropna() if column.startswith("vaf_") else values
        if values.empty:
            raise MissingEvidence(f"the study {self.name} has no {column} of {method} at {point}.")
        return values


@dataclass(frozen=True)
class Case:
    """A claim with everything that claims are checked against."""

    claim: Mapping[str, Any]  # a row of the claims, or a number of a published table
    studies: Mapping[str, StudyResults]  # results by study
    # Further measurements by `quantity`: columns `value`, `low` and `high`, the ends of the 95 % interval.
    measurements: pd.DataFrame
    tables: Mapping[str, pd.DataFrame]  # published tables

    @property
    def paper(self) -> float:
        """What the paper says."""
        return self.claim["paper"]

    @property
    def tolerance(self) -> float:
        """Difference that is accepted; nan where nothing says so."""
        return self.claim.get("tolerance", np.nan)

    def levels(self, name: str) -> list[Any]:
        """Values of a setting at the points that the claim needs."""
        return parse_settings(self.claim["settings"])[name]

    def study(self, name: str) -> StudyResults:
        """Results of a study."""
        if name not in self.studies:
            raise MissingEvidence(f"the study {name} was not run.")
        return self.studies[name]

    def values(self, study: str, column: str, method: str, **own: Any) -> pd.Series:
        """A column of a study in each trial, at the settings of the claim and some of its own."""
        settings = {name: values[0] for name, values in parse_settings(self.claim.get("settings")).items()}
        return self.study(study).values(column, method, {**settings, **own})

    def vaf(self, study: str, method: str, torque: str, **own: Any) -> Mean:
        """Mean VAF of a torque [%]."""
        return Mean.of(self.values(study, VAF_COLUMNS[torque], method, **own))

    def lead(self, study: str, first: tuple[str, str], second: tuple[str, str], **own: Any) -> Mean:
        """Mean VAF of a method and a torque less that of another on the same trials [points]; nan if these differ."""
        return Mean.of(
            self.values(study, VAF_COLUMNS[first[1]], first[0], **own)
            - self.values(study, VAF_COLUMNS[second[1]], second[0], **own)
        )

    def error(self, study: str, method: str, **own: Any) -> Mean:
        """Mean error of K [% of the true K]."""
        return Mean.of(self.values(study, "K_error", method, **own))

    def measurement(self, quantity: str) -> Measurement:
        """A further measurement with its interval."""
        if quantity not in self.measurements.index:
            raise MissingEvidence(f"{quantity} was not measured.")
        return Measurement(*self.measurements.reindex(columns=["value", "low", "high"]).loc[quantity].astype(float))

    def within(self, label: str, ours: Quantity, paper: float = 0.0, *, control: bool = False) -> Comparison:
        """A comparison that accepts differences of either sign up to the tolerance."""
        return Comparison(label, ours, (-self.tolerance, self.tolerance), paper, control=control)

    def above(self, label: str, ours: Quantity, paper: float = 0.0, *, size: bool = False) -> Comparison:
        """A comparison that accepts differences, or sizes of them, from the tolerance on."""
        return Comparison(label, ours, (self.tolerance, np.inf), paper, size=size)

    def below(self, label: str, ours: Quantity, paper: float = 0.0) -> Comparison:
        """A comparison that accepts what is less by the tolerance or more."""
        return Comparison(label, ours, (-np.inf, -self.tolerance), paper)
