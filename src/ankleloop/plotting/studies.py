"""Charts of many trials: means with intervals row by row, traces over time, intervals, singular values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ankleloop.plotting.method_styles import MethodStyle, ordinal_styles
from ankleloop.plotting.panels import Panel, add_legend, mark_means, new_figure, panel_grid, split_label
from ankleloop.plotting.style import MARK, REFERENCE_LINE, STYLE, DataFigure

MISSED = MethodStyle("#D55E00", "s", filled=False)  # intervals that do not hold the truth
COLUMNS = 3  # panels side by side
ROW = 5.5  # mm of a row of symbols
RATIO = "rms error over the bound [1]"


@matplotlib.rc_context(STYLE)
def estimates_figure(
    table: pd.DataFrame,
    panels: Mapping[str, Panel],
    *,
    columns: int = COLUMNS,
    styles: Mapping[str, MethodStyle] | None = None,
) -> DataFigure:
    """Means with their intervals: a panel for each quantity, a row for each condition, a symbol for each method.

    Intervals are from `low` to `high`, or `margin` around the value. Arrow heads stand for values beyond the limits.
    """
    styles = styles or ordinal_styles(dict.fromkeys(table["series"]))
    if "margin" in table:
        table = table.assign(low=table["value"] - table["margin"], high=table["value"] + table["margin"])
    names = list(dict.fromkeys(table["row"]))
    figure, axes = panel_grid(len(panels), columns, ROW * len(names) + 14.0, sharey=True)
    for axis, (name, panel) in zip(axes, panels.items(), strict=True):
        _draw_rows(axis, table[table["panel"] == name], names, panel, styles)
        if panel.truth is not None:
            axis.axvline(panel.truth, **REFERENCE_LINE, label="true value")
        axis.set(xlabel=panel.label, xlim=panel.limits, title=panel.title)
    add_legend(figure, axes)
    data = table[table["panel"].isin(panels)]
    shown = [panels[name] for name in data["panel"]]
    labels = [split_label(panel.label) for panel in shown]
    data = data.assign(quantity=[name for name, _ in labels], unit=[unit for _, unit in labels])
    data = data.assign(panel=[panel.title for panel in shown], true_value=[panel.truth for panel in shown])
    kept = ["quantity", "unit", "panel", "row", "series", "value", "low", "high", "true_value", "fault", "failed"]
    figure.data = data[[name for name in kept if name in data]].reset_index(drop=True)
    return figure


@matplotlib.rc_context(STYLE)
def ratio_figure(
    table: pd.DataFrame, *, limit: float, largest: float = 50.0, styles: Mapping[str, MethodStyle] | None = None
) -> DataFigure:
    """Errors over the Cramér-Rao bound: a panel for each setting, a row for each parameter, a symbol for a method."""
    panels, names = list(dict.fromkeys(table["panel"])), list(dict.fromkeys(table["row"]))
    styles = styles or ordinal_styles(dict.fromkeys(table["series"]))
    figure, axes = panel_grid(len(panels), COLUMNS, 1.5 * ROW * len(names) + 13.0, sharex=True, sharey=True)
    for number, (axis, name) in enumerate(zip(axes, panels, strict=True)):
        rows = table[table["panel"] == name].assign(value=table["ratio"], low=np.nan, high=np.nan)
        _draw_rows(axis, rows, names, Panel(RATIO, limits=(0.0, largest)), styles)
        axis.axvline(1.0, color="black", lw=0.8, gid=MARK, label="the bound")
        axis.axvline(limit, **REFERENCE_LINE, label=f"{limit:g} times the bound")
        axis.set(title=name.replace(", ", ",\n", 1), xscale="log", xlim=(0.7, 1.15 * largest))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.set_xlabel(RATIO if number + COLUMNS >= len(panels) else "")
    add_legend(figure, axes)
    columns = {"panel": "setting", "row": "parameter", "series": "method", "ratio": RATIO}
    figure.data = table[[*columns, *[name for name in ("fault", "failed") if name in table]]].rename(columns=columns)
    return figure


def _draw_rows(
    axis: Axes, table: pd.DataFrame, names: Sequence[str], panel: Panel, styles: Mapping[str, MethodStyle]
) -> None:
    """Symbols and intervals of all series, those of one series a little below those of the series before."""
    low, high = panel.limits or (-np.inf, np.inf)
    series = table.groupby("series", sort=False)
    for number, (label, part) in enumerate(series):
        style, value = styles[str(label)], part["value"].to_numpy(dtype=float)
        offset = 0.8 / max(5, len(series)) * (number - 0.5 * (len(series) - 1))
        heights = np.array([names.index(name) + offset for name in part["row"]])
        axis.hlines(heights, part["low"], part["high"], color=style.colour, lw=0.9, zorder=2)
        inside = np.where((value < low) | (value > high), np.nan, value)
        axis.plot(inside, heights, **style.symbol, ls="", label=str(label))
        arrow: dict[str, Any] = {"color": style.colour, "ls": "", "ms": 5.0, "mew": 0.0, "clip_on": False, "zorder": 3}
        for beyond, edge, marker in ((value < low, low, 8), (value > high, high, 9)):  # carets, their tips at the edge
            if beyond.any():
                axis.plot(np.full(beyond.sum(), edge), heights[beyond], marker=marker, **arrow)
        fault, failed = (part.get(name, pd.Series(False, part.index)).to_numpy(bool) for name in ("fault", "failed"))
        mark_means(axis, value.clip(low, high), heights, fault, failed, style.colour, edge=None)
    axis.set_ylim(len(names) - 0.5, -0.5)
    axis.set_yticks(range(len(names)), names)


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
    figure = new_figure(32.0 * len(truths) + 6.0)
    axes = figure.subplots(len(truths), len(traces), sharex=True, sharey="row", squeeze=False)
    drawn = []
    for row, (name, (label, truth)) in zip(axes, truths.items(), strict=True):
        quantity, unit = split_label(label)
        for axis, (condition, trace) in zip(row, traces.items(), strict=True):
            axis.plot(trace["time"], trace[name], **style.line, lw=0.9, label="estimate")
            axis.axhline(truth, **REFERENCE_LINE, label="true value")
            part = {"condition": condition, "quantity": quantity, "unit": unit, "true_value": truth}
            drawn.append(pd.DataFrame({**part, "time [s]": trace["time"], "estimate": trace[name]}))
        settled = [trace[name][np.asarray(trace["time"]) >= settling] for trace in traces.values()]
        low, high = min(truth, *map(np.min, settled)), max(truth, *map(np.max, settled))
        row[0].set(ylabel=label, ylim=(low - 0.2 * (high - low), high + 0.2 * (high - low)))
    for top, bottom, condition in zip(axes[0], axes[-1], traces, strict=True):
        top.set_title(condition.replace(", ", ",\n"))
        bottom.set_xlabel("time [s]")
    add_legend(figure, axes.flat)
    figure.data = pd.concat(drawn, ignore_index=True)
    return figure


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
    figure = new_figure(27.0 * len(panels) + 6.0)
    axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
    drawn = []
    for axis, (panel, (label, truth)) in zip(axes, panels.items(), strict=True):
        rows = table.loc[table["panel"] == panel, ["value", "low", "high"]].reset_index(drop=True)
        quantity, unit = split_label(label)
        rows = rows.assign(quantity=quantity, unit=unit, true_value=truth, **{xlabel: rows.index + 1})
        rows["holds"] = (rows["low"] <= truth) & (truth <= rows["high"])
        kinds = {True: (style, "that holds the truth"), False: (MISSED, "that misses it")}
        for holds, part in rows.groupby("holds", sort=False):
            kind, words = kinds[bool(holds)]
            axis.vlines(part[xlabel], part["low"], part["high"], color=kind.colour, lw=0.9)
            axis.plot(part[xlabel], part["value"], **kind.symbol, ls="", ms=2.8, label=f"95 % interval {words}")
        axis.axhline(truth, **REFERENCE_LINE, label="true value")
        axis.set(ylabel=label)
        drawn.append(rows)
    axes[-1].set_xlabel(xlabel)
    add_legend(figure, axes)
    columns = ["quantity", "unit", xlabel, "value", "low", "high", "true_value", "holds"]
    figure.data = pd.concat(drawn, ignore_index=True)[columns]
    return figure


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
    figure, axes = panel_grid(len(singular_values), len(singular_values), 52.0, sharey=True)
    drawn = []
    for axis, (label, trials) in zip(axes, singular_values.items(), strict=True):
        for trial, values in enumerate(trials):
            relative = np.asarray(values)[:largest] / values[0]
            numbers = np.arange(1, relative.size + 1)
            axis.semilogy(numbers, relative, **styles[label].symbol, ms=2.2, mew=0.5, lw=0.5, alpha=0.6)
            part = {"method": label, "trial [1]": trial, "number [1]": numbers}
            drawn.append(pd.DataFrame({**part, "singular value over the first [1]": relative}))
        axis.axvline(order + 0.5, **REFERENCE_LINE)
        axis.set(title=label, xlabel="number [1]", xticks=range(1, largest + 1))
    axes[0].yaxis.set_major_formatter("{x:g}")
    axes[0].set_ylabel("singular value over the first [1]")
    figure.data = pd.concat(drawn, ignore_index=True)
    return figure
