"""How many trials a mean is over: those simulated, those that failed, those whose estimate came with a warning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

from ankleloop.assessment.scores import summarise

MOST_REASONS = 5  # of failures that a sentence each is about
NUMBER = r"\d[\d.]*(?:e[+-]?\d+)?"  # in a reason
COUNTS = ["trials", "failures", "warnings", "without G"]  # columns of every table of means over trials


def list_faults(parameters: pd.DataFrame) -> pd.DataFrame:
    """Whether each identification failed, and whether its estimate came with a warning; such an estimate counts."""
    table = parameters.reindex(columns=["failure", "warnings"])
    failure, texts = table["failure"].notna(), table["warnings"].astype("category")  # few texts, many rows
    empty = [text for text in texts.cat.categories if not str(text).strip()]
    return pd.DataFrame({"failures": failure, "warnings": texts.notna() & ~texts.isin(empty) & ~failure})


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
    by = list(by)
    if "trial" not in parameters:
        parameters = parameters.assign(trial=range(len(parameters)))
    trial = list(dict.fromkeys([*by, *(name for name in ("point", "trial") if name in parameters)]))
    faults = parameters[trial].assign(**list_faults(parameters))
    gains = parameters["G"] if "G" in parameters else pd.Series(0.0, parameters.index)
    faults["without G"] = gains.isna() & ~faults["failures"]
    trials = faults.groupby(trial, sort=False, dropna=False).any().reset_index().assign(trials=1)
    if not by:
        return trials[COUNTS].sum().astype(int).to_frame().T
    return trials.groupby(by, sort=False, dropna=False)[COUNTS].sum().reset_index()


def summarise_scores(scores: pd.DataFrame, parameters: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Mean and standard deviation of the VAF over trials, with what the mean leaves out."""
    by = list(by)
    shared = [name for name in by if name in parameters]
    own = [name for name in by if name not in parameters]
    summary = summarise(scores, by)
    counts = count_outcomes(parameters, shared)
    if not shared:
        return summary.merge(counts, how="cross")
    counts["place"] = range(len(counts))
    table = counts.merge(summary, on=shared)
    absent = counts[~counts["place"].isin(table["place"])]
    if own:
        absent = absent.merge(summary[own].drop_duplicates(), how="cross")
    if len(absent):
        table = pd.concat([table, absent.assign(n=0)]).sort_values("place", kind="stable", ignore_index=True)
    return table[[*by, "mean", "sd", "n", *COUNTS]]


def count_trials(parameters: pd.DataFrame) -> int:
    """Largest number of trials that a method has at a point."""
    return int(count_outcomes(parameters, ["point", "method"])["trials"].max())


def describe_failures(parameters: pd.DataFrame) -> str:
    """Say how many identifications failed, and why; means leave them out."""
    columns = ["point", "method", "failure"]
    failed = parameters.reindex(columns=columns).dropna(subset="failure").astype(str)
    if failed.empty:
        return ""
    groups = failed.groupby(failed["failure"].str.replace(NUMBER, "#", regex=True), sort=False)
    examples = groups.first().assign(count=groups.size()).sort_values("count", ascending=False, kind="stable")
    parts = [f"{len(failed):,} of {len(parameters):,} identifications failed; means leave them out"]
    for row in examples.head(MOST_REASONS).itertuples():
        parts.append(f"{row.count:,} of them, such as {row.method} at {row.point}: {row.failure.rstrip('.')}")
    if len(examples) > MOST_REASONS:
        parts.append(f"Other reasons are in the table of trials ({len(examples) - MOST_REASONS})")
    return ". ".join(parts)


def describe_warnings(parameters: pd.DataFrame, labels: Mapping[str, str]) -> str:
    """How many identifications failed, and how many estimates came with a warning, for each method that has any."""
    counts = list_faults(parameters).groupby(parameters["method"], sort=False).sum()
    texts = []
    for name, words in (("failures", "without an estimate"), ("warnings", "with a warning")):
        methods = counts.loc[counts[name] > 0, name]
        parts = ", ".join(f"{labels.get(method, method)} {count}" for method, count in methods.items())
        texts.append(f"{words}: {methods.sum()} of {len(parameters)}" + (f" ({parts})" if parts else ""))
    return f"Identifications {'; '.join(texts)}."


def describe_faults(parameters: pd.DataFrame) -> str:
    """What a ring around a symbol of a figure says; nothing where no symbol has one."""
    return (
        "Rings mark means of which a trial failed or came with a warning."
        if list_faults(parameters).any(axis=None)
        else ""
    )
