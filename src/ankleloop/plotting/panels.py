"""Figures of panels in rows: a tidy table and what each panel shows become curves with bands, marks and a legend."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from ankleloop.plotting.style import (
    MARK,
    REFERENCE_LINE,
    STYLE,
    TWO_COLUMNS,
    DataFigure,
    MethodStyle,
    ordinal_styles,
)

# Around the symbol of a mean: some of its trials failed, or came with a warning.
FAULT_RING: dict[str, Any] = {
    "ls": "",
    "marker": "o",
    "ms": 6.0,
    "mfc": "none",
    "mec": "#666666",
    "mew": 0.5,
}
FAULT_RING |= {"zorder": 4, "label": "with failures or warnings", "gid": MARK}
ALL_FAILED = "every trial failed"  # label of a cross at the edge of a panel
BAND = 0.22  # opacity
NOTE: dict[str, Any] = {"xycoords": "axes fraction", "fontsize": 6.5, "color": "#555555"}
COLUMNS, HEIGHT = 3, 50.0  # panels side by side, and mm of a row of them
ROW, SYMBOL = 5.5, 1.3  # mm of a row of symbols, and at least of each symbol in it
LETTER, HANDLE, ENTRY = (
    3.8,
    34.0,
    4.2,
)  # of a legend: points of a letter and of the line beside a label, mm of a row
MOST_SYMBOLS = 25  # means of a curve that have a symbol each
DIGITS = (
    (1.0, 2.0, 5.0),
    (1.0, 3.0),
)  # that have a label in each decade, by the room that there is
# Columns of a table of series that may be missing: ends of the interval, and what came of the trials.
OPTIONAL = {"low": np.nan, "high": np.nan, "marked": False, "failed": False}

Styles = Mapping[str, MethodStyle]


@dataclass(frozen=True)
class Panel:
    """What a panel shows."""

    label: str  # quantity with its unit; panels with the same label share its axis
    title: str = ""  # what tells panels of the same quantity apart
    truth: float | None = None  # true value, which is drawn as a line
    limits: tuple[float, float] | None = None  # limits of the axis of the quantity
    xlabel: str = ""  # what the quantity is drawn against
    log: str = ""  # axes that are logarithmic, "x", "y" or "xy"
    joined: bool = True  # whether lines join the symbols, and intervals are bands


def panel_grid(
    count: int, columns: int, height: float, *, width: float = TWO_COLUMNS, **options: Any
) -> tuple[DataFigure, np.ndarray]:
    """Make a figure with panels in rows of a height [mm], and leave the rest of the last row empty.

    `finish` leaves the labels of a shared axis to the outer panels. Returns the panels, shape (count,).
    """
    columns = min(columns, count)
    rows = -(-count // columns)
    figure = DataFigure(figsize=(width / 25.4, height * rows / 25.4), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options).ravel()
    for axis in axes[count:]:
        axis.set_visible(False)
    return figure, axes[:count]


@matplotlib.rc_context(STYLE)
def draw_panels(
    table: pd.DataFrame,
    panels: Mapping[str, Panel],
    styles: Styles | None = None,
    *,
    columns: int = COLUMNS,
    height: float = HEIGHT,
    **options: Any,
) -> tuple[DataFigure, np.ndarray]:
    """Draw the curves of a table, `value` against `x` for each `series` of each `panel`, with what `OPTIONAL` has.

    Labels with a low line in front are not in the legend, which `finish` adds. Returns the panels, too.
    """
    styles = styles or ordinal_styles(dict.fromkeys(table["series"]))
    figure, axes = panel_grid(len(panels), columns, height, **options)
    rows = table.assign(**{name: value for name, value in OPTIONAL.items() if name not in table})
    parts = dict(list(rows.groupby(["panel", "series"], sort=False)))
    first: dict[str, Axes] = {}  # panel of each quantity
    for axis, (name, panel) in zip(axes, panels.items(), strict=True):
        axis.set(xlabel=panel.xlabel, ylabel=panel.label, title=panel.title)
        if panel.label in first:
            axis.sharey(first[panel.label])
        first.setdefault(panel.label, axis)
        for number, series in enumerate(dict.fromkeys(table["series"])):
            if (name, series) in parts:
                edge = 0.03 + 0.04 * number
                _draw_curve(
                    axis,
                    parts[name, series],
                    styles[series.lstrip("_")],
                    series,
                    edge,
                    joined=panel.joined,
                )
        if panel.truth is not None:
            axis.axhline(panel.truth, **REFERENCE_LINE, label="true value", zorder=1.5)
        if panel.limits:
            axis.set_ylim(panel.limits)
        for direction in panel.log:
            set_logarithmic(axis, direction)
    figure.data = name_quantities(table, panels)
    return figure, axes


@matplotlib.rc_context(STYLE)
def estimates_figure(
    table: pd.DataFrame,
    panels: Mapping[str, Panel],
    *,
    levels: Mapping[str, tuple[float, dict[str, Any]]] | None = None,
    styles: Styles | None = None,
) -> DataFigure:
    """Means with their intervals: a panel for each quantity, a row for each condition, a symbol for each method.

    Intervals are from `low` to `high`, or `margin` around the value. Arrow heads stand for values beyond the limits.
    `levels` are further lines in all panels, by their labels, with their looks.
    """
    styles = styles or ordinal_styles(dict.fromkeys(table["series"]))
    if "margin" in table:
        table = table.assign(
            low=table["value"] - table["margin"], high=table["value"] + table["margin"]
        )
    table = table.rename(columns={"fault": "marked"})
    names, series = list(dict.fromkeys(table["row"])), list(dict.fromkeys(table["series"]))
    shift = 0.8 / max(5, len(series)) * (np.arange(len(series)) - 0.5 * (len(series) - 1))
    rows = table.assign(**{name: value for name, value in OPTIONAL.items() if name not in table})
    rows["height"] = rows["row"].map(names.index) + rows["series"].map(
        dict(zip(series, shift, strict=True))
    )
    alike = len({(panel.label, panel.limits) for panel in panels.values()}) == 1
    height = max(ROW, SYMBOL * len(series)) * len(names) + 14.0
    figure, axes = panel_grid(len(panels), COLUMNS, height, sharex=alike, sharey=True)
    for axis, (name, panel) in zip(axes, panels.items(), strict=True):
        axis.set(
            xlabel=panel.label, xlim=panel.limits, title=panel.title, ylim=(len(names) - 0.5, -0.5)
        )
        axis.set_yticks(range(len(names)), names)
        for label, part in rows[rows["panel"] == name].groupby("series", sort=False):
            _draw_symbols(
                axis, part, panel.limits or (-np.inf, np.inf), styles[str(label)], str(label)
            )
        truth = {} if panel.truth is None else {"true value": (panel.truth, REFERENCE_LINE)}
        for label, (value, look) in {**(levels or {}), **truth}.items():
            axis.axvline(value, label=label, **{"zorder": 1.5, **look})
        if panel.log:
            set_logarithmic(axis)
    figure.data = name_quantities(table, panels)
    return finish(figure)


def _draw_symbols(
    axis: Axes, rows: pd.DataFrame, limits: tuple[float, float], style: MethodStyle, label: str
) -> None:
    """Symbols and intervals of a series; arrow heads at the limits of the panel for what is beyond."""
    low, high = limits
    value, heights = rows["value"].to_numpy(float), rows["height"].to_numpy()
    axis.hlines(heights, rows["low"], rows["high"], color=style.colour, lw=0.9, zorder=2)
    axis.plot(
        np.where((value < low) | (value > high), np.nan, value),
        heights,
        **style.symbol,
        ls="",
        label=label,
    )
    arrow: dict[str, Any] = {
        "color": style.colour,
        "ls": "",
        "ms": 5.0,
        "mew": 0.0,
        "clip_on": False,
        "zorder": 3,
    }
    for beyond, edge, marker in (
        (value < low, low, 8),
        (value > high, high, 9),
    ):  # carets, their tips at the edge
        if beyond.any():
            axis.plot(np.full(beyond.sum(), edge), heights[beyond], marker=marker, **arrow)
    marked, failed = rows["marked"].to_numpy(bool), rows["failed"].to_numpy(bool)
    draw_marks(axis, value.clip(low, high), heights, marked, failed, style.colour, edge=None)


def _draw_curve(
    axis: Axes, rows: pd.DataFrame, style: MethodStyle, label: str, edge: float, *, joined: bool
) -> None:
    """A curve with its band, or symbols with bars; marks of failures, those of lost means at a height in the panel."""
    x, value, low, high = (rows[name].to_numpy(float) for name in ("x", "value", "low", "high"))
    look = style.curve if len(rows) <= MOST_SYMBOLS else style.line
    if not joined:
        look = {**style.symbol, "ls": ""}
        axis.vlines(x, low, high, color=style.colour, lw=0.9)
    elif np.isfinite(low).any():
        axis.fill_between(x, low, high, color=style.colour, alpha=BAND, lw=0)
    axis.plot(x, value, **look, label=label)
    draw_marks(
        axis,
        x,
        value,
        rows["marked"].to_numpy(bool),
        rows["failed"].to_numpy(bool),
        style.colour,
        edge,
    )


def draw_marks(
    axis: Axes,
    x: np.ndarray,
    y: np.ndarray,
    marked: np.ndarray,
    failed: np.ndarray,
    colour: str,
    edge: float | None,
) -> None:
    """Draw rings around means with failures or warnings, and crosses at an edge of a panel where every trial failed.

    The edge is the lower one, where the crosses have a height in the panel, or without a height the left one.
    Shapes: x, y, marked, failed (N,).
    """
    marked = marked & np.isfinite(y) & np.isfinite(x)
    if marked.any():
        axis.plot(x[marked], y[marked], **FAULT_RING)
    if failed.any():
        cross: dict[str, Any] = {
            "marker": "x",
            "ms": 4.5,
            "ls": "",
            "color": colour,
            "zorder": 4,
            "clip_on": False,
        }
        near = np.full(failed.sum(), 0.02 if edge is None else edge)
        places = (near, y[failed]) if edge is None else (x[failed], near)
        transform = axis.get_yaxis_transform() if edge is None else axis.get_xaxis_transform()
        axis.plot(*places, transform=transform, label=ALL_FAILED, **cross)


def note_lowest(axis: Axes, lowest: float) -> None:
    """Note the lowest mean where a curve leaves the panel below."""
    if lowest < axis.get_ylim()[0]:
        axis.annotate(f"lowest mean: {lowest:.4g}", (0.03, 0.03), **NOTE)


def set_logarithmic(axis: Axes, direction: str = "x", room: int = 6) -> None:
    """Logarithmic scale of what is drawn, with numbers instead of powers, as many as there is room for."""
    axis.set(**{f"{direction}scale": "log"})
    scale, (low, high) = (
        (axis.xaxis, axis.get_xlim()) if direction == "x" else (axis.yaxis, axis.get_ylim())
    )
    decades = np.log10(high / low)
    scale.set_major_locator(
        LogLocator(subs=next((part for part in DIGITS if len(part) * decades < room), (1.0,)))
    )
    scale.set_major_formatter("{x:g}")
    scale.set_minor_formatter("")


def split_label(label: str) -> tuple[str, str]:
    """Split the label of an axis into the quantity and its unit."""
    quantity, bracket, unit = label.replace("\n", " ").rpartition(" [")
    return (quantity, unit.rstrip("]")) if bracket else (label, "")


def name_quantities(table: pd.DataFrame, panels: Mapping[str, Panel]) -> pd.DataFrame:
    """What is drawn as a table for readers: each row with the quantity, the unit and the title of its panel."""
    table = table[table["panel"].isin(panels)].reset_index(drop=True)
    facts = {
        name: (*split_label(panel.label), panel.title.replace("\n", " "), panel.xlabel, panel.truth)
        for name, panel in panels.items()
    }
    columns = ["quantity", "unit", "panel", "against", "true_value"]
    names = pd.DataFrame([facts[name] for name in table["panel"]], columns=columns)
    own = table.assign(series=table["series"].str.lstrip("_")).drop(columns="panel")
    return names.join(own)


@matplotlib.rc_context(STYLE)
def finish(figure: DataFigure) -> DataFigure:
    """Leave the labels of shared axes to the outer panels, and add the legend."""
    shown = {axis: axis.get_subplotspec() for axis in figure.axes if axis.get_visible()}
    places = {
        (spec.rowspan.start, spec.colspan.start): axis for axis, spec in shown.items() if spec
    }
    labels = {axis: (axis.get_xlabel(), axis.get_ylabel()) for axis in shown}
    for (row, column), axis in places.items():
        left, below = places.get((row, column - 1)), places.get((row + 1, column))
        if (
            left
            and axis.get_shared_y_axes().joined(axis, left)
            and labels[left][1] == labels[axis][1]
        ):
            axis.set_ylabel("")
            axis.tick_params(labelleft=False)
        inner = (
            below
            and axis.get_shared_x_axes().joined(axis, below)
            and labels[below][0] == labels[axis][0]
        )
        axis.tick_params(labelbottom=not inner)
        axis.set_xlabel("" if inner else axis.get_xlabel())
    add_legend(figure)
    return figure


def add_legend(figure: DataFigure) -> None:
    """Put the entries of all lines below the panels, as many in a row as fit: each label once, those of marks last."""
    lines: dict[str, Line2D] = {}
    for line in (line for axis in figure.axes for line in axis.get_lines()):
        lines.setdefault(str(line.get_label()), line)
    names = sorted((name for name in lines if name[0] != "_"), key=lambda name: _rank(lines[name]))
    if names:
        entry = LETTER * max(map(len, names)) + HANDLE
        columns = max(1, min(len(names), int(72.0 * figure.get_figwidth() / entry)))
        figure.set_figheight(figure.get_figheight() + ENTRY / 25.4 * -(-len(names) // columns))
        figure.legend(
            [lines[name] for name in names], names, loc="outside lower center", ncols=columns
        )


def _rank(line: Line2D) -> int:
    """Place of an entry in a legend: series, other marks, marks of failures."""
    return (
        2 if line.get_label() in (FAULT_RING["label"], ALL_FAILED) else int(line.get_gid() == MARK)
    )
