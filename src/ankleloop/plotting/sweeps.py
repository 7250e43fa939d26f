"""Pictures of a sweep: means over each of its parameters as lines, and over two of them as maps."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby, product
from typing import Any, Literal

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis
from matplotlib.image import AxesImage

from ankleloop.plotting.panels import (
    Panel,
    Styles,
    draw_panels,
    finish,
    name_quantities,
    note_lowest,
    panel_grid,
)
from ankleloop.plotting.style import REFERENCE_LINE, STYLE, DataFigure
from ankleloop.quantities import point_column

BINS = 10  # of a parameter with more values than are shown one by one
LEAST_DECADE = 5.0  # largest over smallest value, from which on an axis may be logarithmic
LABEL = 22  # characters of a line of a label
TITLE = 84  # characters of the titles of all maps in a row
MAP_COLUMNS = 4
PANEL, MAP = 38.0, 40.0  # mm of a row of lines and of maps
ROOM = 22  # numbers or ticks side by side in all maps of a row
BOUNDS = {
    "high": (-100.0, 110.0),
    "zero": (-200.0, 200.0),
}  # %, beyond which a value says no more than that it is lost
FAR = 3.0  # distance from 80 % of the values over their range, from which on a value does not set an axis
DARK = 0.5  # lightness of a cell from which on its number is black
EMPTY = "#d5d5d5"  # cells without a mean
COLOUR_BAR: dict[str, Any] = {"aspect": 22, "pad": 0.02, "format": "{x:g}", "extend": "both"}


@dataclass(frozen=True)
class SweepAxis:
    """A varied parameter with its distinct values: numbers in their order, then all others."""

    name: str  # of the setting or option
    label: str  # its name with unit
    values: tuple[Any, ...]
    words: Mapping[Any, str] = field(
        default_factory=dict
    )  # for values that are no numbers, where they have any

    @classmethod
    def of(
        cls, name: str, label: str, values: Iterable[Any], words: Mapping[Any, str] | None = None
    ) -> SweepAxis:
        """Axis for the values of all points."""
        distinct = dict.fromkeys(map(_as_value, values))
        numbers = sorted(value for value in distinct if _is_number(value))
        return cls(
            name,
            label,
            (*numbers, *(value for value in distinct if not _is_number(value))),
            words or {},
        )

    @property
    def column(self) -> str:
        """Column of a table of trials with its values."""
        return point_column(self.name)

    @property
    def ordered(self) -> bool:
        """Whether a line may join neighbours: all values are numbers."""
        return all(map(_is_number, self.values))

    @property
    def is_logarithmic(self) -> bool:
        """Whether the values are spaced logarithmically rather than linearly."""
        if (
            not self.ordered
            or len(self.values) < 3
            or not 0.0 < LEAST_DECADE * self.values[0] <= self.values[-1]
        ):
            return False
        linear, ratios = np.diff(self.values), np.diff(np.log(self.values))
        return bool(ratios.std() / ratios.mean() < linear.std() / linear.mean())

    @property
    def description(self) -> str:
        """The label without its unit."""
        return self.label.partition(" [")[0]

    @property
    def heading(self) -> str:
        """The label, without the unit of what has none."""
        return self.label.removesuffix(" [1]")

    def format(self, value: Any) -> str:
        """A value as a word."""
        value = _as_value(value)
        standard = {None: "none", True: "true", False: "false"}
        return (
            f"{value:.4g}"
            if _is_number(value)
            else self.words.get(value) or standard.get(value) or str(value)
        )

    def places(self, values: Iterable[Any]) -> np.ndarray:
        """Numbers of values in the list."""
        numbers = {value: number for number, value in enumerate(self.values)}
        return np.array([numbers[_as_value(value)] for value in values], dtype=int)

    def bin(self, values: pd.Series) -> pd.Series:
        """Replace many different numbers by the medians of bins with as many points each; few values stay."""
        if not self.ordered or len(self.values) <= BINS + 2:
            return values
        return values.groupby(pd.qcut(values, BINS, labels=False, duplicates="drop")).transform(
            "median"
        )

    def list_values(self, axis: Axis, room: int) -> None:
        """Set label and ticks of an axis that has all values side by side; of many only some are named."""
        is_abscissa = isinstance(axis, XAxis)
        label = self.label if self.ordered else self.heading
        axis.set_label_text(label if is_abscissa else textwrap.fill(label, LABEL))
        step = -(-len(self.values) // room)
        texts = [self.format(value) for value in self.values[::step]]
        axis.set_ticks(range(0, len(self.values), step), texts)
        if is_abscissa and max(map(len, texts)) * len(texts) > 4 * room:
            axis.set_tick_params(rotation=35)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _as_value(value: Any) -> Any:
    """A value of a table as the configuration has it: nan is None, numbers of numpy are numbers."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if value is None or value != value else value  # nan


