"""Trials of a study: their true values, their conditions in words, and why some of them failed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from ankleloop.quantities import POINT, SETTINGS
from ankleloop_workflow.tables.means import FAULT_SHARE, list_faults

NUMBER = r"[+-]?\d[\d.]*(?:e[+-]?\d+)?"  # in a reason
Settings = Mapping[str, Any]  # of the simulation, by name
Points = Mapping[str, Settings]  # of a study, by name
Labels = Mapping[str, str]  # of methods, by name

CONDITIONS: dict[str, dict[Any, str]] = {
    "closed_loop": {True: "closed loop", False: "open loop"},
    "perturbation": {"prbs": "PRBS", "pulses": "decorrelating pulses", "dwells": "random dwells"},
}


def true_values(settings: Settings, names: Iterable[str] = tuple(SETTINGS)) -> dict[str, float]:
    """True values of the parameters that are estimated from simulated trials."""
    return {name: settings[SETTINGS[name]] for name in names}


def describe_condition(name: str, value: Any) -> str:
    """Experimental condition in words."""
    name = name.removeprefix(POINT)
    return CONDITIONS.get(name, {}).get(value, f"{name.replace('_', ' ')} {value}")


def list_reasons(parameters: pd.DataFrame) -> pd.DataFrame:
    """Why identifications failed or came with a warning: a row for each method and reason, the most frequent first.

    Reasons that differ in numbers alone are one; `point` and `reason` are those of the first one.
    """
    keys = ["point", "method"]
    texts = parameters.reindex(columns=[*keys, "failure", "warnings"])
    texts = texts.rename(columns={"warnings": "warning"})
    texts = texts.melt(keys, var_name="outcome", value_name="reason")
    texts = texts.dropna(subset="reason").astype(str)
    pattern = texts["reason"].str.replace(NUMBER, "#", regex=True)
    groups = texts.groupby(["outcome", "method", pattern], sort=False)
    reasons = groups.head(1).assign(identifications=groups["point"].transform("size"))
    return reasons.sort_values("identifications", ascending=False, kind="stable")


def describe_failures(parameters: pd.DataFrame) -> str:
    """Say how many identifications failed, and the most frequent reason; means leave them out."""
    failed = parameters.dropna(subset="failure")
    if failed.empty:
        return ""
    counts = f"{len(failed):,} of {len(parameters):,} identifications failed"
    reason = list_reasons(failed)["reason"].iloc[0]
    return f"{counts}; means leave them out. Most often: {reason}"


def count_faults(parameters: pd.DataFrame) -> str:
    """Say how many identifications failed, how many came with a warning, and where a reader finds them."""
    failed, warned = list_faults(parameters).sum()
    counts = f"{failed:,} failed and {warned:,} came with a warning"
    return (
        f"Of {len(parameters):,} identifications {counts}: see the end of this page. A ring in a figure marks a mean "
        f"of which at least {100 * FAULT_SHARE:g} % did, on a curve as many more than at its median point."
    )
