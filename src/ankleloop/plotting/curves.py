"""Curves of means over trials against a parameter, with their confidence bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from ankleloop.plotting.method_styles import MethodStyle, ordinal_styles
from ankleloop.plotting.panels import Panel, add_legend, mark_means, panel_grid, split_label
from ankleloop.plotting.style import NOTE, ONE_COLUMN, REFERENCE_LINE, STYLE, TWO_COLUMNS, DataFigure
from ankleloop.signals.vaf import confidence_margin

HEIGHT = 50.0  # mm of a row of panels
MOST_TICKS = 6  # values of a logarithmic parameter that have a tick each
UPPER_SHARE = 0.45  # of the ordinate, for what lies above a break
MOST_SYMBOLS = 25  # means of a curve that have a symbol each


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
    failed, a cross stands at the lower edge of the panel. Panels of the same quantity share their ordinate, whose part
    above a break has a scale of its own.
    """
    styles = styles or ordinal_styles(dict.fromkeys(table["series"]))
    means = pd.concat([_summarise(table[table["panel"] == name], panel) for name, panel in panels.items()])
    columns = min(columns, len(panels))
    height = HEIGHT if break_at is None else 1.25 * HEIGHT
    width = ONE_COLUMN if columns == 1 else TWO_COLUMNS
    figure, axes = panel_grid(len(panels), columns, height, width=width, sharex=True)
    share_ordinates(axes, list(panels.values()), columns)
    for axis, (name, panel) in zip(axes, panels.items(), strict=True):
        rows = means[means["panel"] == name]
        for number, (series, part) in enumerate(rows.groupby("series", sort=False)):
            draw_curve(axis, part, styles[str(series)], str(series), 0.03 + 0.04 * number)
        if panel.truth is not None:
            axis.axhline(panel.truth, **REFERENCE_LINE, label="true value", zorder=0.5)
        if panel.limits:
            axis.set_ylim(panel.limits)
            note_lowest(axis, rows["mean"].min())
        if break_at is not None and (means["mean"] < break_at).any():
            _stretch_above(axis, break_at)
    for axis in axes[-columns:]:
        axis.set_xlabel(xlabel)
    if log:
        _set_logarithmic(axes, means["x"].dropna())
    add_legend(figure, axes)
    figure.data = _name_columns(means, panels, xlabel)
    return figure


def share_ordinates(axes: Sequence[Axes], panels: Sequence[Panel], columns: int) -> None:
    """Give panels of the same quantity one ordinate, with its label at the first of them in a row."""
    first: dict[str, Axes] = {}
    for number, (axis, panel) in enumerate(zip(axes, panels, strict=True)):
        if panel.label in first:
            axis.sharey(first[panel.label])
        first.setdefault(panel.label, axis)
        if number % columns and panels[number - 1].label == panel.label:
            axis.tick_params(labelleft=False)
        else:
            axis.set_ylabel(panel.label)
        axis.set_title(panel.title)


def _summarise(trials: pd.DataFrame, panel: Panel) -> pd.DataFrame:
    """Mean and interval of each series at each value of the parameter, and what came of the trials."""
    order = {name: number for number, name in enumerate(dict.fromkeys(trials["series"]))}
    by = trials.assign(outcome=trials.get("outcome", "estimate")).groupby(["panel", "series", "x"], sort=False)
    summary = by["value"].agg(["mean", "std", "count"])
    margin = confidence_margin(summary["std"], summary["count"])  # none of a single trial
    summary = summary.assign(low=summary["mean"] - margin, high=summary["mean"] + margin, true_value=panel.truth)
    summary["marked"] = by["outcome"].agg(lambda values: (values != "estimate").any())
    summary["failed"] = by["outcome"].agg(lambda values: (values == "failure").all())
    return summary.reset_index().sort_values(["series", "x"], key=lambda column: column.replace(order))


def draw_curve(axis: Axes, rows: pd.DataFrame, style: MethodStyle, label: str, edge: float) -> None:
    """Means with their band; marks of failures, those of lost means at a height in the panel."""
    x, mean, low, high = (rows[name].to_numpy(dtype=float) for name in ("x", "mean", "low", "high"))
    axis.fill_between(x, low, high, color=style.colour, alpha=0.25, lw=0)
    curve = style.curve if len(rows) <= MOST_SYMBOLS else style.line
    axis.plot(x, mean, **curve, label=label)
    marked, failed = (rows[name].to_numpy(dtype=bool) for name in ("marked", "failed"))
    mark_means(axis, x, mean, marked, failed, style.colour, edge)


def note_lowest(axis: Axes, lowest: float) -> None:
    """Note the lowest mean where a curve leaves the panel below."""
    if lowest < axis.get_ylim()[0]:
        axis.annotate(f"lowest mean: {lowest:.4g}", (0.03, 0.03), **NOTE)


def _stretch_above(axis: Axes, level: float) -> None:
    """Draw what lies above a level on a scale of its own."""
    low, high = axis.get_ylim()
    below, above = (1.0 - UPPER_SHARE) / (level - low), UPPER_SHARE / (high - level)

    def stretch(values: np.ndarray) -> np.ndarray:
        return np.where(values < level, below, above) * (values - level)

    def shrink(places: np.ndarray) -> np.ndarray:
        return places / np.where(places < 0.0, below, above) + level

    axis.set_yscale("function", functions=(stretch, shrink))
    ticks = [tick for tick in MaxNLocator(4, steps=[1, 2, 5, 10]).tick_values(low, level) if low <= tick < level]
    axis.set_yticks(
        [
            *ticks,
            *(tick for tick in MaxNLocator(4, steps=[1, 2, 5, 10]).tick_values(level, high) if level <= tick <= high),
        ]
    )
    axis.axhline(level, color="#888888", lw=0.8, zorder=0.5)


def _set_logarithmic(axes: Sequence[Axes], x: pd.Series) -> None:
    """Logarithmic abscissae with numbers instead of powers; few values have a tick each."""
    values = np.unique(x)
    for axis in axes:
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("")
        if values.size <= MOST_TICKS:
            axis.set_xticks(values)
            axis.set_xticks([], minor=True)


def _name_columns(means: pd.DataFrame, panels: Mapping[str, Panel], xlabel: str) -> pd.DataFrame:
    """The means as a table for readers, with quantities and units."""
    labels = [split_label(panels[name].label) for name in means["panel"]]
    table = means.assign(quantity=[name for name, _ in labels], unit=[unit for _, unit in labels])
    table["panel"] = [panels[name].title for name in means["panel"]]
    columns = ["quantity", "unit", "panel", "series", "x", "mean", "low", "high", "count", "true_value"]
    table = table[[*columns, "marked", "failed"]]
    return table.rename(columns={"x": xlabel, "count": "trials"}).reset_index(drop=True)
