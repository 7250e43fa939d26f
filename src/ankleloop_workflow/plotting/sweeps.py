"""Pictures of a sweep: means over each of its parameters as lines, and over two of them as maps."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from types import MappingProxyType
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis

from ankleloop.options import as_plain
from ankleloop.plotting.panels import (
    FAULT_RING,
    Panel,
    Styles,
    draw_panels,
    finish,
    name_quantities,
    note_lowest,
    panel_grid,
)
from ankleloop.plotting.style import REFERENCE_LINE, STYLE, DataFigure
from ankleloop.quantities import Goal, point_column

MOST_BINS = 10  # of a parameter with more values than are shown one by one
LEAST_DECADE = 5.0  # largest over smallest value, from which on an axis may be logarithmic
LABEL_WIDTH = 22  # characters of a line of a label
TITLES_WIDTH = 84  # characters of the titles of all maps in a row
MAP_COLUMNS = 4
LINES_HEIGHT = 38.0  # mm of a row of panels
MOST_TICKS = 6  # values that are named side by side
MAP_HEIGHT = 40.0  # mm of a row of maps
# %, beyond which a value says no more than that it is lost.
BOUNDS = {"high": (-100.0, 110.0), "zero": (-200.0, 200.0)}
FAR = 3.0  # distance from 80 % of the values over their range, from which on a value does not set an axis
FAULT_SPOT = {**FAULT_RING, "mfc": "white"}  # seen on every colour
NO_WORDS: Mapping[Any, str] = MappingProxyType({})
EMPTY_COLOUR = "#d5d5d5"  # of cells without a mean
COLOUR_BAR: dict[str, Any] = {"aspect": 22, "pad": 0.02, "format": "{x:g}", "extend": "both"}


@dataclass(frozen=True)
class SweepAxis:
    """A varied parameter with its distinct values: numbers in their order, then all others."""

    name: str  # of the setting or option
    label: str  # its name with unit
    values: tuple[Any, ...]
    words: Mapping[Any, str]  # for values that are no numbers, where they have any

    @classmethod
    def of(
        cls, name: str, label: str, values: Iterable[Any], words: Mapping[Any, str] = NO_WORDS
    ) -> SweepAxis:
        """Axis for the values of all points."""
        distinct = dict.fromkeys(map(_as_value, values))
        numbers = sorted(filter(_is_number, distinct))
        others = [value for value in distinct if not _is_number(value)]
        return cls(name, label, (*numbers, *others), words)

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
        if not self.ordered or len(self.values) < 3:
            return False
        if not 0.0 < LEAST_DECADE * self.values[0] <= self.values[-1]:
            return False
        differences = np.diff(self.values)
        ratios = np.diff(np.log(self.values))
        return bool(ratios.std() / ratios.mean() < differences.std() / differences.mean())

    @property
    def heading(self) -> str:
        """The label, without the unit of what has none."""
        return self.label.removesuffix(" [1]")

    def format(self, value: Any) -> str:
        """A value as a word."""
        plain = _as_value(value)
        if _is_number(plain):
            return f"{plain:.4g}"
        word = plain if isinstance(plain, str) else str(plain).lower()
        return self.words.get(plain, word)

    def places(self, values: Iterable[Any]) -> np.ndarray:
        """Numbers of values in the list."""
        numbers = {value: number for number, value in enumerate(self.values)}
        return np.array([numbers[_as_value(value)] for value in values], dtype=int)

    def bin(self, values: pd.Series) -> pd.Series:
        """Replace many different numbers by the medians of bins with as many points each; few values stay."""
        if not self.ordered or len(self.values) <= MOST_BINS + 2:
            return values
        bins = pd.qcut(values, MOST_BINS, labels=False, duplicates="drop")
        return values.groupby(bins).transform("median")

    def list_values(self, axis: Axis) -> None:
        """Set label and ticks of an axis that has all values side by side; of many only some are named."""
        axis.set_label_text(
            textwrap.fill(self.label if self.ordered else self.heading, LABEL_WIDTH)
        )
        step = -(-len(self.values) // MOST_TICKS)
        texts = [self.format(value) for value in self.values[::step]]
        axis.set_ticks(range(0, len(self.values), step), texts)
        if isinstance(axis, XAxis) and len("".join(texts)) > LABEL_WIDTH:
            axis.set_tick_params(rotation=35)


def _is_number(value: Any) -> bool:
    return type(value) in (int, float)  # a flag is none


def _as_value(value: Any) -> Any:
    """A value of a table as the configuration has it: nan is None, numbers of numpy are numbers."""
    plain = as_plain(value)
    return plain if plain == plain else None  # nan differs from itself


@dataclass(frozen=True)
class SweepPanel:
    """A quantity of several methods, or of the difference of two."""

    quantity: str  # panels of a quantity and of its difference stand side by side
    label: str  # its name with unit, the column `panel` of a table
    # What a method should reach; "zero" for a difference.
    desired: Goal = None
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
        values = rows[["value", "low", "high"]].assign(reference=panel.reference)
        low, high = value_limits(values, panel.desired)
        margin = 0.06 * (high - low) or 1.0
        name = f"{panel.label} {axis.name}"
        shown[name] = Panel(
            textwrap.fill(panel.label, LABEL_WIDTH),
            truth=None if panel.desired else panel.truth,
            limits=(low - margin, high + margin),
            xlabel=axis.label,
            log="x" if axis.is_logarithmic else "",
            joined=axis.ordered,
        )
        own = rows[rows["parameter"] == axis.name]
        if axis.ordered:
            places = own["setting"].astype(float)
        else:  # symbols of several methods side by side
            places = axis.places(own["setting"]) + 0.12 * pd.factorize(own["series"])[0]
        parts.append(own.assign(panel=name, x=places).sort_values("x", kind="stable"))
    options: dict[str, Any] = {"sharex": True}
    if len(axes) > 1:
        options = {"columns": len(axes), "height": LINES_HEIGHT, "sharex": "col"}
    figure = draw_panels(pd.concat(parts), shown, styles, **options)
    for cell, rows, (panel, axis) in zip(figure.axes, parts, product(panels, axes), strict=True):
        if not axis.ordered:
            axis.list_values(cell.xaxis)
            cell.set_xlim(-0.5, len(axis.values) - 0.5)
        if panel.desired == "zero":
            cell.axhline(0.0, **REFERENCE_LINE, label="_zero")
        note_lowest(cell, rows["value"].min())
    return finish(figure)


@matplotlib.rc_context({**STYLE, "axes.grid": False})
def maps_figure(
    table: pd.DataFrame, axes: tuple[SweepAxis, SweepAxis], panels: Sequence[SweepPanel]
) -> DataFigure:
    """Means over two parameters: for each quantity a map of each method, and of a difference of two.

    The table has a row for each `panel`, `series`, `x` and `y`, with `value` and `marked`. Grey cells have no mean.
    """
    abscissa, ordinate = axes
    maps = [
        (panel, name, rows)
        for panel in panels
        for name, rows in table[table["panel"] == panel.label].groupby("series", sort=False)
    ]
    columns = min(MAP_COLUMNS, table["series"].nunique())
    figure = panel_grid(len(maps), columns, MAP_HEIGHT, sharex=True, sharey=True)
    figure.set_layout_engine("constrained")  # which has places for colour bars
    cells: dict[SweepPanel, list[Axes]] = {}
    for cell, (panel, name, rows) in zip(figure.axes, maps, strict=True):
        x = abscissa.places(rows["x"])
        y = ordinate.places(rows["y"])
        means = np.full((len(ordinate.values), len(abscissa.values)), np.nan)
        means[y, x] = rows["value"]
        colours = _choose_colours(table[table["panel"] == panel.label]["value"], panel)
        cell.imshow(means, origin="lower", aspect="auto", interpolation="nearest", **colours)
        cell.set_facecolor(EMPTY_COLOUR)
        if rows["marked"].any():
            cell.plot(x[rows["marked"]], y[rows["marked"]], ls="", **FAULT_SPOT)
        abscissa.list_values(cell.xaxis)
        ordinate.list_values(cell.yaxis)
        cell.set_title(textwrap.fill(str(name), TITLES_WIDTH // columns, break_on_hyphens=False))
        cells.setdefault(panel, []).append(cell)
    for panel, row in cells.items():
        label = textwrap.fill(panel.label, LABEL_WIDTH)
        figure.colorbar(row[0].images[0], ax=row, label=label, **COLOUR_BAR)
    data = table.assign(x_quantity=abscissa.label, y_quantity=ordinate.label)
    figure.data = name_quantities(data, {panel.label: Panel(panel.label) for panel in panels})
    return finish(figure)


def _choose_colours(means: pd.Series, panel: SweepPanel) -> dict[str, Any]:
    """Scale and colours of maps, which diverge from what is right: zero, or the truth that all points share."""
    low, high = value_limits(means, panel.desired)
    right = panel.reference
    if right is None:
        colours = "viridis_r" if panel.desired == "low" else "viridis"
        return {"vmin": low, "vmax": high, "cmap": colours}
    reach = max(abs(low - right), abs(high - right)) or 1.0
    return {"vmin": right - reach, "vmax": right + reach, "cmap": "RdBu"}


def value_limits(values: pd.Series | pd.DataFrame, desired: str | None) -> tuple[float, float]:
    """Range of values without those that are lost, so that the others can be told apart."""
    numbers = values.to_numpy(dtype=float)
    lowest, highest = BOUNDS.get(desired or "", (-np.inf, np.inf))
    known = numbers[np.isfinite(numbers) & (numbers >= lowest) & (numbers <= highest)]
    if not known.size:
        return 0.0, 1.0
    first, last = np.quantile(known, [0.1, 0.9])
    reach = FAR * (last - first) or np.inf
    near = known[(known >= first - reach) & (known <= last + reach)]
    low = 0.0 if desired == "low" else float(near.min())
    high = float(near.max())
    # One value, such as nought failures, has one colour: that of the lower end.
    return low, high if high > low else low + 1.0
