"""Tables over trials: numbers beside the published ones and a bound, steps left out, as CSV and for people."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.methods.moesp import OMITTED_STEPS, describe_omission
from ankleloop.methods.registry import find_method
from ankleloop.signals.vaf import confidence_margin
from ankleloop.trials.files import atomic_file, write_csv
from ankleloop_workflow.tables.means import COUNTS, count_outcomes, mean_scores, measure_statistics
from ankleloop_workflow.tables.outcomes import Labels, Points

COMPLETE = "none"  # label of what the complete processing leaves out
FILTER = "anti-aliasing filter"
NO_INTERVAL = re.compile(r" (± nan|\(\+?nan … \+?nan\))")  # behind a value
NO_VALUE = re.compile(r"\+?\bnan\b")
OMISSION_COLUMNS = [
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
    text = f"{value:{spec}}"
    return text if pd.isna(margin) else f"{text} ± {margin:.2g}"


def format_pairs(
    first: Iterable[float], second: Iterable[float], template: str = "{:.1f} ± {:.1f}"
) -> list[str]:
    """Pairs of numbers as text, such as means with standard deviations, or the ends of intervals."""
    pairs = zip(first, second, strict=True)
    return [
        "–" if pd.isna(pair[0]) else template.format(*pair).replace("nan", "–") for pair in pairs
    ]


def format_rows(table: pd.DataFrame, columns: Mapping[str, str]) -> pd.DataFrame:
    """Text made of the columns of each row, by a template for each heading.

    A dash stands where there is no value, also of what the table does not have; an interval that a value does not have
    is left out.

    Examples
    --------
    >>> table = pd.DataFrame({"method": ["riv", "pr"], "K": [150.0, np.nan], "margin": [2.0, np.nan]})
    >>> format_rows(table, {"method": "{method}", "K [N·m/rad]": "{K:.1f} ± {margin:.1f}"}).to_numpy().tolist()
    [['riv', '150.0 ± 2.0'], ['pr', '–']]
    """
    cells = {}
    rows = [defaultdict(lambda: np.nan, row) for row in table.to_dict("records")]
    for heading, template in columns.items():
        texts = [NO_INTERVAL.sub("", template.format_map(row)) for row in rows]
        cells[heading] = [NO_VALUE.sub("–", text) for text in texts]
    return pd.DataFrame(cells, index=table.index, dtype=str)


def format_means(
    summary: pd.DataFrame,
    name: str,
    template: str = "{:.1f} ± {:.1f}",
    *,
    truth: pd.Series | None = None,
) -> list[str]:
    """Means over trials ± half of their 95 % intervals; as errors in percent where true values are given."""
    means = summary[f"{name}_mean"]
    margins = confidence_margin(summary[f"{name}_std"], summary[f"{name}_count"])
    if truth is not None:
        means = 100.0 * (means / truth - 1.0)
        margins = 100.0 * margins / truth
    return format_pairs(means, margins, template)


def compare_with_published(
    details: pd.DataFrame, published: pd.DataFrame, by: Sequence[str]
) -> pd.DataFrame:
    """Mean and standard deviation over trials beside the published numbers."""
    keys = ["method", "torque", "against"]
    table = mean_scores(details, [*by, "method"]).merge(published, how="left", on=keys)
    return table[[*by, *keys, "paper", "mean", "sd", "n", *COUNTS]]


def format_table(table: pd.DataFrame, labels: Labels) -> pd.DataFrame:
    """A table as people read it: labels for methods, mean ± half its 95 % interval, difference to the paper, counts."""
    cells = table.drop(columns=["paper", "mean", "sd", "n", *COUNTS])
    cells = cells.replace({"method": dict(labels)})
    settings = cells.select_dtypes("number").columns
    cells[settings] = cells[settings].map("{:g}".format)
    numbers = table.assign(
        margin=confidence_margin(table["sd"], table["n"]),
        difference=table["mean"] - table["paper"],
    )
    columns = {
        "paper [%]": "{paper:.0f}",
        "ours [%]": "{mean:.1f} ± {margin:.2f}",
        "difference [points]": "{difference:+.1f}",
    }
    return cells.join(format_rows(numbers, columns)).join(table[COUNTS])


def compare_with_bound(
    details: pd.DataFrame,
    truths: Mapping[str, Mapping[str, float]],
    bounds: Mapping[tuple[str, str], Mapping[str, float]],
) -> pd.DataFrame:
    """Errors of parameters over trials, their size over the Cramér-Rao bound, and intervals that hold the truth [%]."""
    keys = ["point", "method"]
    rows = []
    for (point, method), part in details.groupby(keys, sort=False):
        # Parameters that the method estimates, if only at other points.
        estimated = details[details["method"] == method].dropna(axis="columns", how="all")
        for name, truth in truths[point].items():
            if name not in estimated:
                continue
            values = part[name].dropna()
            mean = values.mean()
            rmse = np.sqrt(((values - truth) ** 2).mean())
            bound = bounds[point, method].get(name, np.nan)
            ends = part.reindex(columns=[f"{name}_low", f"{name}_high"]).dropna()
            low, high = (ends[column] for column in ends)
            is_inside = (low <= truth) & (truth <= high)
            row = {
                "point": point,
                "method": method,
                "parameter": name,
                "truth": truth,
                "mean": mean,
                "bias": mean - truth,
                "sd": values.std(),
                "rmse": rmse,
                "n": len(values),
                "bound": bound,
                "ratio": rmse / bound,
                "covered": 100.0 * is_inside.mean(),
            }
            rows.append(row)
    return pd.DataFrame(rows).merge(count_outcomes(details, keys), on=keys)


def drop_omissions(details: pd.DataFrame) -> pd.DataFrame:
    """Details without the warnings that a step is left out, which say of a study what it was made for."""
    warnings = details["warnings"].astype("string")
    for step in OMITTED_STEPS:
        warnings = warnings.str.replace(describe_omission(step), "", regex=False)
    return details.assign(warnings=warnings.str.strip().replace("", pd.NA).astype(object))


def tabulate_omissions(
    details: pd.DataFrame, points: Points, labels: Labels, algorithms: Mapping[str, str]
) -> pd.DataFrame:
    """Means over trials of each method with all steps of the processing and without each, with what that changes.

    Points have the step that their estimates lack as `omitted_step`; a method without this option has no such rows.
    """
    keys = ["point", "method"]
    counts = count_outcomes(details, keys).set_index(keys)
    results = {
        place: part.set_index("trial").reindex(columns=OMISSION_COLUMNS).astype(float)
        for place, part in details.groupby(keys)
    }
    rows = []
    for (complete, condition), method in product(_name_conditions(points).items(), labels):
        changed = {
            COMPLETE: complete,
            FILTER: _find_point(points, complete, antialias_cutoff=None),
        }
        if "omitted_step" in find_method(algorithms[method]).options.model_fields:
            for step in OMITTED_STEPS:
                changed[step.replace("-", " ")] = _find_point(points, complete, omitted_step=step)
        for label, point in changed.items():
            if (point, method) not in results:
                continue
            changes = _measure_changes(results[point, method], results[complete, method])
            row = {"condition": condition, "method": labels[method], "omitted_step": label}
            rows.append({**row, **changes, **counts.loc[(point, method)]})
    return pd.DataFrame(rows)


def _name_conditions(points: Points) -> dict[str, str]:
    """Condition of each point with all steps in words; with its name where two have the same words."""
    words = {}
    for point, settings in points.items():
        is_clean = settings["snr_db"] is None and settings["voluntary"] == 0
        if settings["antialias_cutoff"] and not settings.get("omitted_step"):
            words[point] = "without noise" if is_clean else "with noise"
    counts = Counter(words.values())
    return {
        point: text if counts[text] == 1 else f"{text}, {point}" for point, text in words.items()
    }


def _find_point(points: Points, point: str, **change: Any) -> str | None:
    """The point with the settings of another one but for a change."""
    wanted = {**points[point], **change}
    return next((name for name, settings in points.items() if settings == wanted), None)


def _measure_changes(values: pd.DataFrame, complete: pd.DataFrame) -> dict[str, float]:
    """Means of all columns and their changes from trial to trial ("cost"), with their margins."""
    means, margins = _measure_means(values)
    costs, cost_margins = _measure_means(values - complete)
    numbers = {"mean": means, "margin": margins, "cost": costs, "cost_margin": cost_margins}
    return {
        f"{name}_{key}": column[name]
        for name in OMISSION_COLUMNS
        for key, column in numbers.items()
    }


def _measure_means(values: pd.DataFrame) -> tuple[pd.Series, pd.Series]:
    """Means of all columns, and half of the 95 % interval of each."""
    rows = measure_statistics(values.assign(all=""), ["all"], OMISSION_COLUMNS)
    rows = rows.set_index("quantity")
    return rows["mean"], rows["margin"]


def write_table(table: pd.DataFrame, stem: str, shown: pd.DataFrame, caption: str) -> None:
    """Write a table as CSV, and what people read of it as Markdown with its caption; both replace former ones."""
    write_csv(table, f"{stem}.csv", overwrite=True)
    shown = shown.replace(r"\|", r"\\|", regex=True)  # else it would end a cell
    with atomic_file(f"{stem}.md", overwrite=True) as path:
        path.write_text(f"{shown.to_markdown(index=False)}\n\n{caption}\n", encoding="utf-8")
