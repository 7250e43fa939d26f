"""Words of the report of a sweep: what was varied, what the pictures show, the best and the worst points."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ankleloop.paper.results import format_pairs
from ankleloop.paper.sweep_quantities import FAULT_SHARES, SWEEP_QUANTITIES, desired_value
from ankleloop.paper.sweep_study import SweepStudy
from ankleloop.plotting.sweep_axes import SweepAxis
from ankleloop.plotting.sweep_maps import REGION_SHARE, has_rings
from ankleloop.plotting.sweeps import FAULT_SHARE, mark_rows, value_limits
from ankleloop.simulation.settings import SimulationSettings

EXTREMES = (
    "Points with the best and the worst mean (of an error: by the root mean square over trials), or the lowest and "
    "the highest of a quantity that has no best; mean ± standard deviation over trials. Points of which less than half "
    "of the trials have a value are not ranked; a point of which half came with a warning is never the best. Failures "
    "are trials without an estimate, which means leave out; warnings are trials whose estimate came with a warning, "
    "which means hold. All points are in the CSV file."
)
LEAST_SHARE = 0.5  # of the trials of a point that need an estimate for its mean to be ranked


def describe_design(sweep: SweepStudy) -> str:
    """What was varied: each parameter with its values, and the numbers of points, conditions, trials and faults."""
    points = sweep.trials.drop_duplicates("point")
    settings = [axis.name for axis in sweep.parameters if axis.name in SimulationSettings.model_fields]
    conditions = len(points[settings].drop_duplicates()) if settings else 1
    own = sweep.trials[sweep.trials["method"].isin([item.method for item in sweep.series])]
    failed, warned = int(own["failed"].sum()), int(own["warned"].sum())
    varied = "; ".join(_describe_values(axis) for axis in sweep.parameters) or "nothing"
    shared = " (points that differ in options of methods alone share their trials)" * (conditions < len(points))
    text = (
        f"Varied: {varied}. {_count(len(points), 'point')}, {_count(conditions, 'condition')}{shared}, "
        f"{_describe_trials(own)} {_count(len(own), 'identification')}: {failed:,} failed, and "
        f"{_count(warned, 'estimate')} came with a warning."
    )
    if sweep.absent:
        names = ", ".join(SWEEP_QUANTITIES[name].symbol for name in sweep.absent)
        text += f" No method of this study gives {names}."
    return text


def _describe_trials(own: pd.DataFrame) -> str:
    numbers = own.groupby(["point", "method"], sort=False, observed=True).size()
    low, high = int(numbers.min()), int(numbers.max())
    return f"{low if low == high else f'{low} to {high}'} {'trial' if high == 1 else 'trials'} at each point."


def _count(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'s' * (number != 1)}"


def _describe_values(axis: SweepAxis) -> str:
    """A parameter with its values, or with their limits where there are many."""
    if axis.ordered and len(axis.values) > 5:
        scale = ", spaced logarithmically" if axis.kind == "log" else ""
        limits = f"{axis.texts[0]} to {axis.texts[-1]} {axis.unit}".rstrip()
        return f"{axis.description} {limits} ({len(axis.values):,} values{scale})"
    return axis.label.removesuffix(" [1]") + ": " + ", ".join(axis.texts)


def describe_means(sweep: SweepStudy, effects: pd.DataFrame) -> str:
    """Caption of lines over one parameter, or of a matrix of effects of several."""
    if len(sweep.axes) == 1:
        text = f"Means over trials against {sweep.axes[0].description}"
    else:
        text = "Effect of each parameter: means over all trials of a value, or of a bin of values"
    others = [axis.description for axis in sweep.parameters if axis not in sweep.axes]
    if others:
        text += f", and over {', '.join(others)}"
    return f"{text}{_describe_bands(sweep)}{_end(sweep, effects)}"


def _describe_bands(sweep: SweepStudy) -> str:
    if sweep.settings["band"] == "trials":
        text = "; bands hold 80 % of the trials (quantiles 10 to 90 %)."
    elif len(sweep.parameters) < 2:
        text = "; bands are 95 % confidence intervals of the mean over trials."
    else:
        text = (
            "; bands are 95 % confidence intervals of the mean over the conditions of a value, which differ in the "
            "other parameters (over its trials, where it has one condition)."
        )
    return text + " Shares of trials have no bands." * any(name in FAULT_SHARES for name in sweep.quantities)


def describe_map(
    sweep: SweepStudy, cells: pd.DataFrame, edges: tuple[np.ndarray, np.ndarray] | None, sliced: bool
) -> str:
    """Caption of maps over two parameters."""
    x, y = sweep.axes[:2]
    combinations = len(sweep.trials[[x.name, y.name]].drop_duplicates())
    places = len(cells[["x", "y"]].drop_duplicates())
    what = f"the trials of {'a tile of points' if places < combinations else 'each point'}"
    others = [axis.description for axis in sweep.parameters if axis.name not in (x.name, y.name)]
    text = f"Means over {what}"
    if others and not sliced:
        text += f", and over {', '.join(others)}"
    text += "." + " Arrows at the ends of colour bars: some values are beyond them." * _is_clipped(sweep, cells)
    names = [SWEEP_QUANTITIES[panel.quantity].symbol for panel in sweep.panels if panel.truth is not None]
    text += f" White is the true value of {', '.join(names)}." if names else ""
    if edges is not None and cells["mean"].isna().any():
        text += " Hatched: trials, but no value."
    if not has_rings(edges):
        return text + _describe_difference(sweep) + _describe_regions(cells)
    return text + _end(sweep, cells)


def _is_clipped(sweep: SweepStudy, cells: pd.DataFrame) -> bool:
    """Whether means are beyond the colours of their panels."""
    for panel in sweep.panels:
        means = panel.rows(cells)["mean"].dropna()
        low, high = value_limits(means.to_numpy(), panel.desired)
        if ((means < low) | (means > high)).any():
            return True
    return False


def _describe_difference(sweep: SweepStudy) -> str:
    if sweep.difference is None:
        return ""
    return f" Differences (Δ) are {sweep.difference.label}, trial by trial."


def _describe_regions(cells: pd.DataFrame) -> str:
    """What outlines are, in a map of small cells; a region has several."""
    if not cells[["failures", "warnings"]].to_numpy().any():
        return ""
    return (
        f" Outlines, where there are any: regions in which at least {100 * REGION_SHARE:g} % of the trials failed, "
        "which means leave out, or came with a warning, which means hold."
    )


def _end(sweep: SweepStudy, table: pd.DataFrame) -> str:
    """What differences and marks are, where there are any."""
    text = _describe_difference(sweep)
    marked, failed = mark_rows(table)
    if marked.any():
        text += (
            f" Rings: at least {100 * FAULT_SHARE:g} % of the trials of a mean failed, which it leaves out, or came "
            "with a warning, which it holds."
        )
    return text + (" Crosses: every trial failed." if failed.any() else "")


def list_extremes(sweep: SweepStudy, summary: pd.DataFrame) -> pd.DataFrame:
    """Points with the best and the worst mean of each quantity and method; highest and lowest without a goal."""
    labels = {item.method: item.label for item in sweep.series}
    ranked = summary[summary["mean"].notna() & (summary["n"] >= LEAST_SHARE * summary["trials"])]
    rows = []
    for quantity in sweep.quantities:
        for method, label in labels.items():
            part = ranked[(ranked["quantity"] == quantity) & (ranked["method"] == method)]
            for rank, index in _rank(part, quantity):
                rows.append({"quantity": SWEEP_QUANTITIES[quantity].label, "method": label, "rank": rank, "row": index})
    chosen = summary.loc[[row["row"] for row in rows]]
    table = pd.DataFrame(rows, columns=["quantity", "method", "rank", "row"]).drop(columns="row")
    for axis in sweep.parameters:
        texts = dict(zip(axis.values, axis.texts, strict=True))
        table[axis.label.removesuffix(" [1]")] = [
            texts[None if pd.isna(value) else value] for value in chosen[axis.name]
        ]
    table["mean ± sd"] = format_pairs(chosen["mean"], chosen["sd"], "{:.4g} ± {:.2g}")
    return table.assign(**{name: chosen[name].astype(str).to_numpy() for name in ("trials", "failures", "warnings")})


def _rank(part: pd.DataFrame, quantity: str) -> list[tuple[str, int]]:
    """Words and rows of the two ends; nothing for a single point."""
    if len(part) < 2:
        return []
    goal = desired_value(quantity)
    if goal == "zero":  # the root mean square over trials: bias and spread together
        share = (part["n"] - 1) / part["n"]
        size = np.sqrt(part["mean"] ** 2 + (part["sd"] ** 2 * share).fillna(0.0))
    else:
        size = -part["mean"] if goal == "high" else part["mean"]
    if not goal:
        return [("lowest", size.idxmin()), ("highest", size.idxmax())]
    plain = size[part["warnings"] < LEAST_SHARE * part["trials"]]
    return [*([("best", plain.idxmin())] if len(plain) else []), ("worst", size.idxmax())]