@dataclass(frozen=True)
class SweepPanel:
    """A quantity of several methods, or of the difference of two."""

    quantity: str  # panels of a quantity and of its difference stand side by side
    label: str  # its name with unit, the column `panel` of a table
    desired: Literal["high", "zero", "low"] | None = (
        None  # what a method should reach; "zero" for a difference
    )
    truth: float | None = None  # true value, where all points have the same

    @property
    def reference(self) -> float | None:
        """Value that is right: the truth, or zero for an error or a difference."""
        return 0.0 if self.desired == "zero" else self.truth


@matplotlib.rc_context(STYLE)
def lines_figure(
    table: pd.DataFrame, axes: Sequence[SweepAxis], panels: Sequence[SweepPanel], styles: Styles
) -> DataFigure:
    """Means with their bands over each parameter: panels side by side for one, a row for each quantity for several.

    The table has a row for each `panel`, `series`, `parameter` and `setting`: `value`, `low`, `high`, `marked` and
    `failed`. Values without an order have bars, and no line between them.
    """
    parts: list[pd.DataFrame] = []
    shown: dict[str, Panel] = {}
    for panel, axis in product(panels, axes):
        rows = table[table["panel"] == panel.label]
        low, high = value_limits(
            rows[["value", "low", "high"]].assign(reference=panel.reference), panel.desired
        )
        margin = 0.06 * (high - low) or 1.0
        label, limits = textwrap.fill(panel.label, LABEL), (low - margin, high + margin)
        scale = "x" if axis.is_logarithmic else ""
        truth = None if panel.desired else panel.truth
        name = f"{panel.label} {axis.name}"
        shown[name] = Panel(label, "", truth, limits, axis.label, scale, joined=axis.ordered)
        rows = rows[rows["parameter"] == axis.name]
        if axis.ordered:
            places = rows["setting"].astype(float)
        else:  # symbols of several methods side by side
            places = axis.places(rows["setting"]) + 0.12 * pd.factorize(rows["series"])[0]
        parts.append(rows.assign(panel=name, x=places).sort_values("x", kind="stable"))
    several = (
        {"columns": len(axes), "height": PANEL, "sharex": "col"}
        if len(axes) > 1
        else {"sharex": True}
    )
    figure, cells = draw_panels(pd.concat(parts), shown, styles, **several)
    for cell, rows, (panel, axis) in zip(cells, parts, product(panels, axes), strict=True):
        if not axis.ordered:
            axis.list_values(cell.xaxis, 6)
            cell.set_xlim(-0.5, len(axis.values) - 0.5)
        if panel.desired == "zero":
            cell.axhline(0.0, **REFERENCE_LINE, label="_zero")
        note_lowest(cell, rows["value"].min())
    return finish(figure)


