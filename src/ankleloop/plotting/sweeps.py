"""Pictures of a sweep: lines over one parameter, and a matrix of effects of several."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ankleloop.plotting.fault_marks import draw_crosses, draw_rings
from ankleloop.plotting.legends import add_legend
from ankleloop.plotting.method_styles import MethodStyle
from ankleloop.plotting.panels import panel_grid, split_label
from ankleloop.plotting.style import REFERENCE_LINE, STYLE, TWO_COLUMNS, DataFigure, inches
from ankleloop.plotting.sweep_axes import SweepAxis

LABEL = 18  # characters of a line of a label of a row of effects
LEGEND = 60  # characters of a line of an entry
DIFFERENCE_STYLE = MethodStyle("#222222", "o")
FAULT_SHARE = 0.05  # of the trials of a mean that failed or came with a warning, from which on it is marked
BOUNDS = {"high": (-100.0, 110.0), "zero": (-200.0, 200.0)}  # %, beyond which a value says no more than that it is lost


@dataclass(frozen=True)
class SweepSeries:
    """A method, or the difference of two."""

    method: str  # value of the column `method`
    label: str  # its name in the legend or the title
    style: MethodStyle = DIFFERENCE_STYLE  # colour, symbol and line; of a difference `DIFFERENCE_STYLE`
    is_difference: bool = False  # whether it is a difference of two methods


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
    def is_difference(self) -> bool:
        """Whether it shows the difference of two methods."""
        return self.series[0].is_difference

    def rows(self, table: pd.DataFrame) -> pd.DataFrame:
        """Its rows of a summary."""
        return table[(table["quantity"] == self.quantity) & table["method"].isin([item.method for item in self.series])]


@matplotlib.rc_context(STYLE)
def lines_figure(
    table: pd.DataFrame,
    axis: SweepAxis,
    panels: Sequence[SweepPanel],
    *,
    band: Literal["mean", "trials"] = "mean",
) -> DataFigure:
    """Means against one parameter, in panels side by side."""
    has_difference = any(panel.is_difference for panel in panels)
    columns = min(len(panels), 4 if has_difference and len(panels) > 4 else 2 if has_difference else 3)
    narrow = columns == 4
    figure, panel_axes = panel_grid(len(panels), columns, 46.0 if columns > 2 else 52.0)
    for number, (panel_axis, panel) in enumerate(zip(panel_axes, panels, strict=True)):
        _draw_panel(panel_axis, table, axis, panel, band)
        axis.set_ticks(panel_axis, "x", room=5 if narrow else 6)
        panel_axis.set_ylabel(_break_unit(panel.label) if narrow else panel.label)
        words = panel_axis.get_xlabel() if number + columns >= len(panels) else ""
        panel_axis.set_xlabel(_break_unit(words) if narrow else words)
    add_legend(figure, panel_axes)
    figure.data = tabulate_sweep(table, [axis], panels)
    return figure


@matplotlib.rc_context(STYLE)
def effects_figure(
    table: pd.DataFrame,
    axes: Sequence[SweepAxis],
    panels: Sequence[SweepPanel],
    *,
    band: Literal["mean", "trials"] = "mean",
) -> DataFigure:
    """Means over each of several parameters: a column for each, a row for each quantity and difference."""
    size = (inches(TWO_COLUMNS), inches(33.0 * len(panels) + 8.0))
    figure = DataFigure(figsize=size, layout="constrained")
    grid = figure.subplots(len(panels), len(axes), squeeze=False, sharex="col", sharey="row")
    for panel_axes, panel in zip(grid, panels, strict=True):
        for panel_axis, axis in zip(panel_axes, axes, strict=True):
            _draw_panel(panel_axis, table, axis, panel, band)
        panel_axes[0].set_ylim(*_row_limits(table, panel, band)[:2])
        panel_axes[0].set_ylabel(textwrap.fill(panel.label, LABEL))
    for panel_axis, axis in zip(grid[-1], axes, strict=True):
        axis.set_ticks(panel_axis, "x", room=5 if len(axes) <= 4 else 3)
        panel_axis.xaxis.label.set_wrap(True)
    joined = [column for column, axis in enumerate(axes) if axis.ordered]  # their entries have a line, too
    add_legend(figure, [*grid.ravel(), *grid[:, joined].ravel()])
    figure.data = tabulate_sweep(table, axes, panels)
    return figure


def tabulate_sweep(table: pd.DataFrame, axes: Sequence[SweepAxis], panels: Sequence[SweepPanel]) -> pd.DataFrame:
    """What a picture of a sweep draws as a table for readers, with quantities and units."""
    return pd.concat([_tabulate_panel(panel.rows(table), axes, panel) for panel in panels], ignore_index=True)


def _tabulate_panel(rows: pd.DataFrame, axes: Sequence[SweepAxis], panel: SweepPanel) -> pd.DataFrame:
    quantity, unit = split_label(panel.label)
    labels = {item.method: item.label for item in panel.series}
    parts: dict[str, Any] = {"quantity": quantity, "unit": unit, "method": [labels[name] for name in rows["method"]]}
    if "parameter" in rows:
        by_name = {axis.name: axis for axis in axes}
        parts["parameter"] = [by_name[name].label for name in rows["parameter"]]
        places = zip(rows["parameter"], rows["place"], strict=True)
        parts["value of the parameter"] = [by_name[name].value_at(place) for name, place in places]
    else:
        parts |= {a.label: [a.value_at(place) for place in rows[n]] for a, n in zip(axes, "xy", strict=True)}
    columns = ["slice", "mean", "margin", "low", "high", "trials", "failures", "warnings"]
    return rows.assign(**parts)[[*parts, *[name for name in columns if name in rows]]]


def _break_unit(label: str) -> str:
    """Put the unit into a line of its own."""
    return label.replace(" [", "\n[")


def _draw_panel(axis: Axes, table: pd.DataFrame, parameter: SweepAxis, panel: SweepPanel, band: str) -> None:
    table = panel.rows(table[table["parameter"] == parameter.name])
    for number, item in enumerate(panel.series):
        rows = table[table["method"] == item.method].sort_values("place")
        offset = 0.0 if parameter.ordered else 0.12 * (number - 0.5 * (len(panel.series) - 1))
        # A share of the trials is a count, and has no band.
        _draw_means(axis, rows, item, offset, parameter.ordered, band if panel.marked else "none")
        if panel.marked:
            _mark_means(axis, rows, item, offset, 0.03 + 0.06 * number)
    if panel.truth is not None:
        axis.axhline(panel.truth, **REFERENCE_LINE, label="true value", zorder=0.5)
    elif panel.desired == "zero":
        axis.axhline(0.0, **REFERENCE_LINE, zorder=0.5)
    low, high, lowest = _row_limits(table, panel, band)
    axis.set_ylim(low, high)
    if lowest < low:
        note = f"lowest mean: {lowest:.4g}"
        axis.annotate(note, (0.03, 0.03), xycoords="axes fraction", fontsize=6.5, color="#555555")
    if parameter.kind == "listed":
        axis.set_xlim(-0.5, len(parameter.values) - 0.5)
    if not table["mean"].notna().any():
        axis.annotate("not estimated", (0.5, 0.5), xycoords="axes fraction", ha="center", va="center", color="#555555")


def _draw_means(axis: Axes, rows: pd.DataFrame, series: SweepSeries, offset: float, joined: bool, band: str) -> None:
    """Means of a method with their bands; values without an order have bars, and no line between them."""
    places, mean = rows["place"].to_numpy() + offset, rows["mean"].to_numpy()
    low, high = _band(rows, band)
    style = series.style
    if joined:
        axis.fill_between(places, low, high, color=style.colour, alpha=0.22, lw=0)
    else:
        axis.vlines(places, low, high, color=style.colour, lw=1.2)
    size = {"markersize": 0.0} if len(rows) > 25 else {}
    properties: dict[str, Any] = {**(style.curve if joined else {**style.symbol, "linestyle": ""}), **size}
    axis.plot(places, mean, **properties, label=textwrap.fill(series.label, LEGEND))


def _mark_means(axis: Axes, rows: pd.DataFrame, series: SweepSeries, offset: float, height: float) -> None:
    places, mean = rows["place"].to_numpy() + offset, rows["mean"].to_numpy()
    marked, failed = mark_rows(rows)
    draw_rings(axis, places[marked], mean[marked])
    draw_crosses(axis, places[failed], height, series.style.colour, axis.get_xaxis_transform())


def _band(rows: pd.DataFrame, band: str) -> tuple[np.ndarray, np.ndarray]:
    if band == "trials":
        return rows["low"].to_numpy(), rows["high"].to_numpy()
    mean = rows["mean"].to_numpy()
    margin = rows["margin"].to_numpy() if band == "mean" else 0.0
    return mean - margin, mean + margin


def mark_rows(rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Means that are marked because of their trials, and those of which every trial failed."""
    trials, failures = rows["trials"].to_numpy(), rows["failures"].to_numpy()
    failed = (failures == trials) & (trials > 0)
    faults = failures + rows["warnings"].to_numpy()
    return (faults > 0) & (faults >= FAULT_SHARE * trials) & ~failed, failed


def _row_limits(table: pd.DataFrame, panel: SweepPanel, band: str) -> tuple[float, float, float]:
    """Limits of the ordinate, and the lowest mean."""
    rows = panel.rows(table)
    reference = [0.0] if panel.desired == "zero" else [] if panel.truth is None else [panel.truth]
    places = np.r_[rows["mean"].to_numpy(), *_band(rows, band if panel.marked else "none"), reference]
    low, high = value_limits(places, panel.desired)
    margin = 0.06 * (high - low) or 0.06 * abs(low) or 1.0
    means = rows["mean"].dropna()
    return low - margin, high + margin, float(means.min()) if len(means) else np.inf


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
    reach = 3.0 * (last - first)
    inliers = inside[(inside >= first - reach) & (inside <= last + reach)] if reach > 0 else inside
    return float(inliers.min()), float(inliers.max())
