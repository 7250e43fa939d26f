"""Trajectories of K, B and G over phase, time or a scheduling variable: of one estimate, and means over trials."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ankleloop.plotting.legends import add_legend
from ankleloop.plotting.method_styles import MethodStyle, method_styles, ordinal_styles
from ankleloop.plotting.style import STYLE, TRUE_LINE, TWO_COLUMNS, DataFigure, inches
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
    dimensions = {str(next(iter(e.trajectories.sizes))) for e in estimates.values() if e.trajectories is not None}
    if len(dimensions) != 1:
        raise ValueError(f"trajectories must be functions of one thing, got {', '.join(sorted(dimensions)) or 'none'}.")
    (dimension,) = dimensions
    styles = styles or method_styles({label: estimate.method for label, estimate in estimates.items()})
    size = (inches(TWO_COLUMNS), inches(ROW + EXCITATION))
    figure = DataFigure(figsize=size, layout="constrained")
    curves = [estimate.trajectories for estimate in estimates.values() if estimate.trajectories is not None]
    names = [name for name in PARAMETERS if any(name in part for part in curves)]
    rows = figure.subplots(2, len(names), sharex=True, height_ratios=[ROW, EXCITATION], squeeze=False)
    for (upper, lower), name in zip(rows.T, names, strict=True):
        upper.set_ylabel(QUANTITIES[name].label)
        lower.set_xlabel(variable if dimension == "schedule" and variable else _label_abscissa(curves[0]))
        if truths is not None and name in truths:
            upper.plot(truths[dimension], truths[name], **TRUE_LINE, label="true value")
        for label, estimate in estimates.items():
            _draw_estimate(upper, estimate, name, label, styles[label])
            _draw_excitation(lower, estimate, name, label, styles[label])
        lower.set_ylim(bottom=0.0)
    rows[1, 0].set_ylabel("excitation [1]")
    add_legend(figure, rows.ravel())
    figure.data = _tabulate(estimates, truths)
    return figure


def _label_abscissa(curves: xr.Dataset) -> str:
    """What trajectories are functions of, with its unit."""
    dimension = str(next(iter(curves.sizes)))
    name, unit = (curves.attrs.get(key, "") for key in ("variable", "variable_unit"))
    return (f"{name} [{unit}]" if unit else name) or ABSCISSAE[dimension]


def _draw_estimate(axis: Axes, estimate: Estimate, name: str, label: str, style: MethodStyle) -> None:
    """A trajectory with its band; the constant of an estimate that has none."""
    if estimate.trajectories is None or name not in estimate.trajectories:
        value = {**estimate.stiffness, **estimate.reflex}.get(name, np.nan)
        axis.axhline(value, **style.line, label=label)
        return
    curves = estimate.trajectories
    place = curves[next(iter(curves.sizes))].values
    axis.fill_between(place, curves[f"{name}_low"], curves[f"{name}_high"], color=style.colour, alpha=0.25, lw=0)
    axis.plot(place, curves[name], **style.line, label=label)
    _mark_blanks(axis, place, curves[name].values)


def _draw_excitation(axis: Axes, estimate: Estimate, name: str, label: str, style: MethodStyle) -> None:
    """Information of the record about a parameter at each place, over its mean."""
    excitation = estimate.diagnostics.get("excitation")
    if excitation is None or estimate.trajectories is None or name not in estimate.trajectories:
        return
    place = estimate.trajectories[next(iter(estimate.trajectories.sizes))].values
    axis.fill_between(place, 0.0, excitation[name], color=style.colour, alpha=0.25, lw=0)
    axis.plot(place, excitation[name], **(style.line | {"lw": 0.7}), label=label)
    _mark_blanks(axis, place, estimate.trajectories[name].values)


def _mark_blanks(axis: Axes, place: np.ndarray, values: np.ndarray) -> None:
    """A grey field where a parameter is not identified."""
    blank = ~np.isfinite(values)
    if blank.any():
        half = 0.5 * (place[1] - place[0])
        edges = np.flatnonzero(np.diff(np.concatenate([[False], blank, [False]]).astype(int)))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            axis.axvspan(place[start] - half, place[stop - 1] + half, color=BLANK, lw=0, zorder=0)
        axis.plot([], [], color=BLANK, lw=5.0, label="not identified")


def _tabulate(estimates: Mapping[str, Estimate], truths: xr.Dataset | None) -> pd.DataFrame:
    """All trajectories with their bands and the excitation, a row for each place."""
    parts = []
    for label, estimate in estimates.items():
        if estimate.trajectories is None:
            continue
        curves, excitation = estimate.trajectories, estimate.diagnostics.get("excitation", {})
        dimension = str(next(iter(curves.sizes)))
        for name in filter(curves.__contains__, PARAMETERS):
            quantity = {"series": label, "quantity": name, "unit": QUANTITIES[name].unit}
            part = pd.DataFrame({**quantity, "abscissa": _label_abscissa(curves), "place": curves[dimension].values})
            for column, key in (("value", name), ("low", f"{name}_low"), ("high", f"{name}_high")):
                part[column] = curves[key].values
            if truths is not None and name in truths:
                part["truth"] = np.interp(curves[dimension], truths[dimension], truths[name])
            parts.append(part.assign(**{"excitation over its mean [1]": excitation.get(name, np.nan)}))
    return pd.concat(parts, ignore_index=True)


@matplotlib.rc_context(STYLE)
def mean_trajectories_figure(table: pd.DataFrame, *, styles: Mapping[str, MethodStyle] | None = None) -> DataFigure:
    """Mean trajectories over trials with the spread of the trials: a row for each setting, a column for K, B and G."""
    styles = styles or ordinal_styles(dict.fromkeys(table["series"]))
    rows = list(dict.fromkeys(table["row"]))
    names = [name for name in PARAMETERS if name in set(table["parameter"])]
    size = (inches(TWO_COLUMNS), inches(ROW * len(rows)))
    figure = DataFigure(figsize=size, layout="constrained")
    axes = figure.subplots(len(rows), len(names), squeeze=False)
    for number, row in enumerate(rows):
        for axis, name in zip(axes[number], names, strict=True):
            _draw_means(axis, table[(table["row"] == row) & (table["parameter"] == name)], styles)
            axis.set(ylabel=QUANTITIES[name].label, title=row if name == names[len(names) // 2] else "")
    add_legend(figure, axes.ravel())
    columns = {"row": "setting", "series": "method"}
    names = ["row", "series", "parameter", "dimension", "place", "truth", "mean", "low", "high", "n"]
    data = table[names].rename(columns=columns)
    figure.data = data.assign(unit=[QUANTITIES[name].unit for name in data["parameter"]]).reset_index(drop=True)
    return figure


def _draw_means(axis: Axes, table: pd.DataFrame, styles: Mapping[str, MethodStyle]) -> None:
    """Mean trajectories of all methods in one setting; the ordinate follows truth and means."""
    for number, (series, part) in enumerate(table.groupby("series", sort=False)):
        style = styles[str(series)]
        if number == 0:
            axis.plot(part["place"], part["truth"], **TRUE_LINE, label="true value", zorder=2.5)
            axis.set_xlabel(ABSCISSAE[part["dimension"].iloc[0]])
        axis.fill_between(part["place"], part["low"], part["high"], color=style.colour, alpha=0.18, lw=0)
        axis.plot(part["place"], part["mean"], **style.line, label=str(series))
    values = table[["truth", "mean"]].to_numpy(float)
    if np.isfinite(values).any():
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        margin = 0.5 * (SPREAD - 1.0) * max(high - low, 0.05 * abs(high))
        axis.set_ylim(low - margin, high + margin)