@matplotlib.rc_context({**STYLE, "axes.grid": False})
def maps_figure(
    table: pd.DataFrame, axes: tuple[SweepAxis, SweepAxis], panels: Sequence[SweepPanel]
) -> DataFigure:
    """Means over two parameters: a row for each quantity, with a map for each method and for a difference of two.

    The table has a row for each `panel`, `series`, `x` and `y`, with `value` and `marked`. Cells have their means where
    there is room, an asterisk where they are marked, and a cross where no trial has a value.
    """
    quantities = [list(group) for _, group in groupby(panels, key=lambda panel: panel.quantity)]
    series = {
        panel.label: table.loc[table["panel"] == panel.label, "series"].unique() for panel in panels
    }
    maps = [
        [(panel, name) for panel in group for name in series[panel.label]] for group in quantities
    ]
    columns = min(MAP_COLUMNS, max(map(len, maps)), max(3, ROOM // len(axes[0].values)))
    entries = [entry for row in maps for entry in (*row, *[None] * (-len(row) % columns))]
    figure, cells = panel_grid(len(entries), columns, MAP, sharex=True, sharey=True)
    images: dict[SweepPanel, list[AxesImage]] = {}
    for cell, entry in zip(cells, entries, strict=True):
        cell.set_visible(entry is not None)
        if entry is None:
            continue
        panel, name = entry
        rows = table[table["panel"] == panel.label]
        image = _draw_map(
            cell, rows[rows["series"] == name], axes, _choose_colours(rows["value"], panel), columns
        )
        images.setdefault(panel, []).append(image)
        cell.set_title(textwrap.fill(name, TITLE // columns, break_on_hyphens=False))
    for panel, drawn in images.items():
        cells_of_panel = [image.axes for image in drawn]
        figure.colorbar(
            drawn[0], ax=cells_of_panel, label=textwrap.fill(panel.label, LABEL), **COLOUR_BAR
        )
    data = table.assign(x_quantity=axes[0].label, y_quantity=axes[1].label)
    figure.data = name_quantities(data, {panel.label: Panel(panel.label) for panel in panels})
    return finish(figure)


def _draw_map(
    cell: Axes,
    rows: pd.DataFrame,
    axes: tuple[SweepAxis, SweepAxis],
    colours: dict[str, Any],
    columns: int,
) -> AxesImage:
    """Cells of a grid with their numbers, where there is room for so many side by side."""
    x, y = (axis.places(rows[name]) for axis, name in zip(axes, "xy", strict=True))
    means = np.full((len(axes[1].values), len(axes[0].values)), np.nan)
    means[y, x] = rows["value"]
    image = cell.imshow(means, origin="lower", aspect="auto", interpolation="nearest", **colours)
    cell.set_facecolor(EMPTY)
    has_room = means.shape[1] <= ROOM // columns
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 6.0}
    for column, row, mean, mark in zip(x, y, rows["value"], rows["marked"], strict=True):
        number = (f"{round(mean, 2):.3g}" if has_room else "") + "*" * bool(mark)
        is_dark = np.dot(image.to_rgba(mean)[:3], (0.3, 0.6, 0.1)) <= DARK
        text, colour = (
            ("×", "black") if np.isnan(mean) else (number, "white" if is_dark else "black")
        )
        cell.text(column, row, text, **look, color=colour)
    axes[0].list_values(cell.xaxis, ROOM // columns)
    axes[1].list_values(cell.yaxis, 10)
    return image


def _choose_colours(means: pd.Series, panel: SweepPanel) -> dict[str, Any]:
    """Scale and colours of maps, which diverge from what is right: zero, or the truth that all points share."""
    low, high = value_limits(means, panel.desired)
    if panel.reference is None:
        return {
            "vmin": low,
            "vmax": high,
            "cmap": "viridis_r" if panel.desired == "low" else "viridis",
        }
    reach = max(abs(low - panel.reference), abs(high - panel.reference)) or 1.0
    return {"vmin": panel.reference - reach, "vmax": panel.reference + reach, "cmap": "RdBu"}


def value_limits(values: pd.Series | pd.DataFrame, desired: str | None) -> tuple[float, float]:
    """Range of values without those that are lost, so that the others can be told apart."""
    known = values.to_numpy(dtype=float)
    known = known[np.isfinite(known)]
    low, high = BOUNDS.get(desired or "", (-np.inf, np.inf))
    known = known[(known >= low) & (known <= high)]
    if not known.size:
        return 0.0, 1.0
    first, last = np.quantile(known, [0.1, 0.9])
    reach = FAR * (last - first) or np.inf
    inliers = known[(known >= first - reach) & (known <= last + reach)]
    return 0.0 if desired == "low" else float(inliers.min()), float(inliers.max())
