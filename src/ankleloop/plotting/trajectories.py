"""Trajectories of K, B and G over phase, time or a scheduling variable: of one estimate, and means over trials."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ankleloop.plotting.method_styles import MethodStyle, method_styles, ordinal_styles
from ankleloop.plotting.panels import add_legend, new_figure
from ankleloop.plotting.style import STYLE, TRUE_LINE, DataFigure
from ankleloop.quantities import QUANTITIES

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.joint.estimate import Estimate

PARAMETERS = ("K", "B", "G", "I")  # in their order; I where it varies
ABSCISSAE = {
    "phase": "phase of the cycle [1]",
    "time": "time from the first sample [s]",
    "schedule": "scheduling variable",
}
BLANK = "#dddddd"  # places at which a parameter is not identified
ROW, EXCITATION = 44.0, 20.0  # mm of a row of panels, and of one that shows the excitation
LEVEL = "excitation over its mean [1]"
SPREAD = 1.3  # ordinates show the truth and the means with this share of their range


@matplotlib.rc_context(STYLE)
def trajectories_figure(
    estimates: Mapping[str, Estimate],
    truths: xr.Dataset | None = None,
    *,
    variable: str = "",
    styles: Mapping[str, MethodStyle] | None = None,
) -> DataFigure:
    """Trajectories with their 95 % bands, and below them the excitation behind each place.

    Where a parameter is not identified its trajectory is blank, and a grey field marks the places.
    """
    curves = {label: e.trajectories for label, e in estimates.items() if e.trajectories is not None}
    dimensions = {str(next(iter(part.sizes))) for part in curves.values()}
    if len(dimensions) != 1:
        raise ValueError(f"trajectories must be functions of one thing, got {', '.join(sorted(dimensions)) or 'none'}.")
    (dimension,) = dimensions
    abscissa = _label_abscissa(next(iter(curves.values())), dimension)
    styles = styles or method_styles({label: estimate.method for label, estimate in estimates.items()})
    names = [name for name in PARAMETERS if any(name in part for part in curves.values())]
    figure = new_figure(ROW + EXCITATION)
    rows = figure.subplots(2, len(names), sharex=True, height_ratios=[ROW, EXCITATION], squeeze=False)
    drawn = []
    for (upper, lower), name in zip(rows.T, names, strict=True):
        upper.set_ylabel(QUANTITIES[name].label)
        lower.set_xlabel(variable if dimension == "schedule" and variable else abscissa)
        if truths is not None and name in truths:
            upper.plot(truths[dimension], truths[name], **TRUE_LINE, label="true value")
        for label, estimate in estimates.items():
            if name in curves.get(label, ()):
                table = _tabulate(estimate, name, dimension, truths)
                _draw_band(upper, table, "value", styles[label], label)
                _draw_band(lower, table.assign(low=0.0, high=table[LEVEL]), LEVEL, styles[label], label)
                for axis in (upper, lower):
                    _mark_blanks(axis, table["place"].to_numpy(), table["value"].isna().to_numpy())
                drawn.append(table.assign(series=label, abscissa=abscissa))
            else:  # a constant
                value = {**estimate.stiffness, **estimate.reflex}.get(name, np.nan)
                upper.axhline(value, **styles[label].line, label=label)
        lower.set_ylim(bottom=0.0)
    rows[1, 0].set_ylabel("excitation [1]")
    add_legend(figure, rows.flat)
    figure.data = pd.concat(drawn, ignore_index=True)
    return figure


def _label_abscissa(curves: xr.Dataset, dimension: str) -> str:
    """What trajectories are functions of, with its unit."""
    name, unit = (curves.attrs.get(key, "") for key in ("variable", "variable_unit"))
    return (f"{name} [{unit}]" if unit else name) or ABSCISSAE[dimension]


def _tabulate(estimate: Estimate, name: str, dimension: str, truths: xr.Dataset | None) -> pd.DataFrame:
    """A trajectory with its band, its excitation and its truth, a row for each place."""
    curves = estimate.trajectories
    assert curves is not None
    table = pd.DataFrame({"quantity": name, "unit": QUANTITIES[name].unit, "place": curves[dimension].values})
    for column, key in (("value", name), ("low", f"{name}_low"), ("high", f"{name}_high")):
        table[column] = curves[key].values
    if truths is not None and name in truths:
        table["truth"] = np.interp(curves[dimension], truths[dimension], truths[name])
    return table.assign(**{LEVEL: estimate.diagnostics.get("excitation", {}).get(name, np.nan)})


def _draw_band(axis: Axes, table: pd.DataFrame, column: str, style: MethodStyle, label: str) -> None:
    """A curve, and the band from `low` to `high`."""
    axis.fill_between(table["place"], table["low"], table["high"], color=style.colour, alpha=0.22, lw=0)
    axis.plot(table["place"], table[column], **style.line, label=label)


def _mark_blanks(axis: Axes, place: np.ndarray, blank: np.ndarray) -> None:
    """A grey field where a parameter is not identified."""
    if blank.any():
        half = 0.5 * (place[1] - place[0])
        edges = np.flatnonzero(np.diff(np.concatenate([[False], blank, [False]]).astype(int)))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            axis.axvspan(place[start] - half, place[stop - 1] + half, color=BLANK, lw=0, zorder=0)
        axis.plot([], [], color=BLANK, lw=5.0, label="not identified")


@matplotlib.rc_context(STYLE)
def mean_trajectories_figure(table: pd.DataFrame, *, styles: Mapping[str, MethodStyle] | None = None) -> DataFigure:
    """Mean trajectories over trials with the spread of the trials: a row for each setting, a column for K, B and G."""
    styles = styles or ordinal_styles(dict.fromkeys(table["series"]))
    settings = list(dict.fromkeys(table["row"]))
    names = [name for name in PARAMETERS if name in set(table["parameter"])]
    figure = new_figure(ROW * len(settings))
    axes = figure.subplots(len(settings), len(names), squeeze=False)
    for row, setting in zip(axes, settings, strict=True):
        for axis, name in zip(row, names, strict=True):
            _draw_means(axis, table[(table["row"] == setting) & (table["parameter"] == name)], styles)
            axis.set(ylabel=QUANTITIES[name].label, title=setting if name == names[len(names) // 2] else "")
    add_legend(figure, axes.flat)
    columns = ["row", "series", "parameter", "dimension", "place", "truth", "mean", "low", "high", "n"]
    data = table[columns].rename(columns={"row": "setting", "series": "method"})
    figure.data = data.assign(unit=[QUANTITIES[name].unit for name in data["parameter"]]).reset_index(drop=True)
    return figure


def _draw_means(axis: Axes, table: pd.DataFrame, styles: Mapping[str, MethodStyle]) -> None:
    """Mean trajectories of all methods in one setting; the ordinate follows truth and means."""
    for number, (series, part) in enumerate(table.groupby("series", sort=False)):
        if number == 0:
            axis.plot(part["place"], part["truth"], **TRUE_LINE, label="true value", zorder=2.5)
            axis.set_xlabel(ABSCISSAE[part["dimension"].iloc[0]])
        _draw_band(axis, part, "mean", styles[str(series)], str(series))
    values = table[["truth", "mean"]].to_numpy(float)
    if np.isfinite(values).any():
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        margin = 0.5 * (SPREAD - 1.0) * max(high - low, 0.05 * abs(high))
        axis.set_ylim(low - margin, high + margin)
