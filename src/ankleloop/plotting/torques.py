"""Measured and estimated torques over time: as arrays, and as a figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from ankleloop.assessment.scores import evaluate
from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import TORQUES
from ankleloop.plotting.method_styles import MethodStyle, method_styles
from ankleloop.plotting.panels import add_legend, new_figure
from ankleloop.plotting.style import MEASURED_LINE, STYLE, TRUE_LINE, DataFigure

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.joint.estimate import Estimate
    from ankleloop.joint.prepared import PreparedTrial

COLUMNS = 3  # methods side by side; more are drawn below
HEIGHT = 33.0  # mm of a panel
ESTIMATED = (4.0, 1.2)  # dashes, so that what lies below can be seen


@dataclass(frozen=True, eq=False)
class CentredTorques:
    """Torques at the samples of an estimate, each less its mean over them [N·m]; all arrays of shape (N,)."""

    time: np.ndarray  # [s]
    measured: np.ndarray
    true: Mapping[str, np.ndarray]  # by "net", "intrinsic" and "reflex"; none of a recording
    estimated: Mapping[str, np.ndarray]  # by the same names


def centre_torques(trial: PreparedTrial, estimate: Estimate) -> CentredTorques:
    """Measured, true and estimated torques at the samples of an estimate, each less its mean."""
    time, rate = estimate.torque["time"].values, estimate.torque.attrs["identification_rate"]

    def centre(channel: str) -> np.ndarray:
        values = trial.channel_at(channel, time, rate)
        return values - values.mean()

    true: dict[str, np.ndarray] = {}
    if {"torque_intrinsic", "torque_reflex"} <= set(trial.trial.data_vars):
        parts = {part: centre(f"torque_{part}") for part in ("intrinsic", "reflex")}
        true = {"net": parts["intrinsic"] + parts["reflex"], **parts}
    estimated = {torque: estimate.torque[torque].values for torque in TORQUES}
    centred = {torque: values - values.mean() for torque, values in estimated.items()}
    return CentredTorques(time, centre("torque"), true, centred)


@matplotlib.rc_context(STYLE)
def torque_figure(
    trial: xr.Dataset | PreparedTrial,
    estimates: Mapping[str, Estimate],
    *,
    start: float = 10.0,
    length: float = 5.0,
    title: str = "",
    styles: Mapping[str, MethodStyle] | None = None,
) -> DataFigure:
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
    trial = prepare(trial)
    styles = styles or method_styles({label: estimate.method for label, estimate in estimates.items()})
    window = find_window(trial.samples("time"), start, length)
    columns = min(COLUMNS, len(estimates))
    blocks = -(-len(estimates) // columns)
    figure = new_figure((3 * HEIGHT + 12.0) * blocks + 4.0 * bool(title))
    axes = figure.subplots(3 * blocks, columns, squeeze=False, sharex=True, sharey="row")
    axes[0, 0].set_xlim(*window)  # of all panels
    drawn = []
    for number, (label, estimate) in enumerate(estimates.items()):
        row, column = 3 * (number // columns), number % columns
        panels = axes[row : row + 3, column]
        # VAF of each torque, and against which torque of the trial: the true one, or the measured one.
        scores = evaluate(trial, estimate).groupby("torque", sort=False).first()
        scores = scores.reindex(list(TORQUES)).fillna({"against": "true"})  # a true torque that is zero has no VAF
        table = _tabulate(trial, label, estimate, scores, window)
        for axis, torque in zip(panels, TORQUES, strict=True):
            _draw_torque(axis, table[table["torque"] == torque], styles[label])
            vaf, against = scores.loc[torque, ["vaf", "against"]]
            axis.set_title(
                f"{torque}: " + (f"VAF {vaf:.1f} % ({against})" if vaf == vaf else f"no VAF ({against}: zero)")
            )
            axis.set_ylabel(f"{torque} torque [N·m]" if column == 0 else "")
        panels[0].set_title(f"{label}\n{panels[0].get_title()}")
        panels[2].set_xlabel("time [s]")
        panels[2].tick_params(labelbottom=True)
        drawn.append(table)
    for axis in axes.flat:
        axis.set_visible(bool(axis.get_lines()))
    figure.suptitle(title)
    add_legend(figure, axes.flat)
    figure.data = pd.concat(drawn, ignore_index=True)
    return figure


def find_window(time: np.ndarray, start: float, length: float) -> tuple[float, float]:
    """Start and end of a window within a record [s]; of a record that ends earlier its last seconds."""
    end = min(start + length, float(time[-1]))
    return max(float(time[0]), end - length), end


def _tabulate(
    trial: PreparedTrial, label: str, estimate: Estimate, scores: pd.DataFrame, window: tuple[float, float]
) -> pd.DataFrame:
    """Estimated torques of a method in the window, beside those of the trial, all less their means over the trial."""
    torques = centre_torques(trial, estimate)
    inside = (torques.time >= window[0]) & (torques.time <= window[1])
    parts = []
    for torque in TORQUES:
        against = scores.loc[torque, "against"]
        target = torques.true[torque] if against == "true" else torques.measured
        columns = {
            "method": label,
            "torque": torque,
            "against": against,
            "time [s]": torques.time[inside],
            "torque of the trial [N·m]": target[inside],
            "estimated torque [N·m]": torques.estimated[torque][inside],
        }
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts)


def _draw_torque(axis: Axes, rows: pd.DataFrame, style: MethodStyle) -> None:
    """An estimated torque over that of the trial."""
    true = rows["against"].iloc[0] == "true"
    target = {**TRUE_LINE, "label": "true (simulated)"} if true else {**MEASURED_LINE, "label": "measured"}
    axis.plot(rows["time [s]"], rows["torque of the trial [N·m]"], **target)
    line: dict[str, Any] = {"color": style.colour, "ls": (0, ESTIMATED), "lw": 1.0}
    label = f"{rows['method'].iloc[0]} (estimated)"
    axis.plot(rows["time [s]"], rows["estimated torque [N·m]"], **line, label=label)
