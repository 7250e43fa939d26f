"""Charts of many trials: curves with confidence bands, maps, traces over time, errors, intervals, singular values."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle

from ankleloop.plotting.fault_marks import draw_crosses, draw_rings, mark_means
from ankleloop.plotting.style import COLOURS, MARKERS, REFERENCE_LINE, STYLE, add_legend, panel_grid
from ankleloop.signals.vaf import confidence_margin

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "curves_figure",
    "estimates_figure",
    "interval_figure",
    "map_figure",
    "order_figure",
    "ratio_figure",
    "traces_figure",
]


@matplotlib.rc_context(STYLE)
def curves_figure(
    table: pd.DataFrame,
    panels: Mapping[str, tuple[str, float | None]],
    *,
    xlabel: str,
    columns: int = 3,
    log: bool = False,
    limits: Mapping[str, tuple[float, float]] | None = None,
    dashed: Collection[str] = (),
) -> Figure:
    """Mean over trials against a parameter, with the 95 % confidence band of the mean.

    A single trial has no band. A ring marks means of which a trial failed or came with a warning; where every trial
    failed, a cross stands at the lower edge of the panel.

    Parameters
    ----------
    table : pandas.DataFrame
        One row per trial: columns `panel`, `series`, `x`, `value`, and optionally `outcome`: "estimate", "warning" (an
        estimate with a warning) or "failure" (no estimate, and no value).
    panels : dict of str to (str, float or None)
        For each panel its label with unit, and the true value that is drawn as a black line.
    xlabel : str
        Label of the parameter with its unit.
    columns : int
        Panels side by side.
    log : bool
        Logarithmic parameter.
    limits : dict of str to tuple, optional
        Limits of the ordinate by panel; a note in the panel gives the lowest mean of curves that go below them.
    dashed : collection of str
        Series drawn with dashes.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = panel_grid(len(panels), columns, (3.1, 2.6), (0.4, 0.8), sharex=True)
    for axis, (panel, (label, truth)) in zip(axes, panels.items(), strict=True):
        for number, (series, trials) in enumerate(table[table["panel"] == panel].groupby("series", sort=False)):
            _draw_curve(axis, trials, str(series), number, "--" if series in dashed else "-")
        if truth is not None:
            axis.axhline(truth, **REFERENCE_LINE, label="true value", zorder=0.5)
        axis.set(ylabel=label, xscale="log" if log else "linear")
        if limits and panel in limits:
            _limit_ordinate(axis, *limits[panel])
    for axis in axes[-min(columns, len(axes)) :]:
        axis.set_xlabel(xlabel)
        axis.tick_params(labelbottom=True)
    add_legend(figure, axes)
    return figure


def _draw_curve(axis: Axes, trials: pd.DataFrame, series: str, number: int, line_style: str) -> None:
    summary = trials.groupby("x")["value"].agg(["mean", "std", "count"])
    margin = confidence_margin(summary["std"], summary["count"])  # none of a single trial
    x, mean = summary.index.to_numpy(), summary["mean"].to_numpy()
    style = _series_style(number)
    axis.fill_between(x, mean - margin, mean + margin, color=style["color"], alpha=0.25, lw=0)
    axis.plot(x, mean, **style, ms=3.2, lw=1.1, ls=line_style, label=series)
    if "outcome" in trials:
        outcomes = trials["outcome"].groupby(trials["x"])
        draw_rings(axis, *np.array([x, mean])[:, outcomes.agg(lambda values: (values != "estimate").any())])
        failed = x[outcomes.agg(lambda values: (values == "failure").all())]
        draw_crosses(axis, failed, 0.03 + 0.04 * number, style["color"], axis.get_xaxis_transform())


def _series_style(number: int) -> dict[str, Any]:
    """Colour and marker of a series; they repeat when there are too many."""
    return {"color": COLOURS[number % len(COLOURS)], "marker": MARKERS[number % len(MARKERS)]}


def _limit_ordinate(axis: Axes, low: float, high: float) -> None:
    """Limit the ordinate, and note the lowest mean where a curve goes below it."""
    curves = [np.asarray(line.get_ydata()) for line in axis.get_lines() if line.get_transform() == axis.transData]
    lowest = min((np.min(curve[np.isfinite(curve)]) for curve in curves if np.isfinite(curve).any()), default=low)
    axis.set_ylim(low, high)
    if lowest < low:
        axis.annotate(f"lowest mean: {lowest:.4g}", (0.03, 0.03), xycoords="axes fraction", fontsize=7, color="#555555")


