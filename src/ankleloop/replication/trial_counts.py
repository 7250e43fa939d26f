"""How many trials a mean is over: those simulated, those that failed, those whose estimate came with a warning."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import pandas as pd

from ankleloop.assessment.scores import summarise

__all__ = [
    "COUNTS",
    "count_outcomes",
    "count_trials",
    "describe_absence",
    "describe_counts",
    "describe_failures",
    "describe_faults",
    "describe_warnings",
    "list_faults",
    "list_outcomes",
    "mark_faults",
    "summarise_scores",
]

MOST_REASONS = 5  # of failures that a sentence each is about
NUMBER = r"\d[\d.]*(?:e[+-]?\d+)?"  # in a reason
COUNTS = ["trials", "failures", "warnings", "without G"]  # columns of every table of means over trials


def list_faults(parameters: pd.DataFrame) -> pd.DataFrame:
    """Whether each identification failed, and whether its estimate came with a warning; such an estimate counts.

    Parameters
    ----------
    parameters : pandas.DataFrame
        One row for each trial and method: `failure` and `warnings` where there are any.

    Returns
    -------
    pandas.DataFrame
        Columns `failures` and `warnings` of bool.

    Examples
    --------
    >>> list_faults(pd.DataFrame({"failure": ["no pole", None], "warnings": [None, "a pole"]})).to_numpy().tolist()
    [[True, False], [False, True]]
    """
    table = parameters.reindex(columns=["failure", "warnings"])
    failure, texts = table["failure"].notna(), table["warnings"].astype("category")  # few texts, many rows
    empty = [text for text in texts.cat.categories if not str(text).strip()]
    return pd.DataFrame({"failures": failure, "warnings": texts.notna() & ~texts.isin(empty) & ~failure})


def list_outcomes(parameters: pd.DataFrame) -> pd.Series:
    """What came of each identification, for marks in figures.

    Parameters
    ----------
    parameters : pandas.DataFrame
        One row for each trial and method: `failure` and `warnings` where there are any.

    Returns
    -------
    pandas.Series of str
        "failure", "warning" (an estimate with a warning) or "estimate".

    Examples
    --------
    >>> list_outcomes(pd.DataFrame({"failure": ["no pole", None, None], "warnings": [None, "a pole", " "]})).tolist()
    ['failure', 'warning', 'estimate']
    """
    faults = list_faults(parameters)
    outcomes = pd.Series("estimate", parameters.index)
    return outcomes.mask(faults["warnings"], "warning").mask(faults["failures"], "failure")


def mark_faults(table: pd.DataFrame) -> pd.Series:
    """Whether trials of a mean failed or came with a warning, for marks in figures.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns `failures` and `warnings` of `count_outcomes`.

    Returns
    -------
    pandas.Series of bool

    Examples
    --------
    >>> mark_faults(pd.DataFrame({"trials": 5, "failures": [1, 0, 0], "warnings": [0, 2, 0]})).tolist()
    [True, True, False]
    """
    return table[["failures", "warnings"]].gt(0).any(axis=1)


def count_outcomes(parameters: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Count the trials that a mean is over, those that it leaves out, and those with a warning, which it counts.

    A trial that several methods identify is one trial: it failed where one of them failed.

    Parameters
    ----------
    parameters : pandas.DataFrame
        One row for each trial and method: `trial` (without it every row is a trial), mostly `point` and `method`, and
        where there are any `failure` and `warnings`.
    by : sequence of str
        Columns whose values make a row, in the order of their first appearance.

    Returns
    -------
    pandas.DataFrame
        Columns `by`, `trials` (all of them), `failures` (trials without an estimate: no mean holds them), `warnings`
        (trials whose estimate came with a warning: means hold them like the others) and `without G` (trials whose
        estimate has no reflex gain, since its reflex path is no ramp with a low-pass behind it).

    Examples
    --------
    >>> table = pd.DataFrame({"method": "riv", "trial": [0, 1, 2], "failure": ["no pole", None, None]})
    >>> count_outcomes(table.assign(warnings=[None, "a pole", None]), ["method"]).to_dict("records")
    [{'method': 'riv', 'trials': 3, 'failures': 1, 'warnings': 1, 'without G': 0}]
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
    """Mean and standard deviation of the VAF over trials, with what the mean leaves out.

    Parameters
    ----------
    scores : pandas.DataFrame
        One row for each score: columns of `by`, and `vaf` [%].
    parameters : pandas.DataFrame
        One row for each trial and method, as `count_outcomes` takes it.
    by : sequence of str
        Columns whose values make a row: those of the parameters first, then those that the scores alone have (`torque`,
        `against`).

    Returns
    -------
    pandas.DataFrame
        Columns `by`, `mean`, `sd` (of the sample; empty for a single trial), `n` (trials in the mean), `trials`,
        `failures`, `warnings` and `without G`. Where every trial failed there is a row for each score of the others,
        without a mean.

    Examples
    --------
    >>> parameters = pd.DataFrame({"method": ["a", "b"], "trial": 0, "failure": [None, "no pole"]})
    >>> scores = pd.DataFrame({"method": ["a"], "trial": 0, "torque": "net", "vaf": [90.0]})
    >>> table = summarise_scores(scores, parameters, ["method", "torque"])
    >>> table[["method", "torque", "n", "trials", "failures"]].values.tolist()
    [['a', 'net', 1, 1, 0], ['b', 'net', 0, 1, 1]]
    """
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


def describe_absence(shown: Collection[str], wanted: Collection[str]) -> str:
    """What a figure of a single trial lacks because its identification failed.

    Parameters
    ----------
    shown, wanted : collection of str
        Methods or conditions that the figure shows, and that it would show if nothing had failed.

    Returns
    -------
    str
        A sentence with a space in front of it, for the end of a caption; empty if nothing lacks.

    Raises
    ------
    ValueError
        If nothing is shown.

    Examples
    --------
    >>> describe_absence(["riv"], ["riv", "PR-MOESP"])
    ' The identification of this trial failed for: PR-MOESP.'
    """
    if not shown:
        raise ValueError(
            "the trial that the figure shows could not be identified: set another number as figure: trial in the "
            "configuration of the study."
        )
    missing = [name for name in wanted if name not in shown]
    return f" The identification of this trial failed for: {'; '.join(missing)}." if missing else ""


def describe_failures(parameters: pd.DataFrame) -> str:
    """Say how many identifications failed, and why; means leave them out.

    Parameters
    ----------
    parameters : pandas.DataFrame
        One row for each estimate: columns `point`, `method`, `trial`, and `failure` where any failed.

    Returns
    -------
    str
        How many, and an example of each of the five most frequent reasons; empty if none failed. Reasons that differ in
        numbers alone are one.

    Examples
    --------
    >>> key = {"point": "only", "method": "riv", "trial": [0, 1, 2]}
    >>> describe_failures(pd.DataFrame(key | {"failure": [None, "Singular matrix", None]}))
    '1 of 3 identifications failed; means leave them out. 1 of them, such as riv at only: Singular matrix'
    """
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


def describe_warnings(parameters: pd.DataFrame, labels: Mapping[str, str] | None = None) -> str:
    """How many estimates came with a warning, and how many identifications failed.

    Parameters
    ----------
    parameters : pandas.DataFrame
        One row for each trial and method: `method`, and `warnings` and `failure` where there are any.
    labels : dict of str to str, optional
        Readable names of the methods; without them the methods are not listed.

    Returns
    -------
    str
        The first half of a sentence.

    Examples
    --------
    >>> table = pd.DataFrame({"method": ["riv", "riv", "pr-moesp"], "warnings": ["a pole", None, None]})
    >>> describe_warnings(table, {"riv": "RIV"})
    '1 of 3 estimates came with a warning (RIV 1) and counts like the others'
    >>> describe_warnings(table.tail(2))
    'none of 2 estimates came with a warning'
    """
    counts = list_faults(parameters).groupby(parameters["method"], sort=False).sum()
    failures, warnings = (int(counts[name].sum()) for name in ("failures", "warnings"))
    estimates = len(parameters) - failures
    words = "identification failed and is" if failures == 1 else "identifications failed and are"
    end = f"; {failures} {words} left out{_list_methods(counts['failures'], labels)}" if failures else ""
    if not warnings:
        return f"none of {estimates} estimates came with a warning{end}"
    details = _list_methods(counts["warnings"], labels)
    verb = "counts" if warnings == 1 else "count"
    return f"{warnings} of {estimates} estimates came with a warning{details} and {verb} like the others{end}"


def _list_methods(counts: pd.Series, labels: Mapping[str, str] | None) -> str:
    """Numbers of the methods that have any, in brackets."""
    if not labels:
        return ""
    return f" ({', '.join(f'{labels.get(name, name)} {count}' for name, count in counts[counts > 0].items())})"


def describe_counts(parameters: pd.DataFrame, labels: Mapping[str, str] | None = None) -> str:
    """What the columns `trials`, `failures` and `warnings` of a table are, and their numbers in the whole study.

    Parameters
    ----------
    parameters : pandas.DataFrame
        One row for each trial and method, as `describe_warnings` takes it.
    labels : dict of str to str, optional
        Readable names of the methods; without them the methods are not listed.

    Returns
    -------
    str
        Two sentences, for the end of a caption.

    Examples
    --------
    >>> describe_counts(pd.DataFrame({"method": ["riv"], "trial": 0})).split(". ")[2]
    'In this study, none of 1 estimates came with a warning.'
    """
    return (
        "Failures are trials without an estimate, warnings are trials whose estimate came with a warning. Means leave "
        "out the failed trials and include those with a warning; those of G, ωn and ζ leave out the trials without G, "
        "whose reflex path is no ramp with a low-pass behind it. "
        f"In this study, {describe_warnings(parameters, labels)}."
    )


def describe_faults(parameters: pd.DataFrame) -> str:
    """What a ring around a symbol of a figure says; nothing where no symbol has one.

    Parameters
    ----------
    parameters : pandas.DataFrame
        One row for each trial and method that the figure shows.

    Returns
    -------
    str
        A sentence with a space in front of it, for the end of a caption.

    Examples
    --------
    >>> describe_faults(pd.DataFrame({"failure": [None, "no pole"]}))
    ' Rings mark means of which a trial failed, which leave it out, or came with a warning, which hold it.'
    >>> describe_faults(pd.DataFrame({"failure": [None, None]}))
    ''
    """
    if not list_faults(parameters).any(axis=None):
        return ""
    return " Rings mark means of which a trial failed, which leave it out, or came with a warning, which hold it."
