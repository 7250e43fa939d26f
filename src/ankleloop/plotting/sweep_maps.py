"""Maps of a sweep over two parameters: cells of a grid, tiles of a random design, or single points."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ankleloop.plotting.fault_marks import draw_crosses, draw_rings
from ankleloop.plotting.legends import add_entries
from ankleloop.plotting.style import ALL_FAILED, FAULT_RING, STYLE, TWO_COLUMNS, DataFigure, inches
from ankleloop.plotting.sweep_axes import SweepAxis
from ankleloop.plotting.sweeps import SweepPanel, SweepSeries, mark_rows, tabulate_sweep, value_limits

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["NO_POINT", "NO_VALUE", "REGION_SHARE", "has_rings", "maps_figure"]

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
    series: Sequence[SweepSeries],
    difference: SweepSeries | None = None,
    slices: Sequence[str] = ("",),
) -> DataFigure:
    """Means over two parameters: a block for each quantity, with a panel for each method and for a difference of two.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns `x`, `y`, `slice`, `method`, `quantity`, `mean`, `trials`, `failures` and `warnings`, as
        `ankleloop.replication.sweep_cells.summarise_cells` gives them.
    axes : tuple of SweepAxis
        The parameters of the abscissa and the ordinate.
    edges : tuple of ndarray, or None
        Edges of the cells in either direction; None draws each point by itself.
    panels : sequence of SweepPanel
        The quantities.
    series : sequence of SweepSeries
        The methods.
    difference : SweepSeries, optional
        Difference of two methods; its colours diverge from zero.
    slices : sequence of str
        Values of the column `slice`, such as those of a third parameter, each of which has panels of its own.

    Returns
    -------
    DataFigure
        `data` has the means of all cells.
    """
    items = [[*series, *([difference] if difference and panel.difference else [])] for panel in panels]
    counts = [len(block) * len(slices) for block in items]
    columns = min(MOST_COLUMNS // len(slices) * len(slices), max(counts))
    lines = max(len(_title_lines(item, name, columns)) for block in items for item in block for name in slices)
    heights = [inches(-(-count // columns) * (PANEL[1] + LINE * lines) + 4.0) for count in counts]
    figure = DataFigure(figsize=(inches(TWO_COLUMNS), sum(heights)), layout="constrained")
    blocks = figure.subfigures(len(panels), 1, squeeze=False, height_ratios=heights).ravel()
    marks: dict[str, Any] = {}
    for block, panel, block_items in zip(blocks, panels, items, strict=True):
        rows = table[table["quantity"] == panel.quantity]
        marks |= _draw_block(block, rows, axes, edges, panel, block_items, slices, columns)
    add_entries(figure, {}, marks)
    figure.data = tabulate_sweep(table, axes, panels, [*series, *([difference] if difference else [])])
    return figure


def _draw_block(
    block: SubFigure,
    table: pd.DataFrame,
    axes: tuple[SweepAxis, SweepAxis],
    edges: Edges | None,
    panel: SweepPanel,
    items: Sequence[SweepSeries],
    slices: Sequence[str],
    columns: int,
) -> dict[str, Any]:
    """All panels of a quantity with their colour bars; returns the legend entries of the marks in them."""
    shown = [(item, name) for item in items for name in slices]
    rows = -(-len(shown) // columns)
    grid = block.subplots(rows, columns, squeeze=False)
    bars: dict[bool, tuple[Any, list[Axes], str]] = {}
    marks: dict[str, Any] = {}
    norms = {
        kind: _norm(table, panel, [item for item in items if (item.is_difference) == kind]) for kind in (False, True)
    }
    for number, axis in enumerate(grid.ravel()):
        if number >= len(shown):
            axis.set_visible(False)
            continue
        item, name = shown[number]
        part = table[(table["method"] == item.method) & (table["slice"] == name)]
        norm, cmap, extend = norms[item.is_difference]
        image, own = _draw_map(axis, part, edges, panel, {"norm": norm, "cmap": cmap})
        marks |= own
        axis.set_title("\n".join(_title_lines(item, name, columns)))
        _label_axes(axis, axes, number % columns == 0, number + columns >= len(shown), columns)
        bars.setdefault(item.is_difference, (image, [], extend))[1].append(axis)
    if edges is None:
        _share_limits(list(grid.ravel()[: len(shown)]))
    for is_difference, (image, own_axes, extend) in sorted(bars.items(), reverse=rows > 1, key=lambda item: item[0]):
        place = own_axes if rows == 1 else list(grid.ravel()[: len(shown)])
        label = panel.difference if is_difference else panel.label
        block.colorbar(image, ax=place, label=label.replace(" [", "\n["), extend=extend, aspect=22, pad=0.02)
    return marks


def _title_lines(item: SweepSeries, name: str, columns: int) -> list[str]:
    """Lines of the title of a panel: the method, and the value of a further parameter."""
    return [
        line for text in (item.label, name) for line in textwrap.wrap(text, TITLE // columns, break_on_hyphens=False)
    ]


def _share_limits(axes: Sequence[Axes]) -> None:
    """Equal limits of all panels, whose points may differ."""
    for name in ("x", "y"):
        limits = np.array([getattr(axis, f"get_{name}lim")() for axis in axes])
        for axis in axes:
            getattr(axis, f"set_{name}lim")(limits[:, 0].min(), limits[:, 1].max())


def _label_axes(axis: Axes, axes: tuple[SweepAxis, SweepAxis], first: bool, last: bool, columns: int) -> None:
    axes[0].set_ticks(axis, "x", room=6)
    axes[1].set_ticks(axis, "y", room=10)
    if first:
        axis.set_ylabel(textwrap.fill(axes[1].label, LABEL))
    else:
        axis.set_ylabel("")
        axis.tick_params(labelleft=False)
    words = textwrap.fill(axis.get_xlabel(), TITLE // columns)
    axis.set_xlabel(words if last else "")


def _norm(table: pd.DataFrame, panel: SweepPanel, items: Sequence[SweepSeries]) -> tuple[Normalize, str, str]:
    """Scale and colours of all panels of a quantity, and the ends at which values are beyond the scale."""
    means = table.loc[table["method"].isin([item.method for item in items]), "mean"].to_numpy()
    is_difference = bool(items) and items[0].is_difference
    low, high = value_limits(means, "zero" if is_difference else panel.desired)
    cmap = "viridis"
    if is_difference or panel.desired == "zero":
        high = max(abs(low), abs(high)) or 1.0
        low, cmap = -high, "RdBu" if is_difference else "PuOr"
    if low == high:
        low, high = low - 0.5, high + 0.5
    finite = means[np.isfinite(means)]
    below, above = bool((finite < low).any()), bool((finite > high).any())
    return Normalize(low, high), cmap, {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[below, above]


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
        corners = [
            [(x[column + across], y[row + up]) for across, up in ((0, 0), (1, 0), (1, 1), (0, 1))]
            for row, column in np.argwhere(empty)
        ]
        axis.add_collection(PolyCollection(corners, **HATCHED), autolim=False)
        marks[NO_VALUE] = Patch(**HATCHED)
    axis.set(xlim=x[[0, -1]], ylim=y[[0, -1]])
    if not panel.marked:
        return image, marks
    if has_rings(edges):
        return image, marks | _mark_places(axis, rows)
    return image, marks | _outline_regions(axis, edges, rows, index)


def has_rings(edges: Edges | None) -> bool:
    """Whether cells have room for rings; otherwise regions of them are outlined.

    Parameters
    ----------
    edges : tuple of ndarray, or None
        As of `maps_figure`.

    Returns
    -------
    bool
    """
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
