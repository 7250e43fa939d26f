"""How each number and claim of the paper is checked: with which results of a run it is compared.

Points of studies are found by the values of their settings. The rule that gives a verdict is in `judgement`. A claim
names its check: the function `check_NAME` and what that takes beside the case.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.paper import judgement
from ankleloop_workflow.paper.judgement import Comparison, Mean, Measurement, Quantity, Range, judge
from ankleloop_workflow.tables.captions import label_setting
from ankleloop_workflow.tables.comparisons import format_number

# What Table 1 scores each torque against.
VAF_COLUMNS = {
    "net": "vaf_net_measured",
    "intrinsic": "vaf_intrinsic_true",
    "reflex": "vaf_reflex_true",
}
CASCADE_ONCE = "parallel-cascade-one-pass"
CASCADE_CONVERGED = "parallel-cascade"
DRAWN = "assumptions"  # study of settings that are drawn at random
MOST_RESULTS = 8  # of comparisons that a reason lists; of more it has the decisive one
NEARLY_ALL = 90.0  # % VAF: from here on what is left unexplained tells more than the VAF

Row = dict[str, Any]  # verdict, numbers and reason of a claim, by the columns of the ledger


class MissingEvidence(Exception):
    """A claim cannot be judged, because results that it needs do not exist."""


@dataclass(frozen=True)
class StudyResults:
    """Results of one simulated study."""

    name: str
    # Simulation settings, and varied options of methods, of each point.
    points: Mapping[str, Mapping[str, Any]]
    # Its trials, as `ankleloop_workflow.tables.trial_tables.read_trial_table` reads them.
    table: pd.DataFrame
    labels: Mapping[str, str]  # readable name of each method

    def point(self, settings: Mapping[str, Any]) -> str:
        """Name of the point with some values of its settings.

        Of several such points, that with the defaults of the simulation in everything by which they differ, and null
        for options of methods: a further point of the study changes nothing.
        """
        defaults = SimulationSettings.defaults()
        # What is not by default at each point.
        special = {
            point: {(name, value) for name, value in values.items() if value != defaults.get(name)}
            for point, values in self.points.items()
            if settings.items() <= values.items()
        }
        shared = set.intersection(*special.values()) if special else set()
        points = [point for point, own in special.items() if own == shared]
        if len(points) != 1:
            number = "several points" if points else "no point"
            words = [f"{label_setting(name)[0]} {value}" for name, value in settings.items()]
            condition = ", ".join(words) or "its settings"
            raise MissingEvidence(f"the study {self.name} has {number} with {condition}.")
        return points[0]


@dataclass(frozen=True)
class Case:
    """A claim with everything that claims are checked against."""

    claim: Any  # a row of the claims, or a number of a published table
    studies: Mapping[str, StudyResults]  # results by study
    # Further measurements by `quantity`: columns `value`, `low` and `high`, the ends of the 95 % interval.
    measurements: pd.DataFrame

    def study(self, name: str) -> StudyResults:
        """Results of a study."""
        if name not in self.studies:
            raise MissingEvidence(f"the study {name} was not run.")
        return self.studies[name]

    def values(self, study: str, quantity: str, method: str, **own: Any) -> pd.Series:
        """A quantity in each trial of a study, at the settings of the claim and some of its own.

        It is a column of the table, the VAF of a torque [%], or `K_error` [%]; a failed trial has no VAF, and nan for a
        parameter.
        """
        results = self.study(study)
        table = results.table
        column = VAF_COLUMNS.get(quantity, quantity)
        point = results.point({**self.claim.settings, **own})
        rows = table[(table["point"] == point) & (table["method"] == method)].set_index("trial")
        if column == "K_error":
            values = 100.0 * (rows["K"] / results.points[point]["stiffness"] - 1.0)
        else:
            values = rows.reindex(columns=[column])[column].astype(float)
        if column.startswith("vaf_"):
            values = values.dropna()
        if values.empty:
            raise MissingEvidence(f"the study {study} has no {column} of {method} at {point}.")
        return values

    def mean(self, study: str, quantity: str, method: str, **own: Any) -> Mean:
        """Mean of a quantity over trials."""
        return Mean.of(self.values(study, quantity, method, **own))

    def lead(self, study: str, first: Sequence[str], second: Sequence[str], **own: Any) -> Mean:
        """Mean VAF of a torque and a method less that of another on the same trials [points]; nan if these differ."""
        return Mean.of(self.values(study, *first, **own) - self.values(study, *second, **own))

    def measurement(self, quantity: str) -> Measurement:
        """A further measurement with its interval."""
        if quantity not in self.measurements.index:
            raise MissingEvidence(f"{quantity} was not measured.")
        row = self.measurements.loc[quantity, ["value", "low", "high"]]
        return Measurement(*row.astype(float))

    @property
    def within(self) -> Range:
        """Differences of either sign up to the tolerance."""
        return -self.claim.tolerance, self.claim.tolerance

    @property
    def above(self) -> Range:
        """Differences, or sizes of them, from the tolerance on."""
        return self.claim.tolerance, np.inf

    @property
    def below(self) -> Range:
        """What is less by the tolerance or more."""
        return -np.inf, -self.claim.tolerance

    def find_accepted(self, listed: Mapping[str, Any]) -> Range:
        """Differences that a comparison accepts: a range, or the name of one of those above."""
        accepted = listed["accept"]
        return getattr(self, accepted) if isinstance(accepted, str) else accepted

    def compare(
        self,
        what: str,
        comparisons: Sequence[Comparison],
        remark: str = "",
        ours: Quantity | None = None,
    ) -> Row:
        """Verdict on the claim, which needs all comparisons, with the numbers that it rests on and its reason.

        Our value is that of the comparison that decides, if none is given.
        """
        judged = judge(comparisons)
        decisive = judged.decisive
        ours = ours or decisive.ours
        results = ", ".join(map(_describe, comparisons))
        if len(comparisons) > MOST_RESULTS:
            results = f"{_describe(decisive)} (of {len(comparisons)} results the decisive one)"
        parts = [f"{what}: {results}", remark, judged.explanation]
        verdict = judged.verdict
        if verdict == judgement.REPRODUCED and isinstance(self.claim.conditions, str):
            verdict = judgement.CONDITIONAL
        low, high = decisive.interval(judged.level)
        return {
            "verdict": verdict,
            "ours": ours.value,
            "uncertainty": half_interval(ours),
            "difference": decisive.difference,
            "difference_low": low,
            "difference_high": high,
            "reason": "; ".join(part.rstrip(".") for part in parts if part) + ".",
        }


def half_interval(ours: Quantity) -> float:
    """Half of the 95 % interval of a result."""
    low, high = ours.interval()
    return (high - low) / 2.0


def describe_result(ours: Quantity) -> str:
    """A result ± half of its 95 % interval."""
    return format_number(ours.value, margin=half_interval(ours))


def _describe(comparison: Comparison) -> str:
    """A result in words; of a VAF near 100 % also what it leaves unexplained, since its difference says little."""
    ours, paper = comparison.ours.value, comparison.paper
    text = f"{comparison.label} {describe_result(comparison.ours)}".strip()
    if not (NEARLY_ALL <= paper < 100.0 and ours >= NEARLY_ALL):
        return text
    return f"{text} ({(100.0 - ours) / (100.0 - paper):.2g} times the unexplained variance of the paper)"


def check_means(case: Case, *what: str) -> Row:
    """Means over trials, or differences of two, are within, above or below what the claim lists."""
    comparisons = []
    shown = None
    for label, listed in case.claim.comparisons.items():
        study, *first = listed["mean"].split()
        own = listed.get("at", {})
        if "less" in listed:
            ours = case.lead(study, first, listed["less"].split(), **own)
        else:
            ours = case.mean(study, *first, **own)
        if "less_at" in listed:
            ours -= case.mean(study, *first, **listed["less_at"])
        accepted = case.find_accepted(listed)
        chosen = {name: listed[name] for name in ("size", "control") if name in listed}
        comparisons.append(Comparison(label, ours, accepted, listed.get("from", 0.0), **chosen))
        if listed.get("shown"):
            shown = ours
    return case.compare(" ".join(what), comparisons, ours=shown)


def check_figure4_pr(case: Case) -> Row:
    """PR-MOESP is good at every gain."""
    comparisons = []
    for gain, torque in product(case.claim.settings["reflex_gain"], VAF_COLUMNS):
        mean = case.mean("figure4", torque, "pr-moesp", reflex_gain=gain)
        label = f"{torque} torque at gain {gain:g}"
        comparisons.append(Comparison(label, mean, case.above, case.claim.paper))
    return case.compare("mean VAF [%]", comparisons)


def check_columns(case: Case, method: str) -> Row:
    """Columns of instruments, which follow from the definition of a method."""
    rows = case.measurement(f"{method}_instrument_rows").value
    block_rows = case.measurement("block_rows").value
    is_held = rows == block_rows * case.claim.paper
    verdict = judgement.BY_CONSTRUCTION if is_held else judgement.NOT_REPRODUCED
    reason = (
        f"{rows:g} rows of instruments over {block_rows:g} block rows: {case.claim.conditions}."
    )
    return {"verdict": verdict, "ours": rows / block_rows, "reason": reason}


def check_stated(case: Case, value: str) -> Row:
    """What no run can change: a number that the paper contradicts itself, or that follows from a definition."""
    contradicts = float(value) != case.claim.paper and pd.notna(case.claim.paper)
    verdict = judgement.CONTRADICTION if contradicts else judgement.BY_CONSTRUCTION
    return {"verdict": verdict, "ours": float(value), "reason": f"{case.claim.conditions}."}


def check_economy(case: Case, quantity: str, unit: str) -> Row:
    """Ratio of what EIV-MOESP and PR-MOESP take on the same trials."""
    pr = case.measurement(f"pr-moesp_{quantity}").value
    eiv = case.measurement(f"eiv-moesp_{quantity}").value
    ratio = case.measurement(f"{quantity}_ratio")
    comparison = Comparison("", ratio, case.above, case.claim.paper)
    remark = f"PR-MOESP {pr:.3g} {unit}, EIV-MOESP {eiv:.3g} {unit}"
    return case.compare("ratio", [comparison], remark)


def check_drawn(case: Case, quantity: str, low: str, high: str) -> Row:
    """What the settings have that are drawn at random, such as the share at which a claim holds, is within a range."""
    case.study(DRAWN)
    ours = case.measurement(f"{DRAWN}/{quantity}")
    comparison = Comparison("", ours, (float(low), float(high)))
    return case.compare(f"at the settings drawn [{case.claim.unit}]", [comparison])


def check_accurate(case: Case, *arms: str) -> Row:
    """K by PR-MOESP with one basis over all trials at the setting of Table 1; an arm is STUDY=METHOD."""
    samples = []
    for arm in arms:
        study, method = arm.split("=")
        samples.append(case.values(study, "K_error", method))
    error = Mean.of(np.concatenate(samples))
    comparison = Comparison("", error, case.within)
    return case.compare("error of K over all trials [%]", [comparison])
