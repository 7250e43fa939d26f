"""Tables: our results beside the published ones, as CSV for programs and as Markdown for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from ankleloop.paper.results import format_pairs
from ankleloop.paper.trial_counts import COUNTS, count_outcomes, summarise_scores
from ankleloop.signals.vaf import confidence_margin
from ankleloop.trials.files import atomic_file, write_csv


def compare_with_published(
    scores: pd.DataFrame, parameters: pd.DataFrame, published: pd.DataFrame, by: Sequence[str]
) -> pd.DataFrame:
    """Mean and standard deviation over trials beside the published numbers."""
    keys = ["method", "torque", "against"]
    table = summarise_scores(scores, parameters, [*by, *keys]).merge(published, how="left", on=keys)
    return table[[*by, *keys, "paper", "mean", "sd", "n", *COUNTS]]


def compare_with_bound(
    details: pd.DataFrame,
    truths: Mapping[str, Mapping[str, float]],
    bounds: Mapping[tuple[str, str], Mapping[str, float]],
) -> pd.DataFrame:
    """Errors of estimated parameters over trials, beside the Cramér-Rao bound."""
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
    """A number in a table for people; a dash if it does not exist."""
    return "–" if pd.isna(value) else f"{value:{spec}}"


def format_means(
    summary: pd.DataFrame, name: str, template: str = "{:.1f} ± {:.1f}", *, truth: pd.Series | None = None
) -> list[str]:
    """Means over trials ± half of their 95 % intervals; as errors in percent where true values are given."""
    means = summary[f"{name}_mean"]
    margins = pd.Series(confidence_margin(summary[f"{name}_std"], summary[f"{name}_count"]), summary.index)
    if truth is not None:
        means, margins = 100.0 * (means / truth - 1.0), 100.0 * margins / truth
    return format_pairs(means, margins, template)


def format_table(table: pd.DataFrame, labels: Mapping[str, str]) -> pd.DataFrame:
    """A table as people read it: labels for methods, mean ± half its 95 % interval, difference to the paper, counts."""
    numbers = [name for name in ("paper", "mean", "sd", "n", *COUNTS, "low", "high") if name in table]
    cells = table.drop(columns=numbers).assign(method=table["method"].map(labels))
    settings = cells.select_dtypes("number").columns
    cells[settings] = cells[settings].map("{:g}".format).astype(object)
    cells["paper [%]"] = [format_number(value, ".0f") for value in table["paper"]]
    cells["ours [%]"] = format_pairs(table["mean"], confidence_margin(table["sd"], table["n"]), "{:.1f} ± {:.2f}")
    cells["difference [points]"] = [format_number(value, "+.1f") for value in table["mean"] - table["paper"]]
    return cells.assign(**{name: table[name].astype(str) for name in COUNTS})


def write_table(
    table: pd.DataFrame,
    stem: str | PathLike[str],
    shown: pd.DataFrame | None = None,
    caption: str = "",
    *,
    overwrite: bool = False,
) -> None:
    """Write a table as CSV, and as Markdown with its caption."""
    stem = Path(stem)
    write_csv(table, stem.with_name(stem.name + ".csv"), overwrite=overwrite)
    with atomic_file(stem.with_name(stem.name + ".md"), overwrite=overwrite) as path:
        page = (table if shown is None else shown).to_markdown(index=False)
        path.write_text(f"{page}\n\n{caption}\n", encoding="utf-8")
