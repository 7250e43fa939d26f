"""Figures of estimates: torques over time, and trajectories of K, B and G over phase, time or a scheduling variable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ankleloop.assessment.scores import evaluate, true_trajectories
from ankleloop.errors import DataError
from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import MEASURED as MEASURED_TORQUE
from ankleloop.joint.regressors import TORQUES
from ankleloop.plotting.panels import COLUMNS, Panel, Styles, draw_panels, finish
from ankleloop.plotting.style import MEASURED, TRUE, DataFigure, method_styles, ordinal_styles
from ankleloop.quantities import QUANTITIES

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.joint.estimate import Estimate
    from ankleloop.joint.prepared import PreparedTrial

HEIGHT, ROW = 36.0, 44.0  # mm of a row of panels of torques, and of trajectories
ESTIMATED = {"ls": (0, (4.0, 1.2)), "lw": 1.0}  # dashes, so that what lies below can be seen
TARGETS = {"measured": MEASURED, "true (simulated)": TRUE}
PARAMETERS = ("K", "B", "G", "I")  # in their order; I where it varies
ABSCISSAE = {
    "phase": "phase of the cycle [1]",
    "time": "time from the first sample [s]",
    "schedule": "scheduling variable",
}
BLANK = "#dddddd"  # places at which a parameter is not identified
TRUTH = "true value"
SPREAD = 1.3  # ordinates show the truth and the means with this share of their range


@dataclass(frozen=True, eq=False)
class CentredTorques:
    """Torques at the samples of an estimate, each less its mean over them [N·m]; all arrays of shape (N,)."""

    time: np.ndarray  # [s]
    measured: np.ndarray
    true: Mapping[str, np.ndarray]  # by "net", "intrinsic" and "reflex"; none of a recording
    estimated: Mapping[str, np.ndarray]  # by the same names


def centre_torques(trial: PreparedTrial | None, estimate: Estimate) -> CentredTorques:
    """Measured, true and estimated torques at the samples of an estimate, each less its mean."""
    time, rate = estimate.torque["time"].values, estimate.torque.attrs["identification_rate"]
    true: dict[str, np.ndarray] = {}
    if trial is not None:
        measured = trial.channel_at("torque", time, rate)
        if {"torque_intrinsic", "torque_reflex"} <= set(trial.trial.data_vars):
            parts = {
                part: _centre(trial.channel_at(f"torque_{part}", time, rate))
                for part in TORQUES[1:]
            }
            true = {"net": parts["intrinsic"] + parts["reflex"], **parts}
    elif MEASURED_TORQUE in estimate.torque:
        measured = estimate.torque[MEASURED_TORQUE].values
    else:
        raise DataError(
            "the estimate holds no measured torque: give the trial, estimate.plot(trial)."
        )
    estimated = {torque: _centre(estimate.torque[torque].values) for torque in TORQUES}
    return CentredTorques(time, _centre(measured), true, estimated)


def _centre(values: np.ndarray) -> np.ndarray:
    return values - values.mean()


def plot_estimate(estimate: Estimate, trial: xr.Dataset | PreparedTrial | None) -> DataFigure:
    """Trajectories of an estimate that has them, else its torques; with the true ones of a simulated trial."""
    if estimate.trajectories is None:
        return torque_figure(trial, {estimate.method: estimate})
    truths = None if trial is None else true_trajectories(trial, estimate.trajectories)
    return trajectories_figure({estimate.method: estimate}, truths)


def torque_figure(
    trial: xr.Dataset | PreparedTrial | None,
    estimates: Mapping[str, Estimate],
    *,
    start: float = 10.0,
    length: float = 5.0,
    title: str = "",
    styles: Styles | None = None,
) -> DataFigure:
    """Measured and estimated torques: a row for net, intrinsic and reflex torque, a column for each method.

    In a simulation the intrinsic and reflex torque are drawn over their true ones; in a recording, where the true ones
    are unknown, all three are drawn over the measured net torque. The VAF over the whole trial is in the title of each
    panel.

    Parameters
    ----------
    trial : xarray.Dataset or PreparedTrial, or None
        The trial; without it the measured torque is that which the estimates hold.
    estimates : dict of str to Estimate
        Estimates of it by their label.
    start, length : float
        Window that is drawn [s]; of a trial that ends earlier, its last `length` seconds.
    title : str
        Title of the figure.
    styles : dict of str to MethodStyle, optional
        Style of each label; those of the methods in the registry if left out.

    Returns
    -------
    DataFigure
        `data` has the torques in the window.

    Examples
    --------
    >>> from ankleloop import identify, simulate
    >>> trial = simulate(seed=1, duration=20.0)
    >>> figure = torque_figure(trial, {"RIV": identify(trial, "riv")})
    >>> len(figure.axes)  # net, intrinsic and reflex torque
    3
    """
    prepared = None if trial is None else prepare(trial)
    styles = styles or method_styles(
        {label: estimate.method for label, estimate in estimates.items()}
    )
    looks = {
        f"{label} (estimated)": replace(styles[label], more=ESTIMATED) for label in estimates
    } | TARGETS
    time = (
        next(iter(estimates.values())).torque["time"].values
        if prepared is None
        else prepared.samples["time"]
    )
    first, last = find_window(time, start, length)
    titles, parts = {}, []
    for label, estimate in estimates.items():
        torques = centre_torques(prepared, estimate)
        inside = (torques.time >= first) & (torques.time <= last)
        scores = {"net": (estimate.vaf_net, "measured")}
        if (
            prepared is not None
        ):  # the first of each torque: the net torque against the measured one
            rows = evaluate(prepared, estimate).groupby("torque", sort=False).first()
            scores = dict(
                zip(rows.index, rows[["vaf", "against"]].itertuples(index=False), strict=True)
            )
        for torque in TORQUES:
            vaf, against = scores.get(torque, (None, "true" if torques.true else "measured"))
            score = (
                f": VAF {vaf:.1f} % ({against})"
                if vaf is not None
                else ": no VAF (true: zero)" * bool(torques.true)
            )
            titles[label, torque] = (f"{label}\n" if torque == "net" else "") + torque + score
            true = (
                ("true (simulated)", torques.true[torque])
                if against == "true"
                else ("measured", torques.measured)
            )
            for series, values in (true, (f"{label} (estimated)", torques.estimated[torque])):
                names = {"panel": f"{label} {torque}", "series": series, "method": label}
                parts.append(
                    pd.DataFrame({**names, "x": torques.time[inside], "value": values[inside]})
                )
    places = list(product(estimates, TORQUES))
    if len(estimates) <= COLUMNS:  # as in the paper; more methods have a row each
        places = [(label, torque) for torque in TORQUES for label in estimates]
    panels = {
        f"{label} {torque}": Panel(
            f"{torque} torque [N·m]", titles[label, torque], xlabel="time [s]"
        )
        for label, torque in places
    }
    columns = min(COLUMNS, len(estimates))
    figure, axes = draw_panels(
        pd.concat(parts), panels, looks, columns=columns, height=HEIGHT, sharex=True
    )
    axes[0].set_xlim(first, last)
    figure.suptitle(title, size=8.0)
    return finish(figure)


def find_window(time: np.ndarray, start: float, length: float) -> tuple[float, float]:
    """Start and end of a window within a record [s]; of a record that ends earlier its last seconds."""
    end = min(start + length, float(time[-1]))
    return max(float(time[0]), end - length), end


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
        raise ValueError(
            f"trajectories must be functions of one thing, got {', '.join(sorted(dimensions)) or 'none'}."
        )
    (dimension,), first = dimensions, next(iter(curves.values()))
    own, unit = (first.attrs.get(key, "") for key in ("variable", "variable_unit"))
    xlabel = variable or (f"{own} [{unit}]" if unit else own) or ABSCISSAE[dimension]
    styles = styles or method_styles(
        {label: estimate.method for label, estimate in estimates.items()}
    )
    names = [name for name in PARAMETERS if any(name in part for part in curves.values())]
    panels = {name: Panel(QUANTITIES[name].label, xlabel=xlabel) for name in names}
    panels |= {f"excitation of {name}": Panel("excitation [1]", xlabel=xlabel) for name in names}
    parts: list[dict[str, Any]] = []
    blanks = []
    for name in names:
        if truths is not None and name in truths:
            parts.append(
                {"panel": name, "series": TRUTH, "x": truths[dimension], "value": truths[name]}
            )
        for label, estimate in estimates.items():
            if name not in curves.get(label, ()):
                constant = {**estimate.stiffness, **estimate.reflex}.get(name, np.nan)
                parts.append(
                    {"panel": name, "series": label, "x": first[dimension], "value": constant}
                )
                continue
            keys = dimension, name, f"{name}_low", f"{name}_high"
            place, value, low, high = (curves[label][key].values for key in keys)
            parts.append(
                {
                    "panel": name,
                    "series": label,
                    "x": place,
                    "value": value,
                    "low": low,
                    "high": high,
                }
            )
            excitation = estimate.diagnostics.get("excitation", {}).get(name, np.nan)
            parts.append(
                {"panel": f"excitation of {name}", "series": label, "x": place, "value": excitation}
            )
            blanks.append((name, place, np.isnan(value)))
    table = pd.concat(map(pd.DataFrame, parts))
    size: dict[str, Any] = {
        "columns": len(names),
        "height": 0.75 * ROW,
        "height_ratios": [2.2, 1.0],
    }
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
    table = table.assign(
        panel=table["row"] + table["parameter"], x=table["place"], value=table["mean"]
    )
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
        panels[setting + name] = Panel(
            QUANTITIES[name].label, title, None, limits, ABSCISSAE[dimension]
        )
    styles = {**(styles or ordinal_styles(dict.fromkeys(table["series"]))), TRUTH: TRUE}
    return finish(draw_panels(rows, panels, styles, columns=len(names), height=ROW)[0])
