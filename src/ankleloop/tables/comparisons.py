"""Tables over trials: numbers beside the published ones and a bound, steps left out, as CSV and for people."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.methods.moesp import OMITTED_STEPS, describe_omission
from ankleloop.signals.vaf import confidence_margin
from ankleloop.tables.means import COUNTS, count_outcomes, mean_scores, measure_statistics
from ankleloop.trials.files import atomic_file, write_csv

COMPLETE = "none"  # label of what the complete processing leaves out
FILTER = "anti-aliasing filter"
SEPARATOR = "-without-"  # in the name of a method: method, step
COLUMNS = [
    "vaf_net_measured",
    "vaf_intrinsic_true",
    "vaf_reflex_true",
    "K",
    "B",
    "I",
    "spectral_radius",
    "pole_error",
]


def format_number(value: float, spec: str = ".4g", margin: float = np.nan) -> str:
    """A value, with ± half of its 95 % interval where there is one; a dash where there is no value."""
    if pd.isna(value):
        return "–"
    return f"{value:{spec}}" + ("" if pd.isna(margin) else f" ± {margin:.2g}")


def format_pairs(
    first: Iterable[float], second: Iterable[float], template: str = "{:.1f} ± {:.1f}"
) -> list[str]:
    """Pairs of numbers as text, such as means with standard deviations, or the ends of intervals."""
    pairs = zip(first, second, strict=True)
    return [
        "–" if pd.isna(pair[0]) else template.format(*pair).replace("nan", "–") for pair in pairs
    ]


def format_columns(table: pd.DataFrame, names: Iterable[str], template: str) -> pd.DataFrame:
    """Columns of numbers as text."""
    return table.assign(
        **{name: format_pairs(table[name], table[name], template) for name in names}
    )


def format_means(
    summary: pd.DataFrame,
    name: str,
    template: str = "{:.1f} ± {:.1f}",
    *,
    truth: pd.Series | None = None,
) -> list[str]:
    """Means over trials ± half of their 95 % intervals; as errors in percent where true values are given."""
    means = summary[f"{name}_mean"]
    margins = pd.Series(
        confidence_margin(summary[f"{name}_std"], summary[f"{name}_count"]), summary.index
    )
    if truth is not None:
        means, margins = 100.0 * (means / truth - 1.0), 100.0 * margins / truth
    return format_pairs(means, margins, template)


def compare_with_published(
    details: pd.DataFrame, published: pd.DataFrame, by: Sequence[str]
) -> pd.DataFrame:
    """Mean and standard deviation over trials beside the published numbers."""
    keys = ["method", "torque", "against"]
    table = mean_scores(details, [*by, "method"]).merge(published, how="left", on=keys)
    return table[[*by, *keys, "paper", "mean", "sd", "n", *COUNTS]]


def format_table(table: pd.DataFrame, labels: Mapping[str, str]) -> pd.DataFrame:
    """A table as people read it: labels for methods, mean ± half its 95 % interval, difference to the paper, counts."""
    numbers = [
        name for name in ("paper", "mean", "sd", "n", *COUNTS, "low", "high") if name in table
    ]
    cells = table.drop(columns=numbers).assign(method=table["method"].map(labels))
    settings = cells.select_dtypes("number").columns
    cells[settings] = cells[settings].map("{:g}".format).astype(object)
    cells["paper [%]"] = [format_number(value, ".0f") for value in table["paper"]]
    cells["ours [%]"] = format_pairs(
        table["mean"], confidence_margin(table["sd"], table["n"]), "{:.1f} ± {:.2f}"
    )
    cells["difference [points]"] = [
        format_number(value, "+.1f") for value in table["mean"] - table["paper"]
    ]
    return cells.assign(**{name: table[name].astype(str) for name in COUNTS})


def compare_with_bound(
    details: pd.DataFrame,
    truths: Mapping[str, Mapping[str, float]],
    bounds: Mapping[tuple[str, str], Mapping[str, float]],
) -> pd.DataFrame:
    """Errors of parameters over trials, their size over the Cramér-Rao bound, and intervals that hold the truth [%]."""
    rows, keys = [], ["point", "method"]
    for (point, method), part in details.groupby(keys, sort=False):
        estimated = details[details["method"] == method].dropna(
            axis="columns", how="all"
        )  # at some point
        for name in (name for name in truths[point] if name in estimated):
            truth, bound, values = (
                truths[point][name],
                bounds[point, method].get(name, np.nan),
                part[name].dropna(),
            )
            mean, rmse = values.mean(), float(np.sqrt(((values - truth) ** 2).mean()))
            ends = part.reindex(columns=[f"{name}_low", f"{name}_high"]).dropna().astype(float)
            is_covered = (ends[f"{name}_low"] <= truth) & (truth <= ends[f"{name}_high"])
            row = {"point": point, "method": method, "parameter": name, "truth": truth}
            row |= {
                "mean": mean,
                "bias": mean - truth,
                "sd": values.std(),
                "rmse": rmse,
                "n": len(values),
            }
            ratio = rmse / bound if bound > 0 else np.nan
            row |= {"bound": bound, "ratio": ratio, "covered": 100.0 * is_covered.mean()}
            rows.append(row)
    return pd.DataFrame(rows).merge(count_outcomes(details, keys), on=keys)


def tabulate_omissions(
    details: pd.DataFrame, points: Mapping[str, Mapping[str, Any]], labels: Mapping[str, str]
) -> pd.DataFrame:
    """Means over trials of each method with all steps of the processing and without each, with what that changes."""
    details = details.reindex(
        columns=list(dict.fromkeys([*details, *COLUMNS, "failure", "warnings"]))
    )
    for step in OMITTED_STEPS:  # a warning that says which step is left out
        details["warnings"] = (
            details["warnings"].fillna("").str.replace(describe_omission(step), "", regex=False)
        )
    details["warnings"] = details["warnings"].str.strip()
    counts = count_outcomes(details, ["point", "method"]).set_index(["point", "method"])
    results = {
        place: part.set_index("trial")[COLUMNS].astype(float)
        for place, part in details.groupby(["point", "method"])
    }
    conditions = _name_conditions(points)
    unfiltered = {
        _settings_but_filter(settings): point
        for point, settings in points.items()
        if not settings["antialias_cutoff"]
    }
    rows = []
    for point, condition in conditions.items():
        without_filter = unfiltered.get(_settings_but_filter(points[point]))
        for method in (name for name in labels if SEPARATOR not in name):
            places = {COMPLETE: (point, method), FILTER: (without_filter, method)}
            places |= {
                step.replace("-", " "): (point, f"{method}{SEPARATOR}{step}")
                for step in OMITTED_STEPS
            }
            for label, place in places.items():
                if place in results:
                    row = {"condition": condition, "method": labels[method], "omitted_step": label}
                    changes = _measure_changes(
                        results[place], results[point, method], paired=label != FILTER
                    )
                    rows.append({**row, **changes, **counts.loc[place]})
    return pd.DataFrame(rows)


def _name_conditions(points: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Condition of each point with an anti-aliasing filter, in words; with its name where two have the same words."""
    words = {
        point: "without noise" if _is_clean(settings) else "with noise"
        for point, settings in points.items()
        if settings["antialias_cutoff"]
    }
    counts = Counter(words.values())
    return {
        point: text if counts[text] == 1 else f"{text}, {point}" for point, text in words.items()
    }


