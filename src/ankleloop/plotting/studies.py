"""Charts of many trials: traces over time, errors, intervals, singular values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ankleloop.plotting.fault_marks import mark_means
from ankleloop.plotting.legends import add_legend
from ankleloop.plotting.method_styles import MethodStyle, ordinal_styles
from ankleloop.plotting.panels import Panel, panel_grid, split_label
from ankleloop.plotting.style import (
    MARK,
    REFERENCE_LINE,
    STYLE,
    TWO_COLUMNS,
    DataFigure,
    inches,
)

MISSED = "#D55E00"  # of intervals that do not hold the truth
COLUMNS = 3  # panels side by side


@matplotlib.rc_context(STYLE)
def traces_figure(
    traces: Mapping[str, Mapping[str, np.ndarray]],
    truths: Mapping[str, tuple[str, float]],
    settling: float = 0.0,
    *,
    style: MethodStyle | None = None,
) -> DataFigure:
    """Estimated parameters over time, a column for each condition."""
    style = style or ordinal_styles(["estimate"])["estimate"]
    size = (inches(TWO_COLUMNS), inches(32.0 * len(truths) + 6.0))
    figure = DataFigure(figsize=size, layout="constrained")
    axes = figure.subplots(len(truths), len(traces), sharex=True, sharey="row", squeeze=False)
    drawn = []
    for column, (condition, trace) in enumerate(traces.items()):
        for axis, (name, (label, truth)) in zip(axes[:, column], truths.items(), strict=True):
            axis.plot(trace["time"], trace[name], **style.line, lw=0.9, label="estimate")
            axis.axhline(truth, **REFERENCE_LINE, label="true value")
            quantity, unit = split_label(label)
            part = {"condition": condition, "quantity": quantity, "unit": unit, "true_value": truth}
            drawn.append(pd.DataFrame({**part, "time [s]": trace["time"], "estimate": trace[name]}))
        axes[0, column].set_title(condition.replace(", ", ",\n"))
        axes[-1, column].set_xlabel("time [s]")
    for axis, (name, (label, truth)) in zip(axes[:, 0], truths.items(), strict=True):
        values = [trace[name][np.asarray(trace["time"]) >= settling] for trace in traces.values()]
        low, high = min(truth, *map(np.min, values)), max(truth, *map(np.max, values))
        axis.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low))
        axis.set_ylabel(label)
    add_legend(figure, axes.ravel())
    figure.data = pd.concat(drawn, ignore_index=True)
    return figure


@matplotlib.rc_context(STYLE)
def ratio_figure(
    table: pd.DataFrame,
    *,
    limit: float,
    largest: float = 50.0,
    styles: Mapping[str, MethodStyle] | None = None,
) -> DataFigure:
    """Errors over the Cramér-Rao bound: a panel for each setting, a row for each parameter, a symbol for a method."""
    panels, names = list(dict.fromkeys(table["panel"])), list(dict.fromkeys(table["row"]))
    styles = styles or ordinal_styles(dict.fromkeys(table["series"]))
    offset = 0.8 / max(1, table["series"].nunique())
    figure, axes = panel_grid(len(panels), COLUMNS, 9.0 * len(names) + 13.0, sharex=True, sharey=True)
    for number, (axis, panel) in enumerate(zip(axes, panels, strict=True)):
        _draw_ratios(axis, table[table["panel"] == panel], names, largest, styles, offset)
        axis.axvline(1.0, color="black", lw=0.8, gid=MARK, label="the bound")
        axis.axvline(limit, **REFERENCE_LINE, label=f"{limit:g} times the bound")
        axis.set(title=panel.replace(", ", ",\n", 1), xscale="log", xlim=(0.7, 1.15 * largest))
        axis.set_ylim(len(names) - 0.5, -0.5)
        axis.set_yticks(range(len(names)), names)
        axis.xaxis.set_major_formatter("{x:g}")
        if number + COLUMNS >= len(panels):
            axis.set_xlabel("rms error over the bound [1]")
    add_legend(figure, axes)
    columns = {"panel": "setting", "row": "parameter", "series": "method", "ratio": "rms error over the bound [1]"}
    figure.data = table[[*columns, *[name for name in ("fault", "failed") if name in table]]].rename(columns=columns)
    return figure


def _draw_ratios(
    axis: Axes,
    table: pd.DataFrame,
    names: Sequence[str],
    largest: float,
    styles: Mapping[str, MethodStyle],
    offset: float,
) -> None:
    """Ratios of all methods, those of one method a little below those of the method before."""
    for label, heights, rows in _list_series(table, names, offset):
        _draw_symbols(axis, rows["ratio"].to_numpy(), heights, (0.0, largest), label, styles[label])
        mark_means(axis, rows, rows["ratio"].clip(upper=largest), heights, styles[label].colour)


def _draw_symbols(
    axis: Axes,
    values: np.ndarray,
    heights: Sequence[float],
    limits: tuple[float, float],
    label: str,
    style: MethodStyle,
) -> None:
    """Symbols of values within limits, and arrow heads at the edge for those beyond."""
    low, high = limits
    axis.plot(np.where((values < low) | (values > high), np.nan, values), heights, **style.symbol, ls="", label=label)
    arrow: dict[str, Any] = {"color": style.colour, "ls": "", "ms": 5.0, "mew": 0.0, "clip_on": False, "zorder": 3}
    for beyond, edge, marker in ((values < low, low, 8), (values > high, high, 9)):  # carets, their tips at the edge
        if beyond.any():
            axis.plot(np.full(beyond.sum(), edge), np.asarray(heights)[beyond], marker=marker, **arrow)


@matplotlib.rc_context(STYLE)
def estimates_figure(
    table: pd.DataFrame,
    panels: Mapping[str, Panel],
    *,
    columns: int = COLUMNS,
    styles: Mapping[str, MethodStyle] | None = None,
) -> DataFigure:
    """Means with their intervals: a panel for each quantity, a row for each condition, a symbol for each method."""
    names = list(dict.fromkeys(table["row"]))
    styles = styles or ordinal_styles(dict.fromkeys(table["series"]))
    figure, axes = panel_grid(len(panels), columns, 5.5 * len(names) + 14.0, sharey=True)
    for axis, (name, panel) in zip(axes, panels.items(), strict=True):
        rows = table[table["panel"] == name]
        limits = panel.limits or (-np.inf, np.inf)
        for series, heights, part in _list_series(rows, names, 0.16):
            value = part["value"].to_numpy()
            ends = value - part["margin"], value + part["margin"]
            axis.hlines(heights, *ends, color=styles[series].colour, lw=0.9, zorder=2)
            _draw_symbols(axis, value, heights, limits, series, styles[series])
            mark_means(axis, part, part["value"].clip(*limits), heights, styles[series].colour)
        if panel.truth is not None:
            axis.axvline(panel.truth, **REFERENCE_LINE, label="true value")
        axis.set(xlabel=panel.label, xlim=panel.limits, ylim=(len(names) - 0.5, -0.5), title=panel.title)
        axis.set_yticks(range(len(names)), names)
    add_legend(figure, axes)
    figure.data = _name_estimates(table, panels)
    return figure


def _name_estimates(table: pd.DataFrame, panels: Mapping[str, Panel]) -> pd.DataFrame:
    """Means and intervals as a table for readers, with quantities and units."""
    table = table[table["panel"].isin(panels)]
    shown = [panels[name] for name in table["panel"]]
    labels = [split_label(panel.label) for panel in shown]
    data = table.assign(
        quantity=[quantity for quantity, _ in labels],
        unit=[unit for _, unit in labels],
        panel=[panel.title for panel in shown],
        low=table["value"] - table["margin"],
        high=table["value"] + table["margin"],
        true_value=[panel.truth for panel in shown],
    )
    columns = ["quantity", "unit", "panel", "row", "series", "value", "low", "high", "true_value", "fault", "failed"]
    return data[[name for name in columns if name in data]].reset_index(drop=True)


def _list_series(
    rows: pd.DataFrame, names: Sequence[str], distance: float
) -> Iterator[tuple[str, list[float], pd.DataFrame]]:
    """Label, heights and rows of each series, those of one series a little below those of the series before."""
    series = rows.groupby("series", sort=False)
    for number, (label, part) in enumerate(series):
        offset = distance * (number - 0.5 * (len(series) - 1))
        yield str(label), [names.index(name) + offset for name in part["row"]], part


@matplotlib.rc_context(STYLE)
def interval_figure(
    table: pd.DataFrame,
    panels: Mapping[str, tuple[str, float]],
    *,
    xlabel: str = "trial [1]",
    style: MethodStyle | None = None,
) -> DataFigure:
    """Estimates with their intervals, side by side, and the truth; intervals that miss it have another colour."""
    style = style or ordinal_styles(["estimate"])["estimate"]
    miss = MethodStyle(MISSED, "s", filled=False)
    size = (inches(TWO_COLUMNS), inches(27.0 * len(panels) + 6.0))
    figure = DataFigure(figsize=size, layout="constrained")
    axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
    drawn = []
    for axis, (panel, (label, truth)) in zip(axes, panels.items(), strict=True):
        estimates = table[table["panel"] == panel].reset_index(drop=True)
        hits = (estimates["low"] <= truth) & (truth <= estimates["high"])
        _draw_intervals(axis, estimates[hits], style, "95 % interval that holds the truth")
        _draw_intervals(axis, estimates[~hits], miss, "95 % interval that misses it")
        axis.axhline(truth, **REFERENCE_LINE, label="true value")
        axis.set(ylabel=label)
        quantity, unit = split_label(label)
        values = estimates[["value", "low", "high"]].assign(quantity=quantity, unit=unit, true_value=truth, holds=hits)
        drawn.append(values.assign(**{xlabel: estimates.index + 1}))
    axes[-1].set_xlabel(xlabel)
    add_legend(figure, axes)
    columns = ["quantity", "unit", xlabel, "value", "low", "high", "true_value", "holds"]
    figure.data = pd.concat(drawn, ignore_index=True)[columns]
    return figure


def _draw_intervals(axis: Axes, estimates: pd.DataFrame, style: MethodStyle, label: str) -> None:
    if estimates.empty:
        return
    places = estimates.index.to_numpy() + 1
    axis.vlines(places, estimates["low"], estimates["high"], color=style.colour, lw=0.9)
    axis.plot(places, estimates["value"], **style.symbol, ls="", ms=2.8, label=label)


@matplotlib.rc_context(STYLE)
def order_figure(
    singular_values: Mapping[str, Sequence[np.ndarray]],
    *,
    order: int | float,
    largest: int = 10,
    styles: Mapping[str, MethodStyle] | None = None,
) -> DataFigure:
    """Singular values that show the order, of every trial and method."""
    styles = styles or ordinal_styles(singular_values)
    size = (inches(TWO_COLUMNS), inches(52.0))
    figure = DataFigure(figsize=size, layout="constrained")
    axes = figure.subplots(1, len(singular_values), squeeze=False, sharey=True)[0]
    drawn = []
    for axis, (label, trials) in zip(axes, singular_values.items(), strict=True):
        style = styles[label]
        for trial, values in enumerate(trials):
            relative = np.asarray(values)[:largest] / values[0]
            numbers = np.arange(1, relative.size + 1)
            axis.semilogy(numbers, relative, **style.symbol, ms=2.2, mew=0.5, lw=0.5, alpha=0.6)
            part = {"method": label, "trial [1]": trial, "number [1]": numbers}
            drawn.append(pd.DataFrame({**part, "singular value over the first [1]": relative}))
        axis.axvline(order + 0.5, **REFERENCE_LINE)
        axis.set(title=label, xlabel="number [1]", xticks=range(1, largest + 1))
    axes[0].yaxis.set_major_formatter("{x:g}")
    axes[0].set_ylabel("singular value over the first [1]")
    figure.data = pd.concat(drawn, ignore_index=True)
    return figure
