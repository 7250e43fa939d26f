"""Figure of measured and estimated torques over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ankleloop.assessment.scores import evaluate
from ankleloop.joint.estimate import TORQUES
from ankleloop.joint.prepared import prepare
from ankleloop.plotting.style import COLOURS, STYLE, add_legend

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.joint.estimate import Estimate
    from ankleloop.joint.prepared import PreparedTrial

__all__ = ["torque_figure"]


@matplotlib.rc_context(STYLE)
def torque_figure(
    trial: xr.Dataset | PreparedTrial,
    estimates: Mapping[str, Estimate],
    *,
    start: float = 10.0,
    length: float = 5.0,
    title: str = "",
) -> Figure:
    """Measured and estimated torques: a row for net, intrinsic and reflex torque, a column for each method.

    In a simulation the intrinsic and reflex torque are drawn over their true ones; in a recording, where the true ones
    are unknown, all three are drawn over the measured net torque. The VAF over the whole trial is in the title of each
    panel.

    Parameters
    ----------
    trial : xarray.Dataset or PreparedTrial
        The trial.
    estimates : dict of str to Estimate
        Estimates of it by their label.
    start, length : float
        Window that is drawn [s]; of a trial that ends earlier, its last `length` seconds.
    title : str
        Title of the figure.

    Returns
    -------
    matplotlib.figure.Figure
    """
    trial = prepare(trial)
    figure = Figure(figsize=(3.6 * len(estimates) + 0.4, 5.6), layout="constrained")
    axes = figure.subplots(len(TORQUES), len(estimates), sharex=True, sharey="row", squeeze=False)
    for column, (label, estimate) in enumerate(estimates.items()):
        _draw_column(axes[:, column], trial, label, estimate, COLOURS[column % len(COLOURS)])
        axes[-1, column].set_xlabel("time [s]")
    for axis, torque in zip(axes[:, 0], TORQUES, strict=True):
        axis.set_ylabel(f"{torque} torque [N·m]")
    axes[0, 0].set_xlim(*_window(trial.samples("time"), start, length))  # of all panels
    figure.suptitle(title)
    add_legend(figure, axes.flat)
    return figure


def _window(time: np.ndarray, start: float, length: float) -> tuple[float, float]:
    end = min(start + length, float(time[-1]))
    return max(float(time[0]), end - length), end


def _draw_column(axes: np.ndarray, trial: PreparedTrial, label: str, estimate: Estimate, colour: str) -> None:
    """Three panels of one estimate."""
    scores = evaluate(trial, estimate).groupby("torque", sort=False).first()
    for axis, torque in zip(axes, TORQUES, strict=True):
        score = scores.loc[torque]
        _draw_target(axis, trial, estimate, f"torque_{torque}" if score["against"] == "true" else "torque")
        values = estimate.torque[torque].values
        style = {"color": colour, "lw": 1.0, "ls": (0, (4, 1.2)), "label": f"{label} (estimated)"}
        axis.plot(estimate.torque["time"].values, values - values.mean(), **style)
        axis.set_title(f"{torque}: VAF {score['vaf']:.1f} % ({score['against']})")
    axes[0].set_title(f"{label}\n{axes[0].get_title()}")


def _draw_target(axis: Axes, trial: PreparedTrial, estimate: Estimate, name: str) -> None:
    """Torque of the trial that the estimate is compared with: a true one, or the measured one."""
    time = estimate.torque["time"].values
    target = trial.channel_at(name, time, estimate.torque.attrs["identification_rate"])
    colour, label = ("#888888", "measured") if name == "torque" else ("#000000", "true (simulated)")
    axis.plot(time, target - target.mean(), color=colour, lw=1.1, label=label)