@matplotlib.rc_context({**STYLE, "axes.grid": False})
def map_figure(
    table: pd.DataFrame,
    *,
    x: str,
    y: str,
    panel: str,
    value: str,
    xlabel: str,
    ylabel: str,
    title: str,
    limit: float,
) -> Figure:
    """Map of a quantity over two parameters, a panel for each value of a third.

    Parameters
    ----------
    table : pandas.DataFrame
        One row per cell; columns as named by the next four, and optionally `fault`: whether a trial of the cell failed
        or came with a warning. Such cells have an asterisk.
    x, y, panel, value : str
        Columns of the abscissa, the ordinate, the panels and the quantity.
    xlabel, ylabel, title : str
        Labels with units; `title` is formatted with the value of `panel`.
    limit : float
        Cells at or below it are framed: there the condition holds.

    Returns
    -------
    matplotlib.figure.Figure
    """
    names = list(dict.fromkeys(table[panel]))
    figure, axes = panel_grid(len(names), 3, (2.9, 2.7), (0.9, 0.3))
    norm = LogNorm(max(0.5, table[value].min()), max(1.0, table[value].max()))
    for axis, name in zip(axes, names, strict=True):
        rows = table[table[panel] == name]
        cells = rows.pivot(index=y, columns=x, values=value)
        faults = rows.assign(fault=rows.get("fault", False)).pivot(index=y, columns=x, values="fault")
        image = _draw_cells(axis, cells, faults.eq(True).to_numpy(), norm, limit)
        axis.set(xlabel=xlabel, ylabel=ylabel, title=title.format(name))
    bar = figure.colorbar(image, ax=figure.axes, label="largest deviation from the paper [points of VAF]")
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.ax.yaxis.set_minor_formatter("{x:g}")
    return figure


def _draw_cells(axis: Axes, cells: pd.DataFrame, faults: np.ndarray, norm: LogNorm, limit: float) -> AxesImage:
    image = axis.imshow(cells.to_numpy(), norm=norm, cmap="viridis_r", origin="lower", aspect="auto")
    axis.set_xticks(range(cells.shape[1]), [f"{value:g}" for value in cells.columns])
    axis.set_yticks(range(cells.shape[0]), [f"{value:g}" for value in cells.index])
    for (row, column), value in np.ndenumerate(cells.to_numpy()):
        if not np.isfinite(value):
            text = "failed" if faults[row, column] else "unstable"
            axis.text(column, row, text, ha="center", va="center", fontsize=6)
            continue
        text = (f"{value:.1f}" if value < 100 else f"{value:.0f}") + "*" * int(faults[row, column])
        colour = "white" if norm(value) > 0.5 else "black"  # on a dark or a light cell
        axis.text(column, row, text, ha="center", va="center", fontsize=7, color=colour)
        if value <= limit:
            axis.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, ec="#D55E00", lw=2))
    return image


@matplotlib.rc_context(STYLE)
def traces_figure(
    traces: Mapping[str, Mapping[str, np.ndarray]], truths: Mapping[str, tuple[str, float]], settling: float = 0.0
) -> Figure:
    """Estimated parameters over time, a column for each condition.

    Parameters
    ----------
    traces : dict of str to dict of str to ndarray
        For each condition `time` [s] and the traces by the names of `truths`.
    truths : dict of str to (str, float)
        For each parameter its label with unit, and the true value.
    settling : float
        Time [s] from which on the traces set the limits of the axes; before it they may leave them.

    Returns
    -------
    matplotlib.figure.Figure
    """
    size = (2.6 * len(traces) + 0.4, 1.45 * len(truths) + 0.6)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(len(truths), len(traces), sharex=True, sharey="row", squeeze=False)
    for column, (condition, trace) in enumerate(traces.items()):
        for axis, (name, (_, truth)) in zip(axes[:, column], truths.items(), strict=True):
            axis.plot(trace["time"], trace[name], color=COLOURS[0], lw=1.0, label="estimate")
            axis.axhline(truth, **REFERENCE_LINE, label="true value")
        axes[0, column].set_title(condition)
        axes[-1, column].set_xlabel("time [s]")
    for axis, (name, (label, truth)) in zip(axes[:, 0], truths.items(), strict=True):
        values = [trace[name][np.asarray(trace["time"]) >= settling] for trace in traces.values()]
        low, high = min(truth, *map(np.min, values)), max(truth, *map(np.max, values))
        axis.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low))
        axis.set_ylabel(label)
    add_legend(figure, axes.ravel())
    return figure


