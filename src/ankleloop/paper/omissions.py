"""What each step of the processing is good for: results without it beside those of the complete processing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ankleloop.methods.moesp import OMITTED_STEPS, describe_omission
from ankleloop.paper.results import join_scores
from ankleloop.paper.trial_counts import count_outcomes
from ankleloop.signals.vaf import confidence_margin

COMPLETE = "none"  # label of what the complete processing leaves out
FILTER = "anti-aliasing filter"
STEP_LABELS = {
    "kernel-derivatives": "derivatives of the kernel",
    "early-nonlinearity": "nonlinearity before decimation",
    "rank-policy": "rank policy",
    "scaling": "scaling of the channels",
    "mean-removal": "removal of means",
}
SEPARATOR = "-without-"  # in the name of a method: method, step
SCORES = ["vaf_net_measured", "vaf_intrinsic_true", "vaf_reflex_true"]
COLUMNS = [*SCORES, "K", "B", "I", "spectral_radius", "pole_error"]


class _Omission(NamedTuple):
    """A method without a step: where it is in the results, and where the same method is with all steps."""

    condition: str
    method: str
    step: str
    place: tuple[str, str]
    complete: tuple[str, str]


def tabulate_omissions(
    parameters: pd.DataFrame, scores: pd.DataFrame, points: Mapping[str, Mapping[str, Any]], labels: Mapping[str, str]
) -> pd.DataFrame:
    """Means over trials of each method with all steps of the processing and without each of them."""
    parameters = parameters.reindex(columns=list(dict.fromkeys([*parameters, "pole_error", "failure", "warnings"])))
    parameters = parameters.assign(warnings=_remove_omissions(parameters["warnings"].fillna("")))
    table = join_scores(parameters[parameters["failure"].isna()], scores)
    keys = [table["point"], table["method"]]
    results = {place: rows.set_index("trial")[COLUMNS].astype(float) for place, rows in table.groupby(keys)}
    counts = count_outcomes(parameters, ["point", "method"]).set_index(["point", "method"])
    nothing = pd.DataFrame(columns=COLUMNS, dtype=float)
    rows = []
    for omission in _list_omissions(points, labels):
        values, complete = (results.get(place, nothing) for place in (omission.place, omission.complete))
        row: dict[str, Any] = {"condition": omission.condition, "method": labels[omission.method]}
        row["omitted_step"] = omission.step
        row |= _summarise(values, complete, paired=omission.place[0] == omission.complete[0])
        rows.append(row | counts.loc[omission.place].to_dict())
    return pd.DataFrame(rows)


def _list_omissions(points: Mapping[str, Mapping[str, Any]], labels: Mapping[str, str]) -> Iterator[_Omission]:
    """Methods with all steps and without each, by condition, method and step."""
    filtered = {_condition(settings): point for point, settings in points.items() if settings["antialias_cutoff"]}
    unfiltered = {_condition(settings): point for point, settings in points.items() if not settings["antialias_cutoff"]}
    for condition, point in filtered.items():
        for method in labels:
            if SEPARATOR in method:
                continue
            complete = point, method
            yield _Omission(condition, method, COMPLETE, complete, complete)
            if condition in unfiltered:
                yield _Omission(condition, method, FILTER, (unfiltered[condition], method), complete)
            for step in OMITTED_STEPS:
                name = f"{method}{SEPARATOR}{step}"
                if name in labels:
                    yield _Omission(condition, method, STEP_LABELS[step], (point, name), complete)


def _condition(settings: Mapping[str, Any]) -> str:
    return "without noise" if settings["snr_db"] is None and settings["voluntary"] == 0 else "with noise"


def _summarise(values: pd.DataFrame, complete: pd.DataFrame, *, paired: bool) -> dict[str, float]:
    """Means and costs of all columns, with their margins."""
    differences = (values - complete).dropna()
    row: dict[str, float] = {}
    for name in COLUMNS:
        mean, margin = _estimate_mean(values[name])
        row |= {f"{name}_mean": mean, f"{name}_margin": margin}
        if paired:
            cost, cost_margin = _estimate_mean(differences[name])
        else:
            reference, reference_margin = _estimate_mean(complete[name])
            cost, cost_margin = mean - reference, float(np.hypot(margin, reference_margin))
        row |= {f"{name}_cost": cost, f"{name}_cost_margin": cost_margin}
    return row


def _estimate_mean(values: pd.Series) -> tuple[float, float]:
    """Mean and half of its 95 % interval."""
    return float(values.mean()), float(confidence_margin(values.std(), values.count()))


def _remove_omissions(warnings: pd.Series) -> pd.Series:
    """Warnings without those that say which step is left out."""
    for step in OMITTED_STEPS:
        warnings = warnings.str.replace(describe_omission(step), "", regex=False)
    return warnings
