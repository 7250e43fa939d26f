"""Pictures of a sweep: lines over one parameter, and a matrix of effects of several."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ankleloop.plotting.fault_marks import draw_crosses, draw_rings
from ankleloop.plotting.style import COLOURS, MARKERS, REFERENCE_LINE, STYLE, add_legend, panel_grid
from ankleloop.plotting.sweep_axes import SweepAxis

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["FAULT_SHARE", "SweepPanel", "SweepSeries", "effects_figure", "lines_figure", "mark_rows", "value_limits"]

LABEL = 22  # characters of a line of a label of a row of effects
LEGEND = 26  # characters of a line: longer entries would be cut off
FAULT_SHARE = 0.05  # of the trials of a mean that failed or came with a warning, from which on it is marked
BOUNDS = {"high": (-100.0, 100.0), "zero": (-200.0, 200.0)}  # %, beyond which a value says no more than that it is lost


@dataclass(frozen=True)
class SweepSeries:
    """A method, or the difference of two.

    Parameters
    ----------
    method : str
        Value of the column `method`.
    label : str
        Its name in the legend or the title.
    number : int or None
        Its number among the methods of the study, which gives colour and marker; None for a difference.
    """

    method: str
    label: str
    number: int | None = None

    @property
    def style(self) -> dict[str, Any]:
        """Colour and marker."""
        if self.number is None:
            return {"color": "#222222", "marker": "o"}
        return {"color": COLOURS[self.number % len(COLOURS)], "marker": MARKERS[self.number % len(MARKERS)]}


@dataclass(frozen=True)
class SweepPanel:
    """A quantity of several methods, or of the difference of two.

    Parameters
    ----------
    quantity : str
        Value of the column `quantity`.
    label : str
        Its name with unit.
    series : sequence of SweepSeries
        The methods, or a difference alone.
    desired : {"high", "zero", "low"} or None
        What a method should reach; "zero" for a difference.
    truth : float or None
        True value, where all points have the same.
    marked : bool
        Whether means of which trials failed or came with a warning are marked; their share itself needs no marks.
    """

    quantity: str
    label: str
    series: Sequence[SweepSeries]
    desired: Literal["high", "zero", "low"] | None = None
    truth: float | None = None
    marked: bool = True

    @property
    def is_difference(self) -> bool:
        """Whether it shows the difference of two methods."""
        return self.series[0].number is None

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
) -> Figure:
    """Means against one parameter, in panels side by side.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns `parameter`, `place`, `method`, `quantity`, `mean`, `margin`, `low`, `high`, `trials`, `failures` and
        `warnings`, as `ankleloop.replication.sweep_summary.summarise_effects` gives them.
    axis : SweepAxis
        The parameter.
    panels : sequence of SweepPanel
        The panels; a difference stands behind its quantity.
    band : {"mean", "trials"}
        Whether bands are the interval of the mean (`margin`) or hold most of the trials (`low` to `high`).

    Returns
    -------
    matplotlib.figure.Figure
    """
    columns = min(len(panels), 2 if any(panel.is_difference for panel in panels) else 3)
    figure, axes = panel_grid(len(panels), columns, (3.2, 2.4), (0.4, 0.8))
    figure.set_layout_engine("constrained", w_pad=0.08)
    for number, (panel_axis, panel) in enumerate(zip(axes, panels, strict=True)):
        _draw_panel(panel_axis, table, axis, panel, band)
        panel_axis.set_ylabel(panel.label)
        axis.set_ticks(panel_axis, "x")
        if number + columns < len(panels):
            panel_axis.set_xlabel("")
    add_legend(figure, axes)
    return figure


@matplotlib.rc_context(STYLE)
def effects_figure(
    table: pd.DataFrame,
    axes: Sequence[SweepAxis],
    panels: Sequence[SweepPanel],
    *,
    band: Literal["mean", "trials"] = "mean",
) -> Figure:
    """Means over each of several parameters: a column for each parameter, a row for each quantity and each difference.

    Parameters
    ----------
    table, panels, band
        As of `lines_figure`.
    axes : sequence of SweepAxis
        The parameters.

    Returns
    -------
    matplotlib.figure.Figure
    """
    size = (max(4.5, 1.9 * len(axes) + 0.8), 1.6 * len(panels) + 0.9)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(len(panels), len(axes), squeeze=False, sharex="col", sharey="row")
    for panel_axes, panel in zip(grid, panels, strict=True):
        for panel_axis, axis in zip(panel_axes, axes, strict=True):
            _draw_panel(panel_axis, table, axis, panel, band)
        panel_axes[0].set_ylim(*_row_limits(table, panel, band)[:2])
        panel_axes[0].set_ylabel(textwrap.fill(panel.label, LABEL))
    for panel_axis, axis in zip(grid[-1], axes, strict=True):
        axis.set_ticks(panel_axis, "x", room=5)
    joined = [column for column, axis in enumerate(axes) if axis.ordered]  # their entries have a line, too
    add_legend(figure, [*grid.ravel(), *grid[:, joined].ravel()])
    return figure


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
        axis.annotate(f"lowest mean: {lowest:.4g}", (0.03, 0.03), xycoords="axes fraction", fontsize=7, color="#555555")
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
        axis.fill_between(places, low, high, color=style["color"], alpha=0.22, lw=0)
    else:
        axis.vlines(places, low, high, color=style["color"], lw=1.2)
    size = 3.2 if len(rows) <= 25 else 0.0
    line = {"lw": 1.1, "ls": "-"} if joined else {"ls": ""}
    axis.plot(places, mean, **style, **line, ms=size, label=textwrap.fill(series.label, LEGEND))


def _mark_means(axis: Axes, rows: pd.DataFrame, series: SweepSeries, offset: float, height: float) -> None:
    places, mean = rows["place"].to_numpy() + offset, rows["mean"].to_numpy()
    marked, failed = mark_rows(rows)
    draw_rings(axis, places[marked], mean[marked])
    draw_crosses(axis, places[failed], height, series.style["color"], axis.get_xaxis_transform())


def _band(rows: pd.DataFrame, band: str) -> tuple[np.ndarray, np.ndarray]:
    if band == "trials":
        return rows["low"].to_numpy(), rows["high"].to_numpy()
    mean = rows["mean"].to_numpy()
    margin = rows["margin"].to_numpy() if band == "mean" else 0.0
    return mean - margin, mean + margin


def mark_rows(rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Means that are marked because of their trials, and those of which every trial failed.

    Parameters
    ----------
    rows : pandas.DataFrame
        Columns `trials`, `failures` and `warnings`.

    Returns
    -------
    marked, failed : ndarray of bool
        `marked` where at least `FAULT_SHARE` of the trials, but not all, failed or came with a warning.
    """
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
    """Range of values without those that are lost, so that the others can be told apart.

    Parameters
    ----------
    values : ndarray
        Values; those that are not finite are left out.
    desired : {"high", "zero", "low"} or None
        Of the quantity; a VAF below -100 % and an error beyond ±200 % are lost.

    Returns
    -------
    low, high : float
        The smallest and the largest value, but at most three times the range of the middle 80 % beyond it.

    Examples
    --------
    >>> value_limits(np.array([95.0, 97.0, 99.0, 98.0, 96.0, -1e6]), "high")[0] >= -100.0
    True
    """
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
    kept = inside[(inside >= first - reach) & (inside <= last + reach)] if reach > 0 else inside
    return float(kept.min()), float(kept.max())
