"""Trials of a study: their true values, what came of each, and summaries that say what they leave out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

RATE = 100.0  # Hz, of the identification by default
MOST_REASONS = 5  # of failures that a sentence each is about
NUMBER = r"\d[\d.]*(?:e[+-]?\d+)?"  # in a reason
COUNTS = [
    "trials",
    "failures",
    "warnings",
    "without G",
]  # columns of every table of means over trials
KEYS = ["point", "method", "trial"]  # of an estimate
# Simulation setting that is the true value of each estimated parameter.
SETTINGS = {"K": "stiffness", "B": "viscosity", "I": "inertia", "G": "reflex_gain"}
SETTINGS |= {name: name for name in ("omega_n", "zeta", "delay")}
CONDITIONS: dict[str, dict[Any, str]] = {
    "closed_loop": {True: "closed loop", False: "open loop"},
    "perturbation": {"prbs": "PRBS", "pulses": "decorrelating pulses", "dwells": "random dwells"},
}


def true_values(
    settings: Mapping[str, Any], names: Iterable[str] = tuple(SETTINGS)
) -> dict[str, float]:
    """True values of the parameters that are estimated from simulated trials."""
    return {name: settings[SETTINGS[name]] for name in names}


def true_spectral_radius(settings: Mapping[str, Any], rate: float = RATE) -> float:
    """Magnitude of the largest pole of the simulated reflex low-pass at the rate of the identification [Hz]."""
    poles = np.roots([1.0, 2.0 * settings["zeta"] * settings["omega_n"], settings["omega_n"] ** 2])
    slowest = max([*poles.real, -settings["pole"]] if settings.get("pole") else poles.real)
    return float(np.exp(slowest / rate))


def describe_condition(name: str, value: Any) -> str:
    """Experimental condition in words."""
    return CONDITIONS.get(name, {}).get(value, f"{name} {value}")


def list_faults(parameters: pd.DataFrame) -> pd.DataFrame:
    """Whether each identification failed, and whether its estimate came with a warning; such an estimate counts."""
    table = parameters.reindex(columns=["failure", "warnings"])
    failure, warnings = table["failure"].notna(), table["warnings"]
    return pd.DataFrame(
        {"failures": failure, "warnings": warnings.notna() & (warnings != "") & ~failure}
    )


def list_outcomes(parameters: pd.DataFrame) -> pd.Series:
    """What came of each identification, for marks in figures."""
    faults = list_faults(parameters)
    outcomes = pd.Series("estimate", parameters.index)
    return outcomes.mask(faults["warnings"], "warning").mask(faults["failures"], "failure")


def mark_faults(table: pd.DataFrame) -> pd.Series:
    """Whether trials of a mean failed or came with a warning, for marks in figures."""
    return table[["failures", "warnings"]].gt(0).any(axis=1)


def count_outcomes(parameters: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Count the trials that a mean is over, those that it leaves out, and those with a warning, which it counts.

    A trial that several methods identify is one trial: it failed where one of them failed.
    """
    keys = list(dict.fromkeys([*by, "point", "trial"]))
    faults = parameters[keys].assign(**list_faults(parameters))
    gains = parameters["G"] if "G" in parameters else pd.Series(0.0, parameters.index)
    faults["without G"] = gains.isna() & ~faults["failures"]
    trials = faults.groupby(keys, sort=False, dropna=False).any().reset_index().assign(trials=1)
    return trials.groupby(list(by), sort=False, dropna=False)[COUNTS].sum().reset_index()


def summarise_scores(table: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Mean and standard deviation of each VAF over trials, a row for each torque, with what the mean leaves out."""
    scores = table.set_index(list(by)).filter(regex="^vaf_")
    scores.columns = pd.MultiIndex.from_tuples(
        [name.split("_")[1:] for name in scores], names=["torque", "against"]
    )
    groups = scores.stack(["torque", "against"]).groupby(
        level=[*by, "torque", "against"], sort=False
    )
    summary = groups.agg(mean="mean", sd="std", n="count").reset_index()
    return summary.merge(count_outcomes(table, by), on=list(by))


def summarise_columns(table: pd.DataFrame, by: Sequence[str], names: Sequence[str]) -> pd.DataFrame:
    """Means, standard deviations and numbers of values of columns over trials, with what the means leave out."""
    summary = table.groupby(list(by), sort=False)[list(names)].agg(["mean", "std", "count"])
    summary.columns = pd.Index([f"{name}_{statistic}" for name, statistic in summary.columns])
    return summary.reset_index().merge(count_outcomes(table, by), how="left", on=list(by))


def describe_failures(parameters: pd.DataFrame) -> str:
    """Say how many identifications failed, and why; means leave them out."""
    failed = (
        parameters.reindex(columns=["point", "method", "failure"])
        .dropna(subset="failure")
        .astype(str)
    )
    if failed.empty:
        return ""
    groups = failed.groupby(failed["failure"].str.replace(NUMBER, "#", regex=True), sort=False)
    examples = (
        groups.first()
        .assign(count=groups.size())
        .sort_values("count", ascending=False, kind="stable")
    )
    parts = [f"{len(failed):,} of {len(parameters):,} identifications failed; means leave them out"]
    for row in examples.head(MOST_REASONS).itertuples():
        parts.append(
            f"{row.count:,} of them, such as {row.method} at {row.point}: {row.failure.rstrip('.')}"
        )
    return ". ".join(parts)


def describe_faults(parameters: pd.DataFrame, labels: Mapping[str, str]) -> str:
    """How many identifications failed, and how many estimates came with a warning, for each method that has any."""
    counts = list_faults(parameters).groupby(parameters["method"], sort=False).sum()
    texts = []
    for name, words in (("failures", "without an estimate"), ("warnings", "with a warning")):
        methods = counts.loc[counts[name] > 0, name]
        parts = ", ".join(
            f"{labels.get(method, method)} {count}" for method, count in methods.items()
        )
        texts.append(
            f"{words}: {methods.sum()} of {len(parameters)}" + (f" ({parts})" if parts else "")
        )
    rings = " In figures they have rings." if counts.to_numpy().any() else ""
    return f"Identifications {'; '.join(texts)}.{rings}"
