"""Pictures of a sweep with their captions, and its best and worst points."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ankleloop.paper.results import format_pairs
from ankleloop.paper.sweep_quantities import FAULT_SHARES, SWEEP_QUANTITIES, desired_value
from ankleloop.paper.sweep_study import SweepStudy, summarise_effects, summarise_sweep
from ankleloop.plotting.sweeps import FAULT_SHARE, SweepAxis, lines_figure, maps_figure
from ankleloop.simulation.settings import SimulationSettings

LINE_BINS = {"bins": 40, "most": 100}  # of lines over a single parameter
MOST_SLICES = 4  # combinations of other parameters that have panels of their own
LEAST_SHARE = 0.5  # of the trials of a point that need an estimate for its mean to be ranked
BANDS = {
    "mean": "bands are 95 % confidence intervals of the mean over the conditions of a value, or over its trials where "
    "it has one condition",
    "trials": "bands hold 80 % of the trials (quantiles 10 to 90 %)",
}
MARKS = (
    f" A ring, or an asterisk behind a number: at least {100 * FAULT_SHARE:g} % of the trials of a mean failed, which "
    "it leaves out, or came with a warning, which it holds. A cross: no trial has a value."
)
EXTREMES = (
    "Points with the best and the worst mean (of an error: by the root mean square over trials), or the lowest and "
    "the highest of a quantity that has no best; mean ± standard deviation over trials. Points of which less than half "
    "of the trials have a value are not ranked; a point of which half came with a warning is never the best. Failures "
    "are trials without an estimate, which means leave out; warnings are trials whose estimate came with a warning, "
    "which means hold. All points are in the CSV file."
)


def draw_sweep(sweep: SweepStudy) -> tuple[Figure, str]:
    """The picture of a sweep: lines over one axis, maps over two, a matrix of effects over more.

    Parameters
    ----------
    sweep : SweepStudy
        The sweep.

    Returns
    -------
    figure : matplotlib.figure.Figure
    caption : str
    """
    if len(sweep.axes) == 2:
        return draw_map(sweep)
    band, bins = sweep.settings["band"], LINE_BINS if len(sweep.axes) == 1 else {}
    effects = pd.concat([summarise_effects(sweep.shown_trials, axis, sweep.quantities, **bins) for axis in sweep.axes])
    if band == "mean":
        effects = _add_ends(effects)
    effects.loc[effects["quantity"].isin(FAULT_SHARES), ["low", "high"]] = np.nan  # counts have no band
    return lines_figure(effects, sweep.axes, sweep.panels), f"{_describe(sweep, sweep.axes)}; {BANDS[band]}.{MARKS}"


def draw_map(sweep: SweepStudy) -> tuple[Figure, str]:
    """Maps over the first two axes of a sweep; a few values of the other parameters have panels of their own."""
    x, y = sweep.axes[:2]
    trials = sweep.shown_trials
    slices = list_slices(trials, [axis for axis in sweep.parameters if axis.name not in (x.name, y.name)])
    table = trials.assign(x=trials[x.name], y=trials[y.name], slice=trials["point"].map(slices) if slices else "")
    cells = _add_ends(summarise_sweep(table, ["x", "y", "slice", "method"], sweep.quantities))
    is_grid = 2 * len(trials[[x.name, y.name]].drop_duplicates()) >= len(x.values) * len(y.values)
    names = list(dict.fromkeys(slices.values())) or [""]
    figure = maps_figure(cells, (x, y), sweep.panels, names, is_grid=is_grid)
    shown = sweep.parameters if slices else (x, y)
    text = f"{_describe(sweep, shown)}. Arrows at the ends of colour bars: some values are beyond them."
    truths = [SWEEP_QUANTITIES[panel.quantity].symbol for panel in sweep.panels if panel.truth is not None]
    return figure, text + (f" White is the true value of {', '.join(truths)}." if truths else "") + MARKS


def _add_ends(table: pd.DataFrame) -> pd.DataFrame:
    """Ends of the intervals of means."""
    return table.assign(low=table["mean"] - table["margin"], high=table["mean"] + table["margin"])


def list_slices(trials: pd.DataFrame, others: list[SweepAxis]) -> dict[str, str]:
    """Slice of each point: the values of the parameters that are not axes of the map, where there are few of them."""
    points = trials.drop_duplicates("point").set_index("point")
    words = {point: ", ".join(axis.describe(row[axis.name]) for axis in others) for point, row in points.iterrows()}
    return words if 1 < len(set(words.values())) <= MOST_SLICES else {}


def _describe(sweep: SweepStudy, axes: tuple[SweepAxis, ...]) -> str:
    """What a picture over some parameters shows."""
    others = [axis.description for axis in sweep.parameters if axis not in axes]
    text = f"Means over trials against {', '.join(axis.description for axis in axes)}"
    text += f"; each is over all values of {', '.join(others)}" if others else ""
    return text + (f"; differences (Δ) are {sweep.difference.label}, trial by trial" if sweep.difference else "")


def describe_design(sweep: SweepStudy) -> str:
    """What was varied: each parameter with its values, and the numbers of points, conditions, trials and faults."""
    points = sweep.trials.drop_duplicates("point")
    settings = [axis.name for axis in sweep.parameters if axis.name in SimulationSettings.model_fields]
    conditions = len(points[settings].drop_duplicates()) if settings else 1
    own = sweep.trials[sweep.trials["method"].isin([item.method for item in sweep.series])]
    numbers = own.groupby(["point", "method"], sort=False, observed=True).size()
    trials = " to ".join(f"{number}" for number in dict.fromkeys([numbers.min(), numbers.max()]))
    varied = "; ".join(map(_describe_values, sweep.parameters)) or "nothing"
    shared = " (points that differ in options of methods alone share their trials)" * (conditions < len(points))
    text = (
        f"Varied: {varied}. {_count(len(points), 'point')}, {_count(conditions, 'condition')}{shared}, "
        f"{trials} {'trial' if trials == '1' else 'trials'} at each point. {_count(len(own), 'identification')}: "
        f"{own['failed'].sum():,} failed, and {_count(own['warned'].sum(), 'estimate')} came with a warning."
    )
    names = ", ".join(SWEEP_QUANTITIES[name].symbol for name in sweep.absent)
    return text + (f" No method of this study gives {names}." if names else "")


def _count(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def _describe_values(axis: SweepAxis) -> str:
    """A parameter with its values, or with their limits where there are many."""
    if axis.ordered and len(axis.values) > 5:
        scale = ", spaced logarithmically" if axis.kind == "log" else ""
        limits = f"{axis.texts[0]} to {axis.texts[-1]} {axis.unit}".rstrip()
        return f"{axis.description} {limits} ({len(axis.values):,} values{scale})"
    return f"{axis.heading}: {', '.join(axis.texts)}"


def list_extremes(sweep: SweepStudy, summary: pd.DataFrame) -> pd.DataFrame:
    """Points with the best and the worst mean of each quantity and method; highest and lowest without a goal."""
    ranked = summary[summary["mean"].notna() & (summary["n"] >= LEAST_SHARE * summary["trials"])]
    rows = []
    for name in sweep.quantities:
        for item in sweep.series:
            part = ranked[(ranked["quantity"] == name) & (ranked["method"] == item.method)]
            for rank, index in _rank(part, name):
                row = {"quantity": SWEEP_QUANTITIES[name].label, "method": item.label, "rank": rank}
                point = summary.loc[index]
                row |= {axis.heading: axis.format(point[axis.name]) for axis in sweep.parameters}
                row["mean ± sd"] = format_pairs([point["mean"]], [point["sd"]], "{:.4g} ± {:.2g}")[0]
                rows.append(row | {count: str(point[count]) for count in ("trials", "failures", "warnings")})
    return pd.DataFrame(rows)


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
