"""Charts of many trials: curves with confidence bands, maps, traces over time, singular values."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ankleloop.plotting.style import COLOURS, STYLE, add_legend
from ankleloop.signals.vaf import confidence_margin

__all__ = ["curves_figure", "interval_figure", "map_figure", "order_figure", "ratio_figure", "traces_figure"]

MARKERS = "osD^v<>pX"


def curves_figure(table, panels, *, xlabel, columns=3, log=False, limits=None, dashed=()):
    """Mean over trials against a parameter, with the 95 % confidence band of the mean.

    Parameters
    ----------
    table : pandas.DataFrame
        One row per trial: columns `panel`, `series`, `x`, `value`.
    panels : dict of str to (str, float or None)
        For each panel its label with unit, and the true value that is drawn as a black line.
    xlabel : str
        Label of the parameter with its unit.
    columns : int
        Panels side by side.
    log : bool
        Logarithmic parameter.
    limits : dict of str to tuple, optional
        Limits of the ordinate by panel: curves that leave them are cut, and the panel says so.
    dashed : sequence of str
        Series drawn with dashes.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with matplotlib.rc_context(STYLE):
        columns = min(columns, len(panels))
        rows = -(-len(panels) // columns)
        figure = Figure(figsize=(3.1 * columns + 0.4, 2.6 * rows + 0.8), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
        for axis, (panel, (label, truth)) in zip(axes, panels.items(), strict=False):
            for number, (series, part) in enumerate(table[table["panel"] == panel].groupby("series", sort=False)):
                _curve(axis, part, series, number, "--" if series in dashed else "-")
            if truth is not None:
                axis.axhline(truth, color="black", lw=0.8, ls=(0, (2, 2)), label="true value", zorder=0.5)
            axis.set(ylabel=label, xscale="log" if log else "linear")
            _cut(axis, (limits or {}).get(panel))
        for axis in axes[len(panels) :]:
            axis.set_visible(False)
        for axis in axes[max(0, len(panels) - columns) : len(panels)]:
            axis.set_xlabel(xlabel)
            axis.tick_params(labelbottom=True)
        add_legend(figure, axes)
    return figure


def _curve(axis, part, series, number, style):
    summary = part.groupby("x")["value"].agg(["mean", "std", "count"])
    margin = np.nan_to_num(confidence_margin(summary["std"], summary["count"]))
    colour = COLOURS[number % len(COLOURS)]
    marker = MARKERS[number % len(MARKERS)]
    x, mean = summary.index.to_numpy(), summary["mean"].to_numpy()
    axis.fill_between(x, mean - margin, mean + margin, color=colour, alpha=0.25, lw=0)
    axis.plot(x, mean, color=colour, marker=marker, ms=3.2, lw=1.1, ls=style, label=series)


def _cut(axis, limits):
    """Limit the ordinate, and say so where a curve leaves it."""
    if limits is None:
        return
    lowest = min((np.min(line.get_ydata()) for line in axis.get_lines()), default=limits[0])
    axis.set_ylim(*limits)
    if lowest < limits[0]:
        axis.annotate(f"lowest mean: {lowest:.4g}", (0.03, 0.03), xycoords="axes fraction", fontsize=7, color="#555555")


def map_figure(table, *, x, y, panel, value, xlabel, ylabel, title, limit):
    """Map of a quantity over two parameters, a panel for each value of a third.

    Parameters
    ----------
    table : pandas.DataFrame
        One row per cell; columns as named by the next four.
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
    with matplotlib.rc_context({**STYLE, "axes.grid": False}):
        names = list(dict.fromkeys(table[panel]))
        columns = min(3, len(names))
        rows = -(-len(names) // columns)
        figure = Figure(figsize=(2.9 * columns + 0.9, 2.7 * rows + 0.3), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False).ravel()
        norm = matplotlib.colors.LogNorm(max(0.5, table[value].min()), max(1.0, table[value].max()))
        for axis, name in zip(axes, names, strict=False):
            cells = table[table[panel] == name].pivot_table(value, y, x)
            picture = _cells(axis, cells, norm, limit)
            axis.set(xlabel=xlabel, ylabel=ylabel, title=title.format(name))
        for axis in axes[len(names) :]:
            axis.set_visible(False)
        bar = figure.colorbar(picture, ax=list(axes), label="largest deviation from the paper [points of VAF]")
        bar.ax.yaxis.set_major_formatter("{x:g}")
        bar.ax.yaxis.set_minor_formatter("{x:g}")
    return figure


def _cells(axis, cells, norm, limit):
    picture = axis.imshow(cells, norm=norm, cmap="viridis_r", origin="lower", aspect="auto")
    axis.set_xticks(range(cells.shape[1]), [f"{value:g}" for value in cells.columns])
    axis.set_yticks(range(cells.shape[0]), [f"{value:g}" for value in cells.index])
    for (row, column), value in np.ndenumerate(cells.to_numpy()):
        if not np.isfinite(value):
            axis.text(column, row, "unstable", ha="center", va="center", fontsize=6)
            continue
        dark = picture.norm(value) > 0.5
        text = f"{value:.1f}" if value < 100 else f"{value:.0f}"
        axis.text(column, row, text, ha="center", va="center", fontsize=7, color="white" if dark else "black")
        if value <= limit:
            corner = (column - 0.5, row - 0.5)
            axis.add_patch(matplotlib.patches.Rectangle(corner, 1, 1, fill=False, ec="#D55E00", lw=2))
    return picture


def traces_figure(traces, truths, settling=0.0):
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
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(2.6 * len(traces) + 0.4, 1.45 * len(truths) + 0.6), layout="constrained")
        axes = figure.subplots(len(truths), len(traces), sharex=True, sharey="row", squeeze=False)
        for column, (condition, trace) in enumerate(traces.items()):
            for axis, (name, (label, truth)) in zip(axes[:, column], truths.items(), strict=True):
                axis.plot(trace["time"], trace[name], color=COLOURS[0], lw=1.0, label="estimate")
                axis.axhline(truth, color="black", lw=0.8, ls=(0, (2, 2)), label="true value")
                if column == 0:
                    axis.set_ylabel(label)
            axes[0, column].set_title(condition)
            axes[-1, column].set_xlabel("time [s]")
        for axis, (name, (_, truth)) in zip(axes[:, 0], truths.items(), strict=True):
            seen = [trace[name][np.asarray(trace["time"]) >= settling] for trace in traces.values()]
            low, high = min(truth, *map(np.min, seen)), max(truth, *map(np.max, seen))
            axis.set_ylim(low - 0.2 * (high - low), high + 0.2 * (high - low))
        add_legend(figure, axes.ravel())
    return figure


def ratio_figure(table, *, limit, largest=50.0):
    """Errors over the Cramér-Rao bound: a panel for each setting, a row for each parameter, a marker for each method.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns `panel`, `row`, `series` and `ratio`.
    limit : float
        A line is drawn here, and at 1.
    largest : float
        Ratios beyond it are drawn there, open.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with matplotlib.rc_context(STYLE):
        panels, names = list(dict.fromkeys(table["panel"])), list(dict.fromkeys(table["row"]))
        columns = min(3, len(panels))
        rows = -(-len(panels) // columns)
        size = (3.3 * columns + 0.4, (0.32 * len(names) + 0.8) * rows + 0.9)
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
        for axis, panel in zip(axes, panels, strict=False):
            series = table[table["panel"] == panel].groupby("series", sort=False)
            for number, (label, part) in enumerate(series):
                height = [names.index(name) + 0.08 * (number - 0.5 * (len(series) - 1)) for name in part["row"]]
                look = {"color": COLOURS[number % len(COLOURS)], "marker": MARKERS[number % len(MARKERS)], "ls": ""}
                far = (part["ratio"] > largest).to_numpy()
                axis.plot(np.where(far, np.nan, part["ratio"]), height, ms=4.2, label=label, **look)
                axis.plot(np.where(far, largest, np.nan), height, ms=4.2, mfc="none", **look)
            axis.axvline(1.0, color="black", lw=0.8, label="the bound")
            axis.axvline(limit, color="black", lw=0.8, ls=(0, (2, 2)), label=f"{limit:g} times the bound")
            axis.set(title=panel, xscale="log", xlim=(0.7, 1.15 * largest), ylim=(len(names) - 0.5, -0.5))
            axis.set_yticks(range(len(names)), names)
            axis.xaxis.set_major_formatter("{x:g}")
            axis.tick_params(labelbottom=True)
        for axis in axes[len(panels) :]:
            axis.set_visible(False)
        for axis in axes[max(0, len(panels) - columns) : len(panels)]:
            axis.set_xlabel("root mean square error over the bound [1]")
        add_legend(figure, axes[: len(panels)])
    return figure


def interval_figure(table, panels, *, xlabel="trial [1]"):
    """Estimates with their intervals, one after the other, before the truth; those that miss it stand out.

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
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.6, 1.35 * len(panels) + 0.7), layout="constrained")
        axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
        for axis, (panel, (label, truth)) in zip(axes, panels.items(), strict=True):
            part = table[table["panel"] == panel].reset_index(drop=True)
            holds = (part["low"] <= truth) & (truth <= part["high"])
            for rows, colour, name in ((holds, COLOURS[0], "holds the truth"), (~holds, COLOURS[1], "misses it")):
                some = part[rows]
                spread = [some["value"] - some["low"], some["high"] - some["value"]]
                look = {"color": colour, "ms": 2.6, "elinewidth": 0.9, "capsize": 0}
                axis.errorbar(
                    some.index + 1, some["value"], spread, fmt="o", label=f"95 % interval that {name}", **look
                )
            axis.axhline(truth, color="black", lw=0.8, ls=(0, (2, 2)), label="true value")
            axis.set(ylabel=label)
        axes[-1].set_xlabel(xlabel)
        handles = {
            text: handle for axis in axes for handle, text in zip(*axis.get_legend_handles_labels(), strict=True)
        }
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3)
    return figure


def order_figure(singular_values, *, order, largest=10):
    """Singular values that show the order, of every trial and method.

    Parameters
    ----------
    singular_values : dict of str to list of ndarray
        Singular values of each trial by the label of the method.
    order : int
        Order that was used; a line is drawn behind it.
    largest : int
        Number of values shown.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(3.1 * len(singular_values) + 0.4, 2.8), layout="constrained")
        axes = figure.subplots(1, len(singular_values), squeeze=False, sharey=True)[0]
        for number, (axis, (label, trials)) in enumerate(zip(axes, singular_values.items(), strict=True)):
            for values in trials:
                relative = np.asarray(values)[:largest] / values[0]
                axis.semilogy(np.arange(1, relative.size + 1), relative, ".-", color=COLOURS[number], lw=0.6, alpha=0.5)
            axis.axvline(order + 0.5, color="black", lw=0.8, ls=(0, (2, 2)))
            axis.set(title=label, xlabel="number [1]", xticks=range(1, largest + 1))
        axes[0].set_ylabel("singular value over the first [1]")
    return figure