@matplotlib.rc_context(STYLE)
def ratio_figure(table: pd.DataFrame, *, limit: float, largest: float = 50.0) -> Figure:
    """Errors over the Cramér-Rao bound: a panel for each setting, a row for each parameter, a marker for each method.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns `panel`, `row`, `series` and `ratio`, and optionally `fault`, whether trials failed or came with a
        warning: such symbols have a ring; and `failed`, whether all of them failed: a cross stands at the left edge.
    limit : float
        A line is drawn here, and at 1.
    largest : float
        Ratios beyond it are drawn there, open.

    Returns
    -------
    matplotlib.figure.Figure
    """
    panels, names = list(dict.fromkeys(table["panel"])), list(dict.fromkeys(table["row"]))
    panel_size = (3.3, 0.32 * len(names) + 0.8)
    figure, axes = panel_grid(len(panels), 3, panel_size, (0.4, 0.9), sharex=True, sharey=True)
    for axis, panel in zip(axes, panels, strict=True):
        _draw_ratios(axis, table[table["panel"] == panel], names, largest)
        axis.axvline(1.0, color="black", lw=0.8, label="the bound")
        axis.axvline(limit, **REFERENCE_LINE, label=f"{limit:g} times the bound")
        axis.set(title=panel, xscale="log", xlim=(0.7, 1.15 * largest), ylim=(len(names) - 0.5, -0.5))
        axis.set_yticks(range(len(names)), names)
        axis.xaxis.set_major_formatter("{x:g}")
        axis.tick_params(labelbottom=True)
    for axis in axes[-3:]:
        axis.set_xlabel("root mean square error over the bound [1]")
    add_legend(figure, axes)
    return figure


def _draw_ratios(axis: Axes, table: pd.DataFrame, names: Sequence[str], largest: float) -> None:
    """Ratios of all methods, those of one method a little below those of the method before."""
    series = table.groupby("series", sort=False)
    for number, (label, rows) in enumerate(series):
        heights = [names.index(name) + 0.08 * (number - 0.5 * (len(series) - 1)) for name in rows["row"]]
        style = {**_series_style(number), "ls": "", "ms": 4.2}
        too_large = (rows["ratio"] > largest).to_numpy()
        axis.plot(np.where(too_large, np.nan, rows["ratio"]), heights, label=label, **style)
        axis.plot(np.where(too_large, largest, np.nan), heights, mfc="none", **style)
        mark_means(axis, rows, rows["ratio"].clip(upper=largest), heights, style["color"])


@matplotlib.rc_context(STYLE)
def estimates_figure(
    table: pd.DataFrame, panels: Mapping[str, tuple[str, float | None, tuple[float, float]]], *, columns: int = 3
) -> Figure:
    """Means with their intervals: a panel for each quantity, a row for each condition, a marker for each method.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns `panel`, `row`, `series`, `value` and `margin`, half of the interval, and optionally `fault`, whether
        trials failed or came with a warning: such symbols have a ring; and `failed`, whether all of them failed: a
        cross stands at the left edge.
    panels : dict of str to (str, float or None, (float, float))
        For each panel its label with unit, the true value, and the limits of the abscissa; values beyond them are
        drawn there, open.
    columns : int
        Panels side by side.

    Returns
    -------
    matplotlib.figure.Figure
    """
    names = list(dict.fromkeys(table["row"]))
    figure, axes = panel_grid(len(panels), columns, (2.6, 0.33 * len(names) + 0.6), (1.6, 0.8), sharey=True)
    for axis, (panel, (label, truth, limits)) in zip(axes, panels.items(), strict=True):
        rows = table[table["panel"] == panel]
        for number, (series, heights, part) in enumerate(_list_series(rows, names)):
            style = {**_series_style(number), "ls": "", "ms": 4.0}
            value, shown = part["value"].to_numpy(), part["value"].clip(*limits).to_numpy()
            axis.plot(np.where(shown == value, value, np.nan), heights, label=series, zorder=3, **style)
            axis.plot(np.where(shown == value, np.nan, shown), heights, mfc="white", clip_on=False, zorder=3, **style)
            axis.hlines(heights, value - part["margin"], value + part["margin"], color=style["color"], lw=1.0)
            mark_means(axis, part, shown, heights, style["color"])
        if truth is not None:
            axis.axvline(truth, **REFERENCE_LINE, label="true value")
        axis.set(xlabel=label, xlim=limits, ylim=(len(names) - 0.5, -0.5))
        axis.set_yticks(range(len(names)), names)
    add_legend(figure, axes)
    return figure


