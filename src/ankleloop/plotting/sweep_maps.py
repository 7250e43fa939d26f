"""Maps of a sweep over two parameters: cells of a grid, tiles of a random design, or single points."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from itertools import groupby, product
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ankleloop.plotting.fault_marks import draw_crosses, draw_rings
from ankleloop.plotting.legends import add_entries
from ankleloop.plotting.style import ALL_FAILED, FAULT_RING, STYLE, TWO_COLUMNS, DataFigure, inches
from ankleloop.plotting.sweep_axes import SweepAxis
from ankleloop.plotting.sweeps import SweepPanel, SweepSeries, mark_rows, tabulate_sweep, value_limits

if TYPE_CHECKING:
    import pandas as pd

Edges = tuple[np.ndarray, np.ndarray]

NO_VALUE = "no value"
NO_POINT = "no point"
GREY = "#d5d5d5"  # of cells without a point: zero may be white
HATCHED: dict[str, Any] = {"hatch": "////", "facecolor": "#f4f4f4", "edgecolor": "#b5b5b5", "linewidth": 0.0}
MOST_COLUMNS = 4
TITLE = 84  # characters of the titles of all panels in a row
LABEL = 20  # characters of a line beside a panel
PANEL = (40.0, 34.0)  # mm, with labels, where four are side by side
LINE = 3.4  # mm of a line of a title
SMALLEST_CELL = 7.5  # pt: smaller cells have no room for a ring; regions of them are outlined
# Cells with room for a ring, in either direction.
ROOM = tuple(int(72 * 0.75 * inches(size) / SMALLEST_CELL) for size in PANEL)
REGION_SHARE = 0.1  # of the trials of a region that failed or came with a warning, from which on it is outlined
RASTERISED = 2000  # cells from which on they are a picture inside a PDF


@matplotlib.rc_context({**STYLE, "axes.grid": False, "hatch.linewidth": 0.6})
def maps_figure(
    table: pd.DataFrame,
    axes: tuple[SweepAxis, SweepAxis],
    edges: Edges | None,
    panels: Sequence[SweepPanel],
    slices: Sequence[str] = ("",),
) -> DataFigure:
    """Means over two parameters: a row for each quantity, with a map for each method and for a difference of two."""
    rows = [list(group) for _, group in groupby(panels, key=lambda panel: panel.quantity)]
    counts = [sum(len(panel.series) for panel in row) for row in rows]  # of methods and differences
    lines = -(-max(counts) // (MOST_COLUMNS // len(slices)))
    columns = -(-max(counts) // lines) * len(slices)
    heights = [-(-count * len(slices) // columns) for count in counts]
    titles = [_title_lines(item, name, columns) for panel in panels for item, name in product(panel.series, slices)]
    height = PANEL[1] + LINE * max(len(lines) for lines in titles)
    size = (inches(TWO_COLUMNS), inches(sum(heights) * height + 4.0))
    figure = DataFigure(figsize=size, layout="constrained")
    grid = figure.subplots(sum(heights), columns, squeeze=False, sharex=True, sharey=True)
    marks: dict[str, Any] = {}
    for row, part in zip(rows, np.split(grid, np.cumsum(heights)[:-1]), strict=True):
        places = iter(part.ravel())
        for panel in row:
            maps = [(next(places), item, name) for item, name in product(panel.series, slices)]
            for axis, item, name in maps:
                axis.set_title("\n".join(_title_lines(item, name, columns)))
            # A quantity whose maps are in several rows has its colour bars at the right of all of them.
            beside = [axis for axis, *_ in maps] if len(part) == 1 else list(part.ravel())
            marks |= _draw_maps(beside, panel.rows(table), edges, panel, maps)
        for axis in places:
            axis.set_visible(False)
    _label_axes(grid, axes)
    add_entries(figure, {}, marks)
    figure.data = tabulate_sweep(table, axes, panels)
    return figure


def _draw_maps(
    beside: Sequence[Axes],
    table: pd.DataFrame,
    edges: Edges | None,
    panel: SweepPanel,
    maps: Sequence[tuple[Axes, SweepSeries, str]],
) -> dict[str, Any]:
    """Maps of a quantity or of its difference, and a colour bar beside some axes; returns legend entries of marks."""
    colours, extend = _choose_colours(table["mean"].to_numpy(), panel)
    marks: dict[str, Any] = {}
    for axis, item, name in maps:
        rows = table[(table["method"] == item.method) & (table["slice"] == name)]
        image, own = _draw_map(axis, rows, edges, panel, colours)
        marks |= own
    label = textwrap.fill(panel.label, LABEL)
    beside[0].figure.colorbar(image, ax=beside, label=label, extend=extend, aspect=22, pad=0.02)
    return marks


def _title_lines(item: SweepSeries, name: str, columns: int) -> list[str]:
    """Lines of the title of a map: the method, and the value of a further parameter."""
    width = TITLE // columns
    return [line for text in (item.label, name) for line in textwrap.wrap(text, width, break_on_hyphens=False)]


def _label_axes(grid: np.ndarray, axes: tuple[SweepAxis, SweepAxis]) -> None:
    """Ticks of all panels; labels at the left, and below the last panel of each column."""
    for axis in grid.ravel():
        axes[0].set_ticks(axis, "x", room=6)
        axes[1].set_ticks(axis, "y", room=10)
    for axis in grid[:, 0]:
        axis.set_ylabel(textwrap.fill(axes[1].label, LABEL))
    for axis in grid[:, 1:].ravel():
        axis.set_ylabel("")
    for column in grid.T:
        last = [axis for axis in column if axis.get_visible()][-1]
        last.tick_params(labelbottom=True)
        last.set_xlabel(textwrap.fill(last.get_xlabel(), TITLE // grid.shape[1]))
        for axis in column:
            if axis is not last:
                axis.set_xlabel("")


def _choose_colours(means: np.ndarray, panel: SweepPanel) -> tuple[dict[str, Any], str]:
    """Scale and colours of maps, and the ends at which values are beyond the scale.

    Colours diverge from zero for differences and errors, and from the truth of a parameter that all points share.
    """
    low, high = value_limits(means, panel.desired)
    centre = 0.0 if panel.desired == "zero" else panel.truth
    cmap = "viridis"
    if centre is not None:
        reach = max(abs(low - centre), abs(high - centre)) or 1.0
        low, high, cmap = centre - reach, centre + reach, "RdBu" if panel.is_difference else "PuOr"
    elif low == high:
        low, high = low - 0.5, high + 0.5
    beyond = bool((means < low).any()), bool((means > high).any())
    extend = {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[beyond]
    return {"norm": Normalize(low, high), "cmap": cmap}, extend


def _draw_map(
    axis: Axes, rows: pd.DataFrame, edges: Edges | None, panel: SweepPanel, colours: dict[str, Any]
) -> tuple[Any, dict[str, Any]]:
    rows = rows.sort_values(["y", "x"])
    if edges is None:
        image, marks = _draw_points(axis, rows, panel, colours)
    else:
        image, marks = _draw_cells(axis, rows, edges, panel, colours)
    if len(rows) and not rows["mean"].notna().any() and (rows["failures"] < rows["trials"]).any():
        box = {"facecolor": "white", "edgecolor": "none", "pad": 2.0}
        axis.annotate("not estimated", (0.5, 0.5), xycoords="axes fraction", ha="center", va="center", bbox=box)
    return image, marks


def _draw_points(
    axis: Axes, rows: pd.DataFrame, panel: SweepPanel, colours: dict[str, Any]
) -> tuple[Any, dict[str, Any]]:
    """Points of an irregular design, coloured by their value."""
    valued = rows[rows["mean"].notna()]
    size = float(np.clip(3000 / max(len(rows), 1), 8, 45))
    image = axis.scatter(valued["x"], valued["y"], c=valued["mean"], s=size, lw=0.3, edgecolors="#555555", **colours)
    empty = rows[rows["mean"].isna()]
    marks: dict[str, Any] = {}
    if len(empty):
        axis.scatter(empty["x"], empty["y"], s=size, facecolors="none", edgecolors="#999999", lw=0.8)
        marks[NO_VALUE] = Line2D([], [], ls="", marker="o", mfc="none", mec="#999999", ms=4)
    return image, marks | (_mark_places(axis, rows) if panel.marked else {})


def _draw_cells(
    axis: Axes, rows: pd.DataFrame, edges: Edges, panel: SweepPanel, colours: dict[str, Any]
) -> tuple[Any, dict[str, Any]]:
    """Cells of a grid; hatched where there are trials but no value, and grey where there is no point."""
    x, y = edges
    index = tuple(
        np.clip(np.searchsorted(line, rows[name].to_numpy(), side="right") - 1, 0, line.size - 2)
        for line, name in ((y, "y"), (x, "x"))
    )
    shape = (y.size - 1, x.size - 1)
    means, present = np.full(shape, np.nan), np.zeros(shape, bool)
    means[index], present[index] = rows["mean"], True
    image = axis.pcolormesh(x, y, means, **colours, rasterized=means.size > RASTERISED)
    marks: dict[str, Any] = {}
    if not present.all():
        axis.set_facecolor(GREY)
        marks[NO_POINT] = Patch(facecolor=GREY)
    empty = present & ~np.isfinite(means)
    if empty.any():
        plain = ListedColormap([HATCHED["facecolor"]])
        axis.pcolor(x, y, np.ma.masked_where(~empty, empty), cmap=plain, **HATCHED)
        marks[NO_VALUE] = Patch(**HATCHED)
    axis.set(xlim=x[[0, -1]], ylim=y[[0, -1]])
    if not panel.marked:
        return image, marks
    if has_rings(edges):
        return image, marks | _mark_places(axis, rows)
    return image, marks | _outline_regions(axis, edges, rows, index)


def has_rings(edges: Edges | None) -> bool:
    """Whether cells have room for rings; otherwise regions of them are outlined."""
    return edges is None or all(line.size - 1 <= places for line, places in zip(edges, ROOM, strict=True))


def _mark_places(axis: Axes, rows: pd.DataFrame) -> dict[str, Any]:
    """Rings around cells or points with faults, and crosses where every trial failed."""
    marked, failed = mark_rows(rows)
    x, y = rows["x"].to_numpy(), rows["y"].to_numpy()
    before = len(axis.get_lines())
    if marked.any():
        ring = {"ls": "", "marker": "o", "ms": FAULT_RING["ms"], "mfc": "none", "mec": "white", "mew": 2.0}
        axis.plot(x[marked], y[marked], **ring, zorder=3.9)
    draw_rings(axis, x[marked], y[marked])
    draw_crosses(axis, x[failed], y[failed], "#222222", axis.transData)
    lines = {str(line.get_label()): line for line in axis.get_lines()[before:]}
    return {name: line for name, line in lines.items() if name in (FAULT_RING["label"], ALL_FAILED)}


def _outline_regions(axis: Axes, edges: Edges, rows: pd.DataFrame, index: tuple[np.ndarray, ...]) -> dict[str, Any]:
    """Outline blocks of small cells in which `REGION_SHARE` of the trials failed or came with a warning."""
    shape = edges[1].size - 1, edges[0].size - 1
    steps = [-(-count // places) for count, places in zip(shape, ROOM[::-1], strict=True)]
    blocks = tuple(number // step for number, step in zip(index, steps, strict=True))
    y, x = (np.r_[line[:-1:step], line[-1]] for line, step in zip(edges[::-1], steps, strict=True))
    trials, faults = np.zeros((y.size - 1, x.size - 1)), np.zeros((y.size - 1, x.size - 1))
    np.add.at(trials, blocks, rows["trials"])
    np.add.at(faults, blocks, rows["failures"] + rows["warnings"])
    marked = np.pad((faults > 0) & (faults >= REGION_SHARE * trials), 1)
    if not marked.any():
        return {}
    upright = np.argwhere(marked[1:-1, 1:] != marked[1:-1, :-1])
    level = np.argwhere(marked[1:, 1:-1] != marked[:-1, 1:-1])
    segments = [[(x[column], y[row]), (x[column], y[row + 1])] for row, column in upright]
    segments += [[(x[column], y[row]), (x[column + 1], y[row])] for row, column in level]
    for colour, width in (("white", 1.6), ("black", 0.7)):
        axis.add_collection(LineCollection(segments, colors=colour, lw=width, zorder=4), autolim=False)
    return {f"region {FAULT_RING['label']}": Line2D([], [], color="black", lw=0.9)}
