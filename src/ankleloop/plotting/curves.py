"""Curves of means over trials against a parameter, with their confidence bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ankleloop.plotting.fault_marks import draw_crosses, draw_rings
from ankleloop.plotting.legends import add_legend
from ankleloop.plotting.method_styles import MethodStyle, ordinal_styles
from ankleloop.plotting.panels import Panel, panel_grid, share_ordinates, split_label
from ankleloop.plotting.style import ONE_COLUMN, REFERENCE_LINE, STYLE, TWO_COLUMNS, DataFigure, inches
from ankleloop.signals.vaf import confidence_margin

HEIGHT = 50.0  # mm of a row of panels
MOST_TICKS = 6  # values of a logarithmic parameter that have a tick each
UPPER_SHARE = 0.8  # height of the part above a break over that of the part below
NOTE: dict[str, Any] = {"xycoords": "axes fraction", "fontsize": 6.5, "color": "#555555"}


@matplotlib.rc_context(STYLE)
def curves_figure(
    table: pd.DataFrame,
    panels: Mapping[str, Panel],
    *,
    xlabel: str,
    styles: Mapping[str, MethodStyle] | None = None,
    columns: int = 3,
    log: bool = False,
    break_at: float | None = None,
) -> DataFigure:
    """Mean over trials against a parameter, with the 95 % confidence band of the mean.

    A single trial has no band. A ring marks means of which a trial failed or came with a warning; where every trial
    failed, a cross stands at the lower edge of the panel. Panels of the same quantity share their ordinate.
    """
    means = pd.concat([_summarise(table[table["panel"] == name], panel) for name, panel in panels.items()])
    styles = styles or ordinal_styles(dict.fromkeys(means["series"]))
    columns = min(columns, len(panels))
    axes: Sequence[tuple[Axes, ...]]
    if break_at is not None and (means["mean"] < break_at).any():
        figure, axes = _broken_grid(list(panels.values()), columns, break_at)
    else:
        figure, grid = panel_grid(len(panels), columns, HEIGHT, width=_width(columns), sharex=True)
        share_ordinates(grid, list(panels.values()), columns)
        axes = [(axis,) for axis in grid]
    for parts, (name, panel) in zip(axes, panels.items(), strict=True):
        for axis in parts:
            edges = _edges(axis, parts, break_at)
            _draw_panel(axis, means[means["panel"] == name], panel, styles, edges)
        if panel.limits:
            _limit_ordinate(parts, panel.limits, means.loc[means["panel"] == name, "mean"])
    lowest = [parts[-1] for parts in axes]
    for axis in lowest[-columns:]:
        axis.set_xlabel(xlabel)
    if log:
        _set_logarithmic(lowest, means["x"])
    add_legend(figure, [axis for parts in axes for axis in parts])
    figure.data = _name_columns(means, panels, xlabel)
    return figure


def _edges(axis: Axes, parts: Sequence[Axes], break_at: float | None) -> tuple[float, float]:
    """Values between which the part of a panel lies."""
    if len(parts) == 1 or break_at is None:
        return -np.inf, np.inf
    return (break_at, np.inf) if axis is parts[0] else (-np.inf, break_at)


def _width(columns: int) -> float:
    return ONE_COLUMN if columns == 1 else TWO_COLUMNS


def _summarise(trials: pd.DataFrame, panel: Panel) -> pd.DataFrame:
    """Mean and interval of each series at each value of the parameter, and what came of the trials."""
    by = trials.groupby(["panel", "series", "x"], sort=False)
    summary = by["value"].agg(["mean", "std", "count"])
    margin = confidence_margin(summary["std"], summary["count"])  # none of a single trial
    summary = summary.assign(low=summary["mean"] - margin, high=summary["mean"] + margin, true_value=panel.truth)
    outcomes = by["outcome"] if "outcome" in trials else None
    summary["marked"] = False if outcomes is None else outcomes.agg(lambda values: (values != "estimate").any())
    summary["failed"] = False if outcomes is None else outcomes.agg(lambda values: (values == "failure").all())
    order = {name: number for number, name in enumerate(dict.fromkeys(trials["series"]))}
    summary = summary.reset_index().assign(number=lambda rows: rows["series"].map(order))
    return summary.sort_values(["number", "x"])


def _name_columns(means: pd.DataFrame, panels: Mapping[str, Panel], xlabel: str) -> pd.DataFrame:
    """The means as a table for readers, with quantities and units."""
    names = {name: (*split_label(panel.label), panel.title) for name, panel in panels.items()}
    quantity, unit, title = ([names[name][part] for name in means["panel"]] for part in range(3))
    table = means.assign(panel=title, quantity=quantity, unit=unit)
    shown = [
        "quantity",
        "unit",
        "panel",
        "series",
        "x",
        "mean",
        "low",
        "high",
        "count",
        "true_value",
        "marked",
        "failed",
    ]
    return table[shown].rename(columns={"x": xlabel, "count": "trials"}).reset_index(drop=True)


def _draw_panel(
    axis: Axes,
    means: pd.DataFrame,
    panel: Panel,
    styles: Mapping[str, MethodStyle],
    edges: tuple[float, float],
) -> None:
    """Curves of a panel, or of one part of it, which has the symbols of the means between its edges."""
    for number, (series, rows) in enumerate(means.groupby("series", sort=False)):
        x, mean, low, high = (rows[name].to_numpy() for name in ("x", "mean", "low", "high"))
        style = styles[str(series)]
        axis.fill_between(x, low, high, color=style.colour, alpha=0.25, lw=0)
        inside = (mean >= edges[0]) & (mean < edges[1])
        axis.plot(x, mean, **style.curve, markevery=np.flatnonzero(inside).tolist(), label=str(series))
        marked = rows["marked"].to_numpy(dtype=bool) & inside
        draw_rings(axis, x[marked], mean[marked])
        failed = x[rows["failed"].to_numpy(dtype=bool)]
        if edges[0] == -np.inf:
            draw_crosses(axis, failed, 0.03 + 0.04 * number, style.colour, axis.get_xaxis_transform())
    if panel.truth is not None:
        axis.axhline(panel.truth, **REFERENCE_LINE, label="true value", zorder=0.5)


def _limit_ordinate(parts: Sequence[Axes], limits: tuple[float, float], means: pd.Series) -> None:
    """Limit the ordinate, and note the lowest mean where a curve goes below it."""
    low, high = limits
    parts[0].set_ylim(top=high)
    parts[-1].set_ylim(bottom=low)
    if means.min() < low:
        parts[-1].annotate(f"lowest mean: {means.min():.4g}", (0.03, 0.03), **NOTE)


def _set_logarithmic(axes: Sequence[Axes], x: pd.Series) -> None:
    """Logarithmic abscissae with numbers instead of powers; few values have a tick each."""
    values = np.unique(x.dropna())
    for axis in axes:
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("")
        if values.size <= MOST_TICKS:
            axis.set_xticks(values)
            axis.set_xticks([], minor=True)


def _broken_grid(panels: Sequence[Panel], columns: int, break_at: float) -> tuple[DataFigure, list[tuple[Axes, Axes]]]:
    """Panels of two parts with the same abscissa: above a value and below it."""
    rows = -(-len(panels) // columns)
    size = inches(_width(columns)), inches(1.25 * HEIGHT * rows)
    figure = DataFigure(figsize=size, layout=ConstrainedLayoutEngine(hspace=0.0, h_pad=0.02))
    ratios = [UPPER_SHARE, 1.0] * rows
    grid = figure.subplots(2 * rows, columns, squeeze=False, sharex=True, height_ratios=ratios)
    pairs = [
        (grid[2 * (n // columns), n % columns], grid[2 * (n // columns) + 1, n % columns])
        for n in range(rows * columns)
    ]
    for upper, lower in pairs[len(panels) :]:
        upper.set_visible(False)
        lower.set_visible(False)
    pairs = pairs[: len(panels)]
    for part in range(2):
        share_ordinates([pair[part] for pair in pairs], panels, columns)
    slope = {"marker": [(-1, -0.6), (1, 0.6)], "ms": 6, "ls": "", "color": "black", "mew": 0.7, "clip_on": False}
    for number, (upper, lower) in enumerate(pairs):
        upper.spines["bottom"].set_visible(False)
        upper.tick_params(which="both", bottom=False, labelbottom=False)
        upper.set_ylabel(upper.get_ylabel(), y=0.0)  # beside both parts
        upper.set_ylim(bottom=break_at)
        lower.set_ylim(top=break_at)
        lower.set_title("")
        lower.set_ylabel("")
        for axis, place in ((upper, 0.0), (lower, 1.0)):
            axis.plot([0.0], [place], transform=axis.transAxes, label="_break", **slope)
        if number + columns >= len(panels):
            lower.tick_params(labelbottom=True)
    return figure, pairs
