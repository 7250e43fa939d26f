"""Pictures of a sweep: means over each of its parameters as lines, and over two of them as maps."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby, pairwise, product
from typing import Any, Literal

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.patches import Rectangle

from ankleloop.plotting.panels import (
    FAULT_RING,
    Panel,
    draw_panels,
    finish,
    name_quantities,
    note_lowest,
    panel_grid,
    set_logarithmic,
)
from ankleloop.plotting.style import MARK, REFERENCE_LINE, STYLE, DataFigure, MethodStyle

MOST_LISTED = 12  # distinct values that are drawn one by one; more are drawn in bins
BINS = 10
LEAST_DECADE = 5.0  # largest over smallest value, from which on an axis may be logarithmic
NARROWEST = 0.25  # smallest over mean distance of neighbours; closer ones are listed, so that all can be read

LABEL = 22  # characters of a line of a label beside a panel
LEGEND = 60  # characters of a line of an entry
MAP_COLUMNS = 4
MAP_TITLE = 84  # characters of the titles of all maps in a row
PANEL, MAP = 38.0, 40.0  # mm of a row of lines and of maps
DIFFERENCE_STYLE = MethodStyle("#222222", "o")
FAULT_SHARE = 0.05  # of the trials of a mean that failed or came with a warning, from which on it is marked
BOUNDS = {"high": (-100.0, 110.0), "zero": (-200.0, 200.0)}  # %, beyond which a value says no more than that it is lost
MAP_ROOM = 22  # numbers side by side in all maps of a row
DARK = 0.5  # lightness of a cell from which on its number is black
FRAME = "#D55E00"  # of cells within a limit
MEAN = {"mean": "value"}
NUMBERS = ("panel", "series", "slice", "x_quantity", "x", "y_quantity", "y")  # columns of the table of a map
NO_VALUE: dict[str, Any] = {"ls": "", "marker": "x", "ms": 4.0, "color": "#777777", "gid": MARK, "label": "no value"}
NO_POINT: dict[str, Any] = {"ls": "", "marker": "s", "ms": 5.0, "color": "#d5d5d5", "gid": MARK, "label": "no point"}


@dataclass(frozen=True)
class SweepAxis:
    """Axis of a varied parameter."""

    name: str  # column of the parameter
    label: str  # its name with unit
    # Its distinct values: numbers in their order, then None, flags and texts as the points have them.
    values: tuple[Any, ...]
    words: Mapping[Any, str] = field(default_factory=dict)  # words for values that are no numbers, where they have any

    @classmethod
    def of(cls, name: str, label: str, values: Iterable[Any], words: Mapping[Any, str] | None = None) -> SweepAxis:
        """Axis for the values of all points; nan stands for None, as in tables."""
        distinct = dict.fromkeys(map(_as_value, values))
        numbers = sorted(value for value in distinct if _is_number(value))
        return cls(name, label, (*numbers, *(value for value in distinct if not _is_number(value))), words or {})

    @property
    def ordered(self) -> bool:
        """Whether a line may join neighbours: all values are numbers."""
        return all(map(_is_number, self.values))

    @cached_property
    def kind(self) -> str:
        """Scale: values that are spaced neither linearly nor logarithmically, or are no numbers, are listed."""
        if not self.ordered:
            return "listed"
        numbers = np.array(self.values, dtype=float)
        if numbers.size < 3:
            return "linear"
        gaps = {"linear": np.diff(numbers)}
        if numbers[0] > 0 and numbers[-1] >= LEAST_DECADE * numbers[0]:
            gaps["log"] = np.diff(np.log(numbers))
        kind, own = min(gaps.items(), key=lambda item: item[1].std() / item[1].mean())
        return "listed" if own.min() < NARROWEST * own.mean() and numbers.size <= MOST_LISTED else kind

    @property
    def description(self) -> str:
        """The label without its unit."""
        return self.label.partition(" [")[0]

    @property
    def unit(self) -> str:
        """The unit; empty for numbers without one."""
        return self.label.rstrip("]").partition(" [")[2].removesuffix("1")

    @property
    def heading(self) -> str:
        """The label, without the unit of what has none."""
        return self.label.removesuffix(" [1]")

    @property
    def texts(self) -> list[str]:
        """Values as words."""
        return [self.format(value) for value in self.values]

    def format(self, value: Any) -> str:
        """A value as a word."""
        value = _as_value(value)
        standard = {None: "none", True: "true", False: "false"}
        return f"{value:.4g}" if _is_number(value) else self.words.get(value) or standard.get(value) or str(value)

    def describe(self, value: Any) -> str:
        """A value with name and unit, such as "block rows 12 samples"."""
        unit = self.unit if _is_number(_as_value(value)) else ""
        return f"{self.description} {self.format(value)} {unit}".rstrip()

    def places(self, values: Iterable[Any], *, listed: bool = False) -> np.ndarray:
        """Places of values on the axis: the values themselves, or their numbers in the list."""
        if not listed and self.kind != "listed":
            return np.asarray(list(values), dtype=float)
        numbers = {value: number for number, value in enumerate(self.values)}
        return np.array([numbers[_as_value(value)] for value in values], dtype=int)

    def bin(self, values: pd.Series, most: int = MOST_LISTED, count: int = BINS) -> pd.Series:
        """Replace many different numbers by the medians of bins with as many points each; few values stay."""
        if self.kind == "listed" or len(self.values) <= most:
            return values
        bins = pd.qcut(values, min(count, len(self.values)), labels=False, duplicates="drop")
        return values.groupby(bins).transform("median")

    def set_ticks(self, panel: Axes, direction: Literal["x", "y"], room: int, *, listed: bool = False) -> None:
        """Set scale, label and ticks of an axis of a panel, which lists all values, or those without a scale."""
        axis = panel.xaxis if direction == "x" else panel.yaxis
        label = self.label if self.ordered else self.heading
        axis.set_label_text(textwrap.fill(label, LABEL if direction == "y" else max(5 * room, 30)))
        if listed or self.kind == "listed":
            step = -(-len(self.values) // room)
            texts = self.texts[::step]
            axis.set_ticks(range(0, len(self.values), step), texts)
            pitch = 8 * room // len(texts)  # characters of two neighbours on an abscissa
            if direction == "x" and any(len(first + second) > pitch for first, second in pairwise(texts)):
                axis.set_tick_params(rotation=35)
            return
        if self.kind == "log":
            set_logarithmic(panel, direction, room)
        if len(self.values) <= room and len("".join(self.texts)) <= 4 * room:
            axis.set_ticks(self.values, self.texts)
        elif self.kind == "linear":
            panel.locator_params(axis=direction, nbins=min(room, 6))


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _as_value(value: Any) -> Any:
    """A value of a table as the configuration has it: nan is None, numbers of numpy are numbers."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if value is None or value != value else value  # nan


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
    limit: float | None = None  # cells of a map up to it have a frame

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

    The table has a row for each quantity, method, `parameter` and `value`, with `low` and `high`. Values without an
    order have bars, and no line between them.
    """
    parts: list[pd.DataFrame] = []
    shown: dict[str, Panel] = {}
    for panel, axis in product(panels, axes):
        rows, name = panel.rows(table), str(len(shown))
        values = np.r_[rows[["mean", "low", "high"]].to_numpy(dtype=float).ravel(), panel.reference or np.nan]
        low, high = value_limits(values, panel.desired)
        margin = 0.06 * (high - low) or 0.06 * abs(low) or 1.0
        truth, limits = panel.truth if panel.desired is None else None, (low - margin, high + margin)
        shown[name] = Panel(textwrap.fill(panel.label, LABEL), "", truth, limits, axis.label, joined=axis.ordered)
        for number, item in enumerate(panel.series):
            part = rows[(rows["method"] == item.method) & (rows["parameter"] == axis.name)]
            shift = 0.0 if axis.ordered else 0.12 * (number - 0.5 * (len(panel.series) - 1))
            columns = {"series": textwrap.fill(item.label, LEGEND), "x": axis.places(part["value"]) + shift}
            parts.append(part.assign(panel=name, **columns).sort_values("x"))
    styles = {textwrap.fill(item.label, LEGEND): item.style for panel in panels for item in panel.series}
    rows = pd.concat(parts).drop(columns="quantity").rename(columns={"value": "setting", **MEAN})
    several = {"columns": len(axes), "height": PANEL, "sharex": "col"} if len(axes) > 1 else {"sharex": True}
    figure, cells = draw_panels(rows, shown, styles, **several)
    for cell, (panel, axis) in zip(cells, product(panels, axes), strict=True):
        axis.set_ticks(cell, "x", room=6 if len(axes) <= 2 else 4)
        if axis.kind == "listed":
            cell.set_xlim(-0.5, len(axis.values) - 0.5)
        if panel.desired == "zero":
            cell.axhline(0.0, **REFERENCE_LINE, label="_zero")
        note_lowest(cell, panel.rows(table)["mean"].min())
    return finish(figure)


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
    groups = [list(group) for _, group in groupby(panels, key=lambda panel: panel.quantity)]
    maps = [[(panel, item, name) for panel in group for item in panel.series for name in slices] for group in groups]
    # As many side by side as leave room for the numbers in their cells, and as fill the rows.
    longest = max(map(len, maps))
    most = min(MAP_COLUMNS, max(3, MAP_ROOM // len(axes[0].values)), longest)
    columns = -(-longest // -(-longest // most))
    entries = [entry for row in maps for entry in (*row, *[None] * (-len(row) % columns))]
    figure, cells = panel_grid(len(entries), columns, MAP, sharex=True, sharey=True)
    for cell, entry, following in zip(cells, entries, (*entries[1:], None), strict=True):
        if entry is None:
            cell.set_visible(False)
            continue
        panel, item, name = entry
        means = panel.rows(table)
        shown = means[(means["method"] == item.method) & (means["slice"] == name)]
        colours, extend = _choose_colours(means["mean"].to_numpy(dtype=float), panel)
        image = _draw_map(cell, shown, axes, colours, MAP_ROOM // columns if is_grid else None)
        if panel.limit is not None:
            for x, y in zip(*_places(shown[shown["mean"] <= panel.limit], axes, listed=True), strict=True):
                cell.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, fill=False, ec=FRAME, lw=2))
        axes[0].set_ticks(cell, "x", room=18 // columns, listed=is_grid)
        axes[1].set_ticks(cell, "y", room=10, listed=is_grid)
        titles = [textwrap.fill(text, MAP_TITLE // columns, break_on_hyphens=False) for text in (item.label, name)]
        cell.set_title("\n".join(filter(None, titles)))
        if cell.get_subplotspec().is_last_col() or following is None or following[0] is not panel:
            label = textwrap.fill(panel.label, LABEL)
            figure.colorbar(image, ax=cell, label=label, extend=extend, aspect=22, pad=0.02, format="{x:g}")
    labels = {item.method: item.label for panel in panels for item in panel.series}
    data = pd.concat([panel.rows(table).assign(panel=panel.label) for panel in panels])
    data = data.assign(series=data["method"].map(labels), x_quantity=axes[0].label, y_quantity=axes[1].label)
    data = data.filter([*NUMBERS, "mean", "low", "high", "trials", "failures", "warnings"]).rename(columns=MEAN)
    figure.data = name_quantities(data, {panel.label: Panel(panel.label) for panel in panels})
    return finish(figure)


def _places(rows: pd.DataFrame, axes: tuple[SweepAxis, SweepAxis], *, listed: bool) -> list[np.ndarray]:
    """Places of the rows of a table on both axes, shapes (N,)."""
    return [axis.places(rows[name], listed=listed) for axis, name in zip(axes, "xy", strict=True)]


def _draw_map(
    cell: Axes, rows: pd.DataFrame, axes: tuple[SweepAxis, SweepAxis], colours: dict[str, Any], room: int | None
) -> ScalarMappable:
    """Cells of a grid, with numbers where there is room for so many side by side; without a room single points."""
    x, y = _places(rows, axes, listed=room is not None)
    marked, empty = rows["marked"].to_numpy(dtype=bool), rows["mean"].isna().to_numpy()
    if room is None:
        ring, size = 9.0, float(np.clip(3000 / max(len(rows), 1), 8, 45))
        image: ScalarMappable = cell.scatter(x, y, c=rows["mean"], s=size, lw=0.3, edgecolors="#555555", **colours)
    else:
        ring = min(6.0, 200.0 / len(axes[0].values))
        means = np.full((len(axes[1].values), len(axes[0].values)), np.nan)
        means[y, x] = rows["mean"]
        image = cell.imshow(means, origin="lower", aspect="auto", interpolation="nearest", **colours)
        if len(rows) < means.size:
            cell.set_facecolor(NO_POINT["color"])
            cell.plot([], [], **NO_POINT)
        if means.shape[1] <= room:
            _write_numbers(cell, x, y, rows["mean"].to_numpy(), marked, image)
            marked = np.zeros_like(marked)  # their numbers have an asterisk
    if marked.any():
        cell.plot(x[marked], y[marked], **{**FAULT_RING, "ms": ring})
    if empty.any():
        cell.plot(x[empty], y[empty], **NO_VALUE)
    return image


def _write_numbers(
    cell: Axes, x: np.ndarray, y: np.ndarray, means: np.ndarray, marked: np.ndarray, image: ScalarMappable
) -> None:
    """The mean in each cell, with an asterisk where it is marked; shapes: x, y, means, marked (N,)."""
    for column, row, mean, mark in zip(x, y, means, marked, strict=True):
        if np.isfinite(mean):
            decimals = next((digits for limit, digits in ((10.0, 2), (100.0, 1), (1e4, 0)) if abs(mean) < limit), None)
            text = f"{mean:.0e}" if decimals is None else f"{mean:.{decimals}f}"
            dark = np.dot(image.to_rgba(mean)[:3], (0.3, 0.6, 0.1)) <= DARK
            look: dict[str, Any] = {
                "ha": "center",
                "va": "center",
                "fontsize": 6.0,
                "color": "white" if dark else "black",
            }
            cell.text(column, row, text + "*" * int(mark), **look)


def _choose_colours(means: np.ndarray, panel: SweepPanel) -> tuple[dict[str, Any], str]:
    """Scale and colours of maps, and the ends at which values are beyond the scale.

    Colours diverge from zero for differences and errors, and from the truth of a parameter that all points share.
    Light is good; what should be low has a logarithmic scale where it reaches over a decade.
    """
    low, high = value_limits(means, panel.desired)
    norm, cmap = Normalize, "viridis"
    if panel.reference is not None:
        reach = max(abs(low - panel.reference), abs(high - panel.reference)) or 1.0
        low, high = panel.reference - reach, panel.reference + reach
        cmap = "RdBu" if panel.series[0].is_difference else "PuOr"
    elif panel.desired == "low":
        least, cmap = np.nanmin(means, initial=np.inf), "viridis_r"
        if 0.0 < 10.0 * least < high:
            norm, low = LogNorm, least
    elif low == high:
        low, high = low - 0.5, high + 0.5
    beyond = bool((means < low).any()), bool((means > high).any())
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[beyond]
    return {"norm": norm(low, high), "cmap": cmap}, extend


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
