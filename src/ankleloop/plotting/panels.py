"""Figures of panels in rows: a tidy table and what each panel shows become curves with bands, marks and a legend."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.markers import CARETLEFTBASE, CARETRIGHTBASE
from matplotlib.ticker import LogLocator, NullLocator
from numpy.typing import ArrayLike

from ankleloop.plotting.style import (
    MARK,
    REFERENCE_LINE,
    STYLE,
    TWO_COLUMNS,
    DataFigure,
    MethodStyle,
    ordinal_styles,
)

FAULT = "fault"  # group of the marks of failures and warnings
LEGEND_PLACES = {None: 0, MARK: 1, FAULT: 2}  # of groups, behind the series
# Around the symbol of a mean: some of its trials failed, or came with a warning.
FAULT_RING: dict[str, Any] = {
    "marker": "o",
    "ms": 6.0,
    "mfc": "none",
    "mec": "#666666",
    "mew": 0.5,
    "zorder": 4,
    "label": "with failures or warnings",
    "gid": FAULT,
}
# On a curve, where every method has some.
CURVE_RING = FAULT_RING | {"label": "more failures or warnings than others of the curve"}
# At an edge of a panel, in the colour of the method: every trial of a mean failed.
FAILURE_CROSS: dict[str, Any] = {
    "marker": "x",
    "ms": 4.5,
    "zorder": 4,
    "clip_on": False,
    "label": "every trial failed",
    "gid": FAULT,
}
# At an edge of a panel, in the colour of the method: the mean lies beyond it.
ARROW_HEAD: dict[str, Any] = {"ms": 5.0, "mew": 0.0, "zorder": 3, "clip_on": False}
LEFT_EDGE = 0.02  # place of crosses in panels of symbols
BAND_OPACITY = 0.22
NOTE: dict[str, Any] = {"xycoords": "axes fraction", "fontsize": 6.5, "color": "#555555"}
PANEL_COLUMNS = 3  # panels side by side
PANEL_HEIGHT = 50.0  # mm of a row of panels
CONDITION_HEIGHT = 5.5  # mm of a row of symbols
SYMBOL_HEIGHT = 1.3  # mm, at least, of each symbol in it
LEGEND_LETTER = 3.8  # points
LEGEND_HANDLE = 34.0  # points of the line beside a label
LEGEND_ROW = 4.2  # mm
LEGEND_GAP = 1.5  # mm above it
MOST_SYMBOLS = 25  # means of a curve that have a symbol each
MOST_LABELS = 6  # of a logarithmic axis
# Digits that have a label in each decade, by the room that there is.
DECADE_DIGITS = ((1.0, 2.0, 5.0), (1.0, 3.0), (1.0,))
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
    count: int,
    columns: int,
    height: float,
    *,
    width: float = TWO_COLUMNS,
    figure: Any = None,
    **options: Any,
) -> Any:
    """Make a figure with panels in rows of a height [mm], or fill one; the rest of the last row is empty.

    `finish` leaves the labels of a shared axis to the outer panels.
    """
    columns = min(columns, count)
    rows = -(-count // columns)
    if figure is None:
        figure = DataFigure(figsize=(width / 25.4, height * rows / 25.4))
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    for axis in axes.flat[count:]:
        axis.remove()
    return figure


def curve(panel: str, series: str, x: ArrayLike, value: ArrayLike, **columns: Any) -> pd.DataFrame:
    """Rows of the table of a figure: a series in a panel, and further columns."""
    return pd.DataFrame({"panel": panel, "series": series, **columns, "x": x, "value": value})


@matplotlib.rc_context(STYLE)
def draw_panels(
    table: pd.DataFrame,
    panels: Mapping[str, Panel],
    styles: Styles | None = None,
    *,
    columns: int = PANEL_COLUMNS,
    height: float = PANEL_HEIGHT,
    **options: Any,
) -> DataFigure:
    """Draw the curves of a table, `value` against `x` for each `series` of each `panel`, with what `OPTIONAL` has.

    Labels with a low line in front are not in the legend, which `finish` adds.
    """
    styles = styles or ordinal_styles(table["series"])
    figure = panel_grid(len(panels), columns, height, **options)
    rows = table.assign(**{**OPTIONAL, **table})
    rows["number"] = pd.factorize(rows["series"])[0]
    first: dict[str, Axes] = {}  # panel of each quantity
    for axis, (name, panel) in zip(figure.axes, panels.items(), strict=True):
        axis.set(xlabel=panel.xlabel, ylabel=panel.label, title=panel.title)
        if panel.label in first:
            axis.sharey(first[panel.label])
        first.setdefault(panel.label, axis)
        for number, part in rows[rows["panel"] == name].groupby("number"):
            _draw_curve(axis, part, styles, 0.03 + 0.04 * number, joined=panel.joined)
        if panel.truth is not None:
            axis.axhline(panel.truth, **REFERENCE_LINE, label="true value", zorder=1.5)
        if panel.limits:
            axis.set_ylim(panel.limits)
        for direction in panel.log:
            set_logarithmic(axis, direction)
    figure.data = name_quantities(table, panels)
    return figure


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
    styles = styles or ordinal_styles(table["series"].dropna())
    if "margin" in table:
        table = table.assign(
            low=table["value"] - table["margin"], high=table["value"] + table["margin"]
        )
    rows = table.assign(**{**OPTIONAL, **table})
    condition, conditions = pd.factorize(rows["row"])
    number, series = pd.factorize(rows["series"])
    distance = 0.8 / max(5, len(series))
    rows["height"] = condition + distance * (number - 0.5 * (len(series) - 1))
    same_axes = len({(panel.label, panel.limits) for panel in panels.values()}) == 1
    height = max(CONDITION_HEIGHT, SYMBOL_HEIGHT * len(series)) * len(conditions) + 14.0
    figure = panel_grid(len(panels), PANEL_COLUMNS, height, sharex=same_axes, sharey=True)
    for axis, (name, panel) in zip(figure.axes, panels.items(), strict=True):
        bottom = len(conditions) - 0.5
        axis.set(xlabel=panel.label, ylim=(bottom, -0.5), title=panel.title)
        if panel.limits:
            axis.set_xlim(panel.limits)
        axis.set_yticks(range(len(conditions)), conditions)
        for label, part in rows[rows["panel"] == name].groupby("series", sort=False):
            _draw_symbols(axis, part, styles[str(label)], panel.limits or (-np.inf, np.inf))
        lines = dict(levels or {})
        if panel.truth is not None:
            lines["true value"] = (panel.truth, REFERENCE_LINE)
        for label, (value, look) in lines.items():
            axis.axvline(value, label=label, **{"zorder": 1.5, **look})
        if panel.log:
            set_logarithmic(axis, "x")
        else:  # long numbers stand beside one another
            axis.locator_params("x", nbins=5)
    figure.data = name_quantities(table, panels)
    return finish(figure)


def _draw_symbols(
    axis: Axes, rows: pd.DataFrame, style: MethodStyle, limits: tuple[float, float]
) -> None:
    """Symbols and intervals of a series; arrow heads at the limits of the panel for what is beyond."""
    low, high = limits
    value, heights = rows[["value", "height"]].to_numpy(float).T
    axis.hlines(heights, rows["low"], rows["high"], color=style.colour, lw=0.9, zorder=2)
    below = value < low
    above = value > high
    inside = np.where(below | above, np.nan, value)
    axis.plot(inside, heights, **style.symbol, ls="", label=rows["series"].iloc[0])
    places = value.clip(low, high)
    for beyond, marker in ((below, CARETLEFTBASE), (above, CARETRIGHTBASE)):
        _draw_marks(axis, beyond, places, heights, marker=marker, color=style.colour, **ARROW_HEAD)
    _draw_marks(axis, rows["marked"], places, heights, **FAULT_RING)
    _draw_marks(
        axis,
        rows["failed"],
        np.full_like(heights, LEFT_EDGE),
        heights,
        color=style.colour,
        transform=axis.get_yaxis_transform(),
        **FAILURE_CROSS,
    )


def _draw_curve(
    axis: Axes, rows: pd.DataFrame, styles: Styles, cross_height: float, *, joined: bool
) -> None:
    """A curve with its band, or symbols with bars; crosses of lost means are at a height in the panel."""
    label = rows["series"].iloc[0]
    style = styles[label.lstrip("_")]
    x, value, low, high = rows[["x", "value", "low", "high"]].to_numpy(float).T
    look = style.curve if len(rows) <= MOST_SYMBOLS else style.line
    if not joined:
        look = {**style.symbol, "ls": ""}
        axis.vlines(x, low, high, color=style.colour, lw=0.9)
    elif np.isfinite(low).any():
        axis.fill_between(x, low, high, color=style.colour, alpha=BAND_OPACITY, lw=0)
    axis.plot(x, value, **look, label=label)
    _draw_marks(axis, rows["marked"], x, value, **(CURVE_RING if joined else FAULT_RING))
    _draw_marks(
        axis,
        rows["failed"],
        x,
        np.full_like(x, cross_height),
        color=style.colour,
        transform=axis.get_xaxis_transform(),
        **FAILURE_CROSS,
    )


def _draw_marks(axis: Axes, chosen: ArrayLike, x: np.ndarray, y: np.ndarray, **look: Any) -> None:
    """Marks at the places that are chosen and exist; without any the legend has no entry. Shapes: all (N,)."""
    shown = np.asarray(chosen, dtype=bool) & np.isfinite(x + y)
    if shown.any():
        axis.plot(x[shown], y[shown], ls="", **look)


def note_lowest(axis: Axes, lowest: float) -> None:
    """Note the lowest mean where a curve leaves the panel below."""
    if lowest < axis.get_ylim()[0]:
        axis.annotate(f"lowest mean: {lowest:.4g}", (0.03, 0.03), **NOTE)


def set_logarithmic(axes: Axes, direction: str) -> None:
    """Logarithmic scale of what is drawn, with numbers instead of powers, as many as there is room for."""
    axes.set(**{f"{direction}scale": "log"})
    axis = getattr(axes, f"{direction}axis")
    low, high = axis.get_view_interval()
    decades = np.log10(high / low)
    fitting = (digits for digits in DECADE_DIGITS if len(digits) * decades < MOST_LABELS)
    axis.set_major_locator(LogLocator(subs=next(fitting, DECADE_DIGITS[-1])))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())  # matplotlib takes a millisecond for each tick


def name_quantities(table: pd.DataFrame, panels: Mapping[str, Panel]) -> pd.DataFrame:
    """What is drawn as a table for readers: each row with the quantity, the unit and the title of its panel."""
    facts = {}
    for name, panel in panels.items():
        quantity, _, unit = panel.label.replace("\n", " ").partition(" [")
        facts[name] = {
            "quantity": quantity,
            "unit": unit.rstrip("]"),
            "panel": panel.title.replace("\n", " "),
            "against": panel.xlabel,
            "true_value": panel.truth,
        }
    shown = table[table["panel"].isin(panels)].reset_index(drop=True)
    names = pd.DataFrame(map(facts.get, shown["panel"]))
    return names.join(shown.assign(series=shown["series"].str.lstrip("_")).drop(columns="panel"))


@matplotlib.rc_context(STYLE)
def finish(figure: DataFigure) -> DataFigure:
    """Leave the labels of shared axes to the outer panels, add the legend, and make room for all labels."""
    places = {}
    for axis in figure.axes:
        place = axis.get_subplotspec()  # a colour bar has none
        if place:
            places[place.rowspan.start, place.colspan.start] = axis
    for (row, column), axis in places.items():
        left = places.get((row, column - 1))
        if left and axis.get_shared_y_axes().joined(axis, left):
            axis.set_ylabel("")
            axis.tick_params(labelleft=False)
        below = places.get((row + 1, column))
        if below and axis.get_shared_x_axes().joined(axis, below):
            axis.set_xlabel("")
            axis.tick_params(labelbottom=False)
        else:  # also where the panels below are hidden
            axis.tick_params(labelbottom=True)
    # The layout of another figure, or of a part of one, is its owner's.
    if not isinstance(figure, DataFigure) or figure.get_layout_engine() is not None:
        add_legend(figure)
        return figure
    figure.tight_layout(pad=0.4)  # once, where an engine would do it for every drawing
    height = figure.get_figheight()
    add_legend(figure)
    # Panels keep their size, and their distance from the upper edge.
    share = height / figure.get_figheight()
    margins = figure.subplotpars
    bottom = 1.0 - share * (1.0 - margins.bottom)
    top = 1.0 - share * (1.0 - margins.top)
    figure.subplots_adjust(bottom=bottom, top=top)
    return figure


def add_legend(figure: DataFigure) -> None:
    """Put the entries of all lines below the panels, as many in a row as fit: each label once, those of marks last."""
    lines: dict[str, Artist] = {}
    for axis in figure.axes:
        for line, label in zip(*axis.get_legend_handles_labels(), strict=True):
            lines.setdefault(label, line)
    if not lines:
        return
    shown = sorted(lines.values(), key=lambda line: LEGEND_PLACES[line.get_gid()])
    width = LEGEND_LETTER * max(map(len, lines)) + LEGEND_HANDLE
    columns = max(1, min(len(lines), int(72.0 * figure.bbox.width / figure.dpi / width)))
    rows = -(-len(lines) // columns)
    if isinstance(figure, DataFigure):  # the height of another one is its owner's
        space = (LEGEND_ROW * rows + LEGEND_GAP) / 25.4
        figure.set_figheight(figure.get_figheight() + space)
    figure.legend(handles=shown, loc="outside lower center", ncols=columns)
