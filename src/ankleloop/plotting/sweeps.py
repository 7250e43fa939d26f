"""Pictures of a sweep: means over each of its parameters as lines, and over two of them as maps."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from ankleloop.plotting.curves import draw_curve, note_lowest
from ankleloop.plotting.maps import draw_cells
from ankleloop.plotting.method_styles import MethodStyle
from ankleloop.plotting.panels import add_legend, new_figure, panel_grid, split_label
from ankleloop.plotting.style import FAULT_RING, MARK, NOTE, REFERENCE_LINE, STYLE, DataFigure
from ankleloop.plotting.sweep_axes import SweepAxis

LABEL = 18  # characters of a line of a label beside a row of panels
LEGEND = 60  # characters of a line of an entry
MAP_COLUMNS = 4
MAP_TITLE = 84  # characters of the titles of all maps in a row
PANEL, MAP, LINE = 36.0, 34.0, 3.4  # mm of a row of lines and of maps, and of a line of a title
DIFFERENCE_STYLE = MethodStyle("#222222", "o")
FAULT_SHARE = 0.05  # of the trials of a mean that failed or came with a warning, from which on it is marked
BOUNDS = {"high": (-100.0, 110.0), "zero": (-200.0, 200.0)}  # %, beyond which a value says no more than that it is lost
MAP_ROOM = 22  # numbers side by side in all maps of a row
NO_VALUE: dict[str, Any] = {"ls": "", "marker": "x", "ms": 4.0, "color": "#777777", "gid": MARK, "label": "no value"}
NO_POINT: dict[str, Any] = {"ls": "", "marker": "s", "ms": 5.0, "color": "#d5d5d5", "gid": MARK, "label": "no point"}


@dataclass(frozen=True)
class SweepSeries:
    """A method, or the difference of two."""

    method: str  # value of the column `method`
    label: str  # its name in the legend or the title
    style: MethodStyle = DIFFERENCE_STYLE
    is_difference: bool = False


@dataclass(frozen=True)
class SweepPanel:
    """A quantity of several methods, or of the difference of two."""

    quantity: str  # value of the column `quantity`
    label: str  # its name with unit
    series: Sequence[SweepSeries]  # the methods, or a difference alone
    desired: Literal["high", "zero", "low"] | None = None  # what a method should reach; "zero" for a difference
    truth: float | None = None  # true value, where all points have the same
    # Whether means of which trials failed or came with a warning are marked; their share itself needs no marks.
    marked: bool = True

    @property
    def reference(self) -> float | None:
        """Value that is right: the truth, or zero for an error or a difference."""
        return 0.0 if self.desired == "zero" else self.truth

    def rows(self, table: pd.DataFrame) -> pd.DataFrame:
        """Its rows of a summary, with what is marked."""
        rows = table[(table["quantity"] == self.quantity) & table["method"].isin([item.method for item in self.series])]
        failed = (rows["failures"] == rows["trials"]) & (rows["trials"] > 0)
        faults = rows["failures"] + rows["warnings"]
        marked = (faults > 0) & (faults >= FAULT_SHARE * rows["trials"]) & ~failed
        return rows.assign(marked=marked & self.marked, failed=failed & self.marked)


@matplotlib.rc_context(STYLE)
def lines_figure(table: pd.DataFrame, axes: Sequence[SweepAxis], panels: Sequence[SweepPanel]) -> DataFigure:
    """Means with their bands over each parameter: panels side by side for one, a row for each quantity for several.

    The table has a row for each quantity, method, `parameter` and `value`, with `low` and `high`.
    """
    if len(axes) == 1:
        figure, flat = panel_grid(len(panels), 3, 46.0)
        grid = np.array(flat)[:, None]
    else:
        figure = new_figure(PANEL * len(panels) + 8.0)
        grid = figure.subplots(len(panels), len(axes), squeeze=False, sharex="col", sharey="row")
    for row, panel in zip(grid, panels, strict=True):
        rows = panel.rows(table)
        for cell, axis in zip(row, axes, strict=True):
            _draw_lines(cell, rows[rows["parameter"] == axis.name], axis, panel)
            axis.set_ticks(cell, "x", room=6 if len(axes) <= 2 else 4)
        values = np.r_[rows[["mean", "low", "high"]].to_numpy(dtype=float).ravel(), panel.reference or np.nan]
        low, high = value_limits(values, panel.desired)
        margin = 0.06 * (high - low) or 0.06 * abs(low) or 1.0
        row[0].set_ylim(low - margin, high + margin)
        row[0].set_ylabel(textwrap.fill(panel.label, LABEL))
        note_lowest(row[0], rows["mean"].min())
    for cell in grid[: -min(3, len(panels))].flat if len(axes) == 1 else grid[:-1].flat:
        cell.set_xlabel("")
    add_legend(figure, grid.flat)
    labels = {axis.name: axis.label for axis in axes}
    figure.data = _tabulate(table.assign(parameter=table["parameter"].map(labels)), panels, ["parameter", "value"])
    return figure


def _draw_lines(cell: Axes, rows: pd.DataFrame, axis: SweepAxis, panel: SweepPanel) -> None:
    """Means of all methods over one parameter; values without an order have bars, and no line between them."""
    if panel.reference is not None:
        label = "true value" if panel.desired is None else "_zero"
        cell.axhline(panel.reference, **REFERENCE_LINE, label=label, zorder=0.5)
    if axis.kind == "listed":
        cell.set_xlim(-0.5, len(axis.values) - 0.5)
    if not rows["mean"].notna().any():
        cell.annotate("not estimated", (0.5, 0.5), ha="center", va="center", **NOTE)
    for number, item in enumerate(panel.series):
        part = rows[rows["method"] == item.method]
        part = part.assign(x=axis.places(part["value"])).sort_values("x")
        label = textwrap.fill(item.label, LEGEND)
        if axis.ordered:
            draw_curve(cell, part, item.style, label, 0.03 + 0.06 * number)
            continue
        x = part["x"] + 0.12 * (number - 0.5 * (len(panel.series) - 1))
        cell.vlines(x, part["low"], part["high"], color=item.style.colour, lw=1.2)
        cell.plot(x, part["mean"], **item.style.symbol, ls="", label=label)
        cell.plot(x[part["marked"]], part.loc[part["marked"], "mean"], **FAULT_RING)


@matplotlib.rc_context({**STYLE, "axes.grid": False})
def maps_figure(
    table: pd.DataFrame,
    axes: tuple[SweepAxis, SweepAxis],
    panels: Sequence[SweepPanel],
    slices: Sequence[str] = ("",),
    *,
    is_grid: bool = True,
) -> DataFigure:
    """Means over two parameters: rows for each quantity, with a map for each method and for a difference of two.

    The table has a row for each quantity, method, `slice`, `x` and `y`. Points that are no grid are drawn one by one.
    """
    maps = [
        [(panel, item, name) for panel in group for item in panel.series for name in slices]
        for _, group in groupby(panels, key=lambda panel: panel.quantity)
    ]
    columns = min(MAP_COLUMNS, max(map(len, maps)))
    rows = [part[start : start + columns] for part in maps for start in range(0, len(part), columns)]
    texts = [[_wrap_title(item, name, columns) for _, item, name in row] for row in rows]
    height = MAP + LINE * max(text.count("\n") + 1 for row in texts for text in row)
    figure = new_figure(height * len(rows) + 4.0)
    grid = figure.subplots(len(rows), columns, squeeze=False, sharex=True, sharey=True)
    for cells, row, titles in zip(grid, rows, texts, strict=True):
        for number, (cell, (panel, item, name)) in enumerate(zip(cells, row, strict=False)):
            means = panel.rows(table)
            colours, extend = _choose_colours(means["mean"].to_numpy(dtype=float), panel)
            shown = means[(means["method"] == item.method) & (means["slice"] == name)]
            image = _draw_map(cell, shown, axes, colours, int(MAP_ROOM / columns) if is_grid else None)
            cell.set_title(titles[number])
            axes[0].set_ticks(cell, "x", room=18 // columns, listed=is_grid)
            axes[1].set_ticks(cell, "y", room=10, listed=is_grid)
            cell.set_ylabel(textwrap.fill(axes[1].label, LABEL + 4))
            if number + 1 == len(row) or row[number + 1][0] is not panel:
                label = textwrap.fill(panel.label, LABEL + 4)
                figure.colorbar(image, ax=cell, label=label, extend=extend, aspect=22, pad=0.02)
        for cell in cells[len(row) :]:
            cell.set_visible(False)
    _label_outside(grid)
    add_legend(figure, grid.flat)
    names = {"x": axes[0].label, "y": axes[1].label}
    figure.data = _tabulate(table, panels, ["x", "y", "slice"]).rename(columns=names)
    return figure


def _wrap_title(item: SweepSeries, name: str, columns: int) -> str:
    """Title of a map: the method, and the value of a further parameter."""
    lines = [textwrap.fill(text, MAP_TITLE // columns, break_on_hyphens=False) for text in (item.label, name) if text]
    return "\n".join(lines)


def _label_outside(grid: np.ndarray) -> None:
    """Leave the labels beside the first column of a grid, and below the last panel of each column."""
    for column in grid.T:
        shown = [cell for cell in column if cell.get_visible()]
        shown[-1].tick_params(labelbottom=True)
        for cell in shown[:-1]:
            cell.set_xlabel("")
    for cell in grid[:, 1:].flat:
        cell.set_ylabel("")


def _draw_map(
    cell: Axes, rows: pd.DataFrame, axes: tuple[SweepAxis, SweepAxis], colours: dict[str, Any], room: int | None
) -> ScalarMappable:
    """Cells of a grid, with numbers where there is room for so many side by side; without a room single points."""
    marked, empty = rows["marked"].to_numpy(dtype=bool), rows["mean"].isna().to_numpy()
    if room is None:
        x, y = axes[0].places(rows["x"]), axes[1].places(rows["y"])
        size = float(np.clip(3000 / max(len(rows), 1), 8, 45))
        image: ScalarMappable = cell.scatter(x, y, c=rows["mean"], s=size, lw=0.3, edgecolors="#555555", **colours)
    else:
        x, y = axes[0].numbers(rows["x"]), axes[1].numbers(rows["y"])
        means = np.full((len(axes[1].values), len(axes[0].values)), np.nan)
        means[y, x] = rows["mean"]
        texts = np.full(means.shape, "", dtype=object)
        texts[y, x] = [_format(mean) + "*" * int(mark) for mean, mark in zip(rows["mean"], marked, strict=True)]
        image = draw_cells(cell, means, **colours, texts=texts if means.shape[1] <= room else None)
        if len(rows) < means.size:
            cell.set_facecolor(NO_POINT["color"])
            cell.plot([], [], **NO_POINT)
        if means.shape[1] <= room:
            marked = np.zeros_like(marked)  # their numbers have an asterisk
    if marked.any():
        ring = 9.0 if room is None else min(6.0, 200.0 / len(axes[0].values))  # around a point, or in a cell
        cell.plot(x[marked], y[marked], **{**FAULT_RING, "ms": ring})
    if empty.any():
        cell.plot(x[empty], y[empty], **NO_VALUE)
    return image


def _format(mean: float) -> str:
    """A mean in few characters."""
    decimals = next((digits for limit, digits in ((10.0, 2), (100.0, 1), (1e4, 0)) if abs(mean) < limit), None)
    return "" if np.isnan(mean) else f"{mean:.0e}" if decimals is None else f"{mean:.{decimals}f}"


def _choose_colours(means: np.ndarray, panel: SweepPanel) -> tuple[dict[str, Any], str]:
    """Scale and colours of maps, and the ends at which values are beyond the scale.

    Colours diverge from zero for differences and errors, and from the truth of a parameter that all points share.
    """
    low, high = value_limits(means, panel.desired)
    cmap = "viridis"
    if panel.reference is not None:
        reach = max(abs(low - panel.reference), abs(high - panel.reference)) or 1.0
        low, high = panel.reference - reach, panel.reference + reach
        cmap = "RdBu" if panel.series[0].is_difference else "PuOr"
    elif low == high:
        low, high = low - 0.5, high + 0.5
    beyond = bool((means < low).any()), bool((means > high).any())
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[beyond]
    return {"norm": Normalize(low, high), "cmap": cmap}, extend


def _tabulate(table: pd.DataFrame, panels: Sequence[SweepPanel], columns: Sequence[str]) -> pd.DataFrame:
    """What a picture of a sweep draws as a table for readers, with quantities and units."""
    parts = []
    for panel in panels:
        rows, (quantity, unit) = panel.rows(table), split_label(panel.label)
        labels = {item.method: item.label for item in panel.series}
        parts.append(rows.assign(quantity=quantity, unit=unit, method=rows["method"].map(labels)))
    shown = ["quantity", "unit", "method", *columns, "mean", "low", "high", "trials", "failures", "warnings"]
    return pd.concat(parts, ignore_index=True)[shown]


def value_limits(values: np.ndarray, desired: str | None) -> tuple[float, float]:
    """Range of values without those that are lost, so that the others can be told apart."""
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0, 1.0
    if desired == "low":
        return 0.0, float(values.max()) or 1.0
    low, high = BOUNDS.get(desired or "", (-np.inf, np.inf))
    inside = values[(values >= low) & (values <= high)]
    if not inside.size:
        return (low, high) if np.isfinite(low) else (float(values.min()), float(values.max()))
    first, last = np.quantile(inside, [0.1, 0.9])
    reach = 3.0 * (last - first) or np.inf
    inliers = inside[(inside >= first - reach) & (inside <= last + reach)]
    return float(inliers.min()), float(inliers.max())
