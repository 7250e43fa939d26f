"""Trajectories of K, B and G over phase, time or a scheduling variable: of one estimate, and means over trials."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ankleloop.plotting.panels import Panel, Styles, draw_panels, finish
from ankleloop.plotting.style import TRUE, DataFigure, method_styles, ordinal_styles
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
TRUTH = "true value"
ROW = 44.0  # mm of a row of panels
SPREAD = 1.3  # ordinates show the truth and the means with this share of their range


def trajectories_figure(
    estimates: Mapping[str, Estimate],
    truths: xr.Dataset | None = None,
    *,
    variable: str = "",
    styles: Styles | None = None,
) -> DataFigure:
    """Trajectories with their 95 % bands, and below them the excitation behind each place.

    Where a parameter is not identified its trajectory is blank, and a grey field marks the places.
    """
    curves = {label: e.trajectories for label, e in estimates.items() if e.trajectories is not None}
    dimensions = {str(next(iter(part.sizes))) for part in curves.values()}
    if len(dimensions) != 1:
        raise ValueError(f"trajectories must be functions of one thing, got {', '.join(sorted(dimensions)) or 'none'}.")
    (dimension,), first = dimensions, next(iter(curves.values()))
    own, unit = (first.attrs.get(key, "") for key in ("variable", "variable_unit"))
    xlabel = variable or (f"{own} [{unit}]" if unit else own) or ABSCISSAE[dimension]
    styles = styles or method_styles({label: estimate.method for label, estimate in estimates.items()})
    names = [name for name in PARAMETERS if any(name in part for part in curves.values())]
    panels = {name: Panel(QUANTITIES[name].label, xlabel=xlabel) for name in names}
    panels |= {f"excitation of {name}": Panel("excitation [1]", xlabel=xlabel) for name in names}
    parts: list[dict[str, Any]] = []
    blanks = []
    for name in names:
        if truths is not None and name in truths:
            parts.append({"panel": name, "series": TRUTH, "x": truths[dimension], "value": truths[name]})
        for label, estimate in estimates.items():
            if name not in curves.get(label, ()):
                constant = {**estimate.stiffness, **estimate.reflex}.get(name, np.nan)
                parts.append({"panel": name, "series": label, "x": first[dimension], "value": constant})
                continue
            keys = dimension, name, f"{name}_low", f"{name}_high"
            place, value, low, high = (curves[label][key].values for key in keys)
            parts.append({"panel": name, "series": label, "x": place, "value": value, "low": low, "high": high})
            excitation = estimate.diagnostics.get("excitation", {}).get(name, np.nan)
            parts.append({"panel": f"excitation of {name}", "series": label, "x": place, "value": excitation})
            blanks.append((name, place, np.isnan(value)))
    table = pd.concat(map(pd.DataFrame, parts))
    size: dict[str, Any] = {"columns": len(names), "height": 0.75 * ROW, "height_ratios": [2.2, 1.0]}
    figure, axes = draw_panels(table, panels, {**styles, TRUTH: TRUE}, sharex=True, **size)
    axes[-1].set_ylim(bottom=0.0)
    for name, place, blank in blanks:
        for axis in axes[names.index(name) :: len(names)]:
            _mark_blanks(axis, place, blank)
    return finish(figure)


def _mark_blanks(axis: Axes, place: np.ndarray, blank: np.ndarray) -> None:
    """A grey field where a parameter is not identified."""
    if blank.any():
        half = 0.5 * (place[1] - place[0])
        for centre in place[blank]:
            axis.axvspan(centre - half, centre + half, color=BLANK, lw=0, zorder=0)
        axis.plot([], [], color=BLANK, lw=5.0, label="not identified")


def mean_trajectories_figure(table: pd.DataFrame, *, styles: Styles | None = None) -> DataFigure:
    """Mean trajectories over trials with the spread of the trials: a row for each setting, a column for K, B and G.

    The ordinates follow the truth and the means.
    """
    settings = list(dict.fromkeys(table["row"]))
    names = [name for name in PARAMETERS if name in set(table["parameter"])]
    table = table.assign(panel=table["row"] + table["parameter"], x=table["place"], value=table["mean"])
    truths = table.drop_duplicates(["panel", "place"]).drop(columns=["low", "high"])
    rows = pd.concat([truths.assign(series=TRUTH, value=truths["truth"]), table])
    panels = {}
    for setting, name in product(settings, names):
        values = rows.loc[rows["parameter"] == name, "value"]
        low, high = float(values.min()), float(values.max())
        margin = 0.5 * (SPREAD - 1.0) * max(high - low, 0.05 * abs(high))
        title = setting if name == names[len(names) // 2] else ""
        dimension = table.loc[table["row"] == setting, "dimension"].iloc[0]
        limits = low - margin, high + margin
        panels[setting + name] = Panel(QUANTITIES[name].label, title, None, limits, ABSCISSAE[dimension])
    styles = {**(styles or ordinal_styles(dict.fromkeys(table["series"]))), TRUTH: TRUE}
    return finish(draw_panels(rows, panels, styles, columns=len(names), height=ROW)[0])
