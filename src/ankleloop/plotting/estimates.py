"""Figures of estimates: torques over time, and trajectories of K, B and G over phase, time or a scheduling variable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes

from ankleloop.assessment.scores import evaluate, has_truths, true_trajectories
from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial, Trials, prepare_trials
from ankleloop.joint.regressors import MEASURED as MEASURED_TORQUE
from ankleloop.joint.regressors import TORQUES, split_torques
from ankleloop.joint.time_varying_course import CURVES
from ankleloop.plotting.panels import PANEL_COLUMNS, Panel, Styles, curve, draw_panels, finish
from ankleloop.plotting.style import MEASURED, TRUE, DataFigure, MethodStyle, estimate_styles
from ankleloop.quantities import QUANTITIES

TORQUE_HEIGHT = 36.0  # mm of a row of panels
TRAJECTORY_HEIGHT = 44.0
ESTIMATED = {"ls": (0, (4.0, 1.2)), "lw": 1.0}  # dashes, so that what lies below can be seen
TARGETS = {"measured": MEASURED, "true (simulated)": TRUE}
PATHS = {
    "net": TRUE,
    "intrinsic": MethodStyle("#0072B2", "", dashes=(4.0, 1.2)),
    "reflex": MethodStyle("#D55E00", "", dashes=(1.5, 1.0)),
}
BLANK = "#dddddd"  # places at which a parameter is not identified
TRUTH = "true value"


@dataclass(frozen=True, eq=False)
class CentredTorques:
    """Torques at the samples of an estimate, each less its mean over them [N·m]; all arrays of shape (N,)."""

    time: np.ndarray  # [s]
    measured: np.ndarray
    true: Mapping[str, np.ndarray]  # by "net", "intrinsic" and "reflex"; none of a recording
    estimated: Mapping[str, np.ndarray]  # by the same names


def centre_torques(trial: PreparedTrial | None, estimate: Estimate) -> CentredTorques:
    """Measured, true and estimated torques at the samples of an estimate, each less its mean; of its first trial."""
    torques = split_torques(estimate.torque)[0]
    time = torques["time"].values
    rate = estimate.torque.attrs["identification_rate"]
    true: dict[str, np.ndarray] = {}
    if trial is not None:
        measured = trial.channel_at("torque", time, rate)
        if has_truths(trial):
            intrinsic = _centre(trial.channel_at("torque_intrinsic", time, rate))
            reflex = _centre(trial.channel_at("torque_reflex", time, rate))
            true = {"net": intrinsic + reflex, "intrinsic": intrinsic, "reflex": reflex}
    elif MEASURED_TORQUE in torques:
        measured = torques[MEASURED_TORQUE].values
    else:
        raise DataError(
            "the estimate holds no measured torque: give the trial, estimate.plot(trial)."
        )
    estimated = {torque: _centre(torques[torque].values) for torque in TORQUES}
    return CentredTorques(time, _centre(measured), true, estimated)


def _centre(values: np.ndarray) -> np.ndarray:
    return values - values.mean()


def plot_estimate(
    estimate: Estimate,
    trial: Trials | None,
    figure: Any = None,
    window: tuple[float, float] | None = None,
) -> Any:
    """Trajectories of an estimate that has them, else its torques; with the true ones of a simulated trial.

    Pyplot knows a new figure, so that ``plt.show`` and ``plt.savefig`` find it.
    """
    import matplotlib.pyplot as plt  # here: jobs make figures without it

    estimates = {estimate.method: estimate}
    if estimate.conditions:
        drawn = conditions_figure(estimate, figure=figure)
    elif estimate.trajectories is None:
        parts = []
        if trial is None:
            rate = estimate.torque.attrs["identification_rate"]
            parts = [f"measured torque as the estimate holds it: at {rate:g} Hz, less its mean"]
        count = len(split_torques(estimate.torque))
        if count > 1:
            parts.append(f"trial 1 of {count}; VAF of all trials")
        drawn = torque_figure(
            trial, estimates, title="; ".join(parts), figure=figure, **_find_part(window)
        )
    else:
        truths = None
        if trial is not None:
            truths = true_trajectories(prepare_trials(trial)[0], estimate.trajectories)
        drawn = trajectories_figure(estimates, truths, figure=figure)
    if figure is None:
        plt.figure(drawn)
    return drawn


def conditions_figure(estimate: Estimate, *, figure: Any = None) -> DataFigure:
    """Mean position and torque of each condition of an ensemble, with the model and its paths: a column for each."""
    looks = {MEASURED_TORQUE: MEASURED, **PATHS}
    panels = {}
    parts = []
    torques = split_torques(estimate.torque)
    positions = np.asarray(estimate.diagnostics["position"])
    pairs = list(zip(estimate.conditions, torques, positions, strict=True))
    for name, torque, position in pairs:
        time = torque["time"].values
        place = f"{name} position"
        panels[place] = Panel(
            "position [rad]", f"condition {name}", xlabel="time from the onset [s]"
        )
        parts.append(curve(place, MEASURED_TORQUE, time, position))
    for name, torque, _ in pairs:
        time = torque["time"].values
        place = f"{name} torque"
        panels[place] = Panel("torque [N·m]", "", xlabel="time from the onset [s]")
        for line in looks:
            parts.append(curve(place, line, time, torque[line].values))
    figure = draw_panels(
        pd.concat(parts),
        panels,
        looks,
        columns=len(pairs),
        height=TORQUE_HEIGHT,
        figure=figure,
        sharex=True,
    )
    return finish(figure)


def _find_part(window: tuple[float, float] | None) -> dict[str, Any]:
    """Start and length of a window [s]; none for the usual ones."""
    if window is None:
        return {}
    start, stop = window
    if not start < stop:
        raise ValueError(f"window must end after it starts, got {start:g} to {stop:g} s.")
    return {"start": start, "length": stop - start}


def torque_figure(
    trial: Trials | None,
    estimates: Mapping[str, Estimate],
    *,
    start: float = 10.0,
    length: float = 5.0,
    title: str = "",
    styles: Styles | None = None,
    figure: Any = None,
) -> DataFigure:
    """Measured and estimated torques: a row for net, intrinsic and reflex torque, a column for each method.

    In a simulation the intrinsic and reflex torque are drawn over their true ones; in a recording, where the true ones
    are unknown, all three are drawn over the measured net torque. The VAF over the whole trial is in the title of each
    panel.

    Parameters
    ----------
    trial : xarray.Dataset or PreparedTrial, or list of those, or None
        The trial; without it the measured torque is that which the estimates hold. Of merged trials the first one is
        drawn.
    estimates : dict of str to Estimate
        Estimates of it by their label.
    start, length : float
        Window that is drawn [s]; of a trial that ends earlier, its last `length` seconds.
    title : str
        Title of the figure.
    styles : dict of str to MethodStyle, optional
        Style of each label; those of the methods in the registry if left out.
    figure : matplotlib Figure or SubFigure, optional
        The figure to draw into; a new one if left out.

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
    trials = [] if trial is None else prepare_trials(trial)
    if trials:
        time = trials[0].time
    else:
        first_estimate = next(iter(estimates.values()))
        time = split_torques(first_estimate.torque)[0]["time"].values
    first, last = find_window(time, start, length)
    styles = styles or estimate_styles(estimates)
    looks = dict(TARGETS)
    panels: dict[str, Panel] = {}
    parts = []
    for label, estimate in estimates.items():
        estimated = f"{label} (estimated)"
        looks[estimated] = replace(styles[label], more=ESTIMATED)
        torques = centre_torques(trials[0] if trials else None, estimate)
        inside = (torques.time >= first) & (torques.time <= last)
        scores = _score_torques(trials, estimate)
        for torque in TORQUES:
            name = f"{label} {torque}"
            heading = f"{label}\n{torque}" if torque == "net" else torque
            if torques.true and torque != "net":
                against = "true"
                series = "true (simulated)"
                target = torques.true[torque]
            else:
                against = series = "measured"
                target = torques.measured
            vaf = scores.get(torque)
            if vaf is not None:
                heading += f": VAF {vaf:.1f} % ({against})"
            elif torques.true:
                heading += ": no VAF (true: zero)"
            panels[name] = Panel(f"{torque} torque [N·m]", heading, xlabel="time [s]")
            for line, values in ((series, target), (estimated, torques.estimated[torque])):
                part = curve(name, line, torques.time, values, method=label)
                parts.append(part[inside])
    if len(estimates) <= PANEL_COLUMNS:  # as in the paper; more methods have a row each
        places = product(TORQUES, estimates)
        panels = {f"{label} {torque}": panels[f"{label} {torque}"] for torque, label in places}
    figure = draw_panels(
        pd.concat(parts),
        panels,
        looks,
        columns=min(PANEL_COLUMNS, len(estimates)),
        height=TORQUE_HEIGHT,
        figure=figure,
        sharex=True,
    )
    figure.axes[0].set_xlim(first, last)
    figure.suptitle(title, size=8.0)
    return finish(figure)


