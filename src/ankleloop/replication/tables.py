"""Tables: our results beside the published ones, as CSV for programs and as Markdown for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from ankleloop.records.files import atomic_file
from ankleloop.replication.trial_counts import COUNTS, count_outcomes, summarise_scores

__all__ = ["compare_with_bound", "compare_with_published", "format_number", "format_table", "write_table"]


def compare_with_published(
    scores: pd.DataFrame, parameters: pd.DataFrame, published: pd.DataFrame, by: Sequence[str]
) -> pd.DataFrame:
    """Mean and standard deviation over trials beside the published numbers.

    Parameters
    ----------
    scores : pandas.DataFrame
        Tables of `evaluate` with columns `method` and those of `by`.
    parameters : pandas.DataFrame
        One row for each trial and method: columns `method`, `trial` and those of `by`, and where there are any
        `failure` and `warnings`.
    published : pandas.DataFrame
        Columns `method`, `torque`, `against`, `paper`.
    by : sequence of str
        Columns whose values make a point.

    Returns
    -------
    pandas.DataFrame
        Columns `by`, `method`, `torque`, `against`, `paper` (empty where the paper has no such number), `mean`, `sd`,
        `n`, the number of trials in the mean, and `trials`, `failures` and `warnings` of
        `ankleloop.replication.trial_counts.count_outcomes`; and where there is a single trial of each, `low` and
        `high`, the 95 % interval of its VAF.

    Examples
    --------
    >>> parameters = pd.DataFrame({"method": "m", "trial": [0, 1, 2], "failure": [None, None, "no pole"]})
    >>> scores = pd.DataFrame({"method": "m", "torque": "net", "against": "true", "vaf": [90.0, 92.0]})
    >>> published = pd.DataFrame({"method": ["m"], "torque": ["net"], "against": ["true"], "paper": [93.0]})
    >>> table = compare_with_published(scores, parameters, published, [])
    >>> table[["paper", "mean", "n", "trials", "failures"]].values.tolist()
    [[93.0, 91.0, 2.0, 3.0, 1.0]]
    """
    keys = ["method", "torque", "against"]
    table = summarise_scores(scores, parameters, [*by, *keys]).merge(published, how="left", on=keys)
    columns = [*by, *keys, "paper", "mean", "sd", "n", *COUNTS]
    if "low" in scores and (table["n"] == 1).all():  # one record each: no spread over trials, but an interval
        table = table.merge(scores[[*by, *keys, "low", "high"]], on=[*by, *keys])
        columns += ["low", "high"]
    return table[columns]


def compare_with_bound(
    details: pd.DataFrame,
    truths: Mapping[str, Mapping[str, float]],
    bounds: Mapping[tuple[str, str], Mapping[str, float]],
) -> pd.DataFrame:
    """Errors of estimated parameters over trials, beside the Cramér-Rao bound.

    Parameters
    ----------
    details : pandas.DataFrame
        Rows of `ankleloop.assessment.scores.parameter_row` with columns `point` and `method`.
    truths : dict of str to dict of str to float
        For each point the true parameters.
    bounds : dict of tuple to dict of str to float
        For each point and method the smallest standard deviation of each of them.

    Returns
    -------
    pandas.DataFrame
        One row for each point, method and parameter that the method estimates: `truth`, `mean`, `bias`, `sd`, `rmse`,
        `n` (trials with this parameter), `bound`, `ratio` (rmse over bound), `covered`, the share [%] of 95 % intervals
        that hold the truth, where there are intervals, and `trials`, `failures` and `warnings` of
        `ankleloop.replication.trial_counts.count_outcomes`. Where every trial failed, the row has no numbers.

    Examples
    --------
    >>> details = pd.DataFrame({"point": "p", "method": "m", "trial": [0, 1], "K": [149.0, 151.0]})
    >>> details = details.assign(K_low=150.5, K_high=153.0)
    >>> row = compare_with_bound(details, {"p": {"K": 150.0}}, {("p", "m"): {"K": 0.5}}).iloc[0]
    >>> float(row["rmse"]), float(row["ratio"]), float(row["covered"])
    (1.0, 2.0, 0.0)
    """
    counts = count_outcomes(details, ["point", "method"]).set_index(["point", "method"])
    names = [name for name in dict.fromkeys(chain.from_iterable(truths.values())) if name in details]
    estimated = details[names].notna().groupby(details["method"]).any()  # at some point
    has_estimates = estimated.any(axis=1)
    # A method that failed in every trial has a row for each parameter that all others have.
    estimated.loc[~has_estimates] = estimated[has_estimates].all().to_numpy()
    rows = []
    for (point, method), part in details.groupby(["point", "method"], sort=False):
        for name, truth in truths[point].items():
            if name in estimated and estimated.loc[method, name]:
                row = {"point": point, "method": method, "parameter": name, "truth": truth}
                row |= _summarise_errors(part[name].dropna().to_numpy(), truth, bounds[point, method].get(name, np.nan))
                rows.append(row | {"covered": _coverage(part, name, truth), **counts.loc[(point, method)].to_dict()})
    return pd.DataFrame(rows)


def _summarise_errors(values: np.ndarray, truth: float, bound: float) -> dict[str, float]:
    """Errors over trials and their size over the bound; empty where no trial has the parameter."""
    if not values.size:
        return {**dict.fromkeys(("mean", "bias", "sd", "rmse"), np.nan), "n": 0, "bound": bound, "ratio": np.nan}
    rmse = float(np.sqrt(np.mean((values - truth) ** 2)))
    deviation = np.std(values, ddof=1) if values.size > 1 else np.nan
    row = {"mean": values.mean(), "bias": values.mean() - truth, "sd": deviation, "rmse": rmse, "n": values.size}
    return row | {"bound": bound, "ratio": rmse / bound if bound > 0 else np.nan}


def _coverage(part: pd.DataFrame, name: str, truth: float) -> float:
    """Share of the intervals that hold the truth [%]."""
    ends = [f"{name}_low", f"{name}_high"]
    intervals = part[ends].dropna() if set(ends) <= set(part) else pd.DataFrame()
    if intervals.empty:
        return np.nan
    return float(100.0 * ((intervals[ends[0]] <= truth) & (truth <= intervals[ends[1]])).mean())


def format_number(value: float, spec: str) -> str:
    """A number in a table for people; a dash if it does not exist.

    Parameters
    ----------
    value : float
        The number, or nan.
    spec : str
        Format specification.

    Returns
    -------
    str

    Examples
    --------
    >>> format_number(91.25, "+.1f"), format_number(np.nan, ".1f")
    ('+91.2', '–')
    """
    return "–" if pd.isna(value) else f"{value:{spec}}"


def format_table(table: pd.DataFrame, labels: Mapping[str, str], decimals: int = 1) -> pd.DataFrame:
    """A table as people read it: labels for methods, mean ± sd, difference to the paper, numbers of trials.

    Parameters
    ----------
    table : pandas.DataFrame
        A table of `compare_with_published`.
    labels : dict of str to str
        Label of each method.
    decimals : int
        Decimals of VAF.

    Returns
    -------
    pandas.DataFrame
        All cells are text; a dash stands for a number that does not exist.
    """
    spec = f".{decimals}f"
    numbers = [name for name in ("paper", "mean", "sd", "n", *COUNTS, "low", "high") if name in table]
    cells = table.drop(columns=numbers).assign(method=table["method"].map(labels))
    settings = cells.select_dtypes("number").columns
    cells[settings] = cells[settings].map("{:g}".format).astype(object)
    cells["paper [%]"] = [format_number(value, spec) for value in table["paper"]]
    if "low" in table:
        cells["ours [%], 95 % interval"] = [
            f"{format_number(row.mean, spec)} ({format_number(row.low, spec)} … {format_number(row.high, spec)})"
            for row in table.itertuples()
        ]
    else:
        cells["ours [%], mean ± sd"] = [
            format_number(mean, spec) + (f" ± {sd:.{decimals + 1}f}" if pd.notna(sd) else "")
            for mean, sd in zip(table["mean"], table["sd"], strict=True)
        ]
    cells["difference [points]"] = [format_number(value, f"+{spec}") for value in table["mean"] - table["paper"]]
    return cells.assign(**{name: table[name].astype(str) for name in COUNTS})


def write_table(
    table: pd.DataFrame,
    stem: str | PathLike[str],
    shown: pd.DataFrame | None = None,
    caption: str = "",
    *,
    overwrite: bool = False,
) -> None:
    """Write a table as CSV, and as Markdown with its caption.

    Parameters
    ----------
    table : pandas.DataFrame
        Content of the CSV.
    stem : path-like
        Path without its ending.
    shown : pandas.DataFrame, optional
        Content of the Markdown; the table itself by default.
    caption : str
        Text below the Markdown table.
    overwrite : bool
        Whether to replace files of these names; without it existing files are refused.

    Raises
    ------
    DataError
        If a file exists, or cannot be written.
    """
    stem = Path(stem)
    with atomic_file(stem.with_name(stem.name + ".csv"), overwrite=overwrite) as path:
        table.to_csv(path, index=False)
    with atomic_file(stem.with_name(stem.name + ".md"), overwrite=overwrite) as path:
        page = (table if shown is None else shown).to_markdown(index=False)
        path.write_text(f"{page}\n\n{caption}\n", encoding="utf-8")