def _list_series(rows: pd.DataFrame, names: Sequence[str]) -> Iterator[tuple[str, list[float], pd.DataFrame]]:
    """Label, heights and rows of each series, those of one series a little below those of the series before."""
    series = rows.groupby("series", sort=False)
    for number, (label, part) in enumerate(series):
        offset = 0.16 * (number - 0.5 * (len(series) - 1))
        yield str(label), [names.index(name) + offset for name in part["row"]], part


@matplotlib.rc_context(STYLE)
def interval_figure(
    table: pd.DataFrame, panels: Mapping[str, tuple[str, float]], *, xlabel: str = "trial [1]"
) -> Figure:
    """Estimates with their intervals, one after the other, and the truth; intervals that miss it have another colour.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns `panel`, `value`, `low`, `high`, in the order in which they are drawn.
    panels : dict of str to (str, float)
        For each panel its label with unit, and the true value.
    xlabel : str
        Label of the abscissa.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(6.6, 1.35 * len(panels) + 0.7), layout="constrained")
    axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
    for axis, (panel, (label, truth)) in zip(axes, panels.items(), strict=True):
        estimates = table[table["panel"] == panel].reset_index(drop=True)
        hits = (estimates["low"] <= truth) & (truth <= estimates["high"])
        _draw_intervals(axis, estimates[hits], COLOURS[0], "95 % interval that holds the truth")
        _draw_intervals(axis, estimates[~hits], COLOURS[1], "95 % interval that misses it")
        axis.axhline(truth, **REFERENCE_LINE, label="true value")
        axis.set(ylabel=label)
    axes[-1].set_xlabel(xlabel)
    handles = {label: handle for axis in axes for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3)
    return figure


def _draw_intervals(axis: Axes, estimates: pd.DataFrame, colour: str, label: str) -> None:
    value = estimates["value"]
    spread = [value - estimates["low"], estimates["high"] - value]
    style: dict[str, Any] = {"color": colour, "ms": 2.6, "elinewidth": 0.9, "capsize": 0, "label": label}
    axis.errorbar(estimates.index + 1, value, spread, fmt="o", **style)


@matplotlib.rc_context(STYLE)
def order_figure(
    singular_values: Mapping[str, Sequence[np.ndarray]], *, order: int | float, largest: int = 10
) -> Figure:
    """Singular values that show the order, of every trial and method.

    Parameters
    ----------
    singular_values : dict of str to list of ndarray
        Singular values of each trial by the label of the method.
    order : int
        Order of the models; a line is drawn behind it.
    largest : int
        Largest number of a singular value that is drawn.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(3.1 * len(singular_values) + 0.4, 2.8), layout="constrained")
    axes = figure.subplots(1, len(singular_values), squeeze=False, sharey=True)[0]
    for number, (axis, (label, trials)) in enumerate(zip(axes, singular_values.items(), strict=True)):
        for values in trials:
            relative = np.asarray(values)[:largest] / values[0]
            axis.semilogy(np.arange(1, relative.size + 1), relative, ".-", color=COLOURS[number], lw=0.6, alpha=0.5)
        axis.axvline(order + 0.5, **REFERENCE_LINE)
        axis.set(title=label, xlabel="number [1]", xticks=range(1, largest + 1))
    axes[0].set_ylabel("singular value over the first [1]")
    return figure