def _score_torques(
    trials: Sequence[PreparedTrial], estimate: Estimate
) -> Mapping[str, float | None]:
    """VAF of each torque, that of the net torque against the measured one [%]."""
    if not trials:
        return {"net": estimate.vaf_net}
    return evaluate(trials, estimate).groupby("torque")["vaf"].first().to_dict()


def find_window(time: np.ndarray, start: float, length: float) -> tuple[float, float]:
    """Start and end of a window within a record [s]; of a record that ends earlier its last seconds."""
    end = min(start + length, float(time[-1]))
    return max(float(time[0]), end - length), end


def trajectories_figure(
    estimates: Mapping[str, Estimate],
    truths: xr.Dataset | None = None,
    *,
    styles: Styles | None = None,
    figure: Any = None,
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
    (dimension,) = dimensions
    first = next(iter(curves.values()))
    attributes = first[dimension].attrs
    xlabel = label_abscissa(attributes["units"], attributes["long_name"])
    names = [name for name in CURVES if any(name in part for part in curves.values())]
    panels = {name: Panel(QUANTITIES[name].label, xlabel=xlabel) for name in names}
    panels |= {f"excitation of {name}": Panel("excitation [1]", xlabel=xlabel) for name in names}
    parts = []
    for name in names:
        if truths is not None and name in truths:
            parts.append(curve(name, TRUTH, truths[dimension], truths[name]))
        for label, estimate in estimates.items():
            if name in curves.get(label, ()):
                part = curves[label]
                place = part[dimension]
                trajectory = curve(name, label, place, part[name])
                low = part[f"{name}_low"].values
                high = part[f"{name}_high"].values
                parts.append(trajectory.assign(low=low, high=high))
                excitation = estimate.diagnostics.get("excitation", {}).get(name, np.nan)
                parts.append(curve(f"excitation of {name}", label, place, excitation))
            else:
                constants = estimate.values
                parts.append(curve(name, label, first[dimension], constants.get(name, np.nan)))
    figure = draw_panels(
        pd.concat(parts),
        panels,
        {**(styles or estimate_styles(estimates)), TRUTH: TRUE},
        columns=len(names),
        height=0.75 * TRAJECTORY_HEIGHT,
        figure=figure,
        height_ratios=[2.2, 1.0],
        sharex=True,
    )
    figure.axes[-1].set_ylim(bottom=0.0)
    for column, name in enumerate(names):
        for part in curves.values():
            if name in part:
                blank = part[name].isnull().values
                for axis in figure.axes[column :: len(names)]:
                    _mark_blanks(axis, part[dimension].values, blank)
    return finish(figure)


def label_abscissa(unit: str, name: str) -> str:
    """What trajectories are functions of, with its unit."""
    return f"{name} [{unit}]" if unit else name


def _mark_blanks(axis: Axes, place: np.ndarray, blank: np.ndarray) -> None:
    """A grey field where a parameter is not identified."""
    if blank.any():
        half = 0.5 * (place[1] - place[0])
        for centre in place[blank]:
            axis.axvspan(centre - half, centre + half, color=BLANK, lw=0, zorder=0)
        axis.plot([], [], color=BLANK, lw=5.0, label="not identified")