def _is_clean(settings: Mapping[str, Any]) -> bool:
    return settings["snr_db"] is None and settings["voluntary"] == 0


def _settings_but_filter(settings: Mapping[str, Any]) -> str:
    return repr(sorted((k, v) for k, v in settings.items() if k != "antialias_cutoff"))


def _measure_changes(
    values: pd.DataFrame, complete: pd.DataFrame, *, paired: bool
) -> dict[str, float]:
    """Means of all columns and their changes ("cost"), with their margins; paired changes are of the same trials."""
    means, margins = _measure_means(values)
    if paired:
        costs, cost_margins = _measure_means((values - complete).dropna())
    else:
        complete_means, complete_margins = _measure_means(complete)
        costs = means - complete_means
        cost_margins = np.hypot(margins, complete_margins)
    numbers = {"mean": means, "margin": margins, "cost": costs, "cost_margin": cost_margins}
    return {
        f"{name}_{key}": float(column[name]) for name in COLUMNS for key, column in numbers.items()
    }


def _measure_means(values: pd.DataFrame) -> tuple[pd.Series, pd.Series]:
    """Means of all columns, and half of the 95 % interval of each."""
    rows = measure_statistics(values.assign(all=""), ["all"], COLUMNS).set_index("quantity")
    return rows["mean"], rows["margin"]


def write_table(table: pd.DataFrame, stem: str, shown: pd.DataFrame, caption: str) -> None:
    """Write a table as CSV, and what people read of it as Markdown with its caption; both replace former ones."""
    write_csv(table, f"{stem}.csv", overwrite=True)
    with atomic_file(f"{stem}.md", overwrite=True) as path:
        path.write_text(f"{shown.to_markdown(index=False)}\n\n{caption}\n", encoding="utf-8")
