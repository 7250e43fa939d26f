"""Figure of measured and estimated torques over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
import pandas as pd

from ankleloop.assessment.scores import evaluate
from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import TORQUES
from ankleloop.plotting.legends import add_legend
from ankleloop.plotting.method_styles import MethodStyle, method_styles
from ankleloop.plotting.style import MEASURED_LINE, STYLE, TRUE_LINE, TWO_COLUMNS, DataFigure, inches
from ankleloop.plotting.torque_series import centre_torques

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.joint.estimate import Estimate
    from ankleloop.joint.prepared import PreparedTrial

COLUMNS = 3  # methods side by side; more are drawn below
HEIGHT = 33.0  # mm of a panel
ESTIMATED = (4.0, 1.2)  # dashes, so that what lies below can be seen


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
    window = _window(trial.samples("time"), start, length)
    scores = {label: _first_scores(trial, estimate) for label, estimate in estimates.items()}
    table = pd.concat(
        [_tabulate(trial, label, estimate, scores[label], window) for label, estimate in estimates.items()]
    )
    columns = min(COLUMNS, len(estimates))
    blocks = -(-len(estimates) // columns)
    size = (inches(TWO_COLUMNS), inches((3 * HEIGHT + 12.0) * blocks + 4.0 * bool(title)))
    figure = DataFigure(figsize=size, layout="constrained")
    axes = figure.subplots(3 * blocks, columns, squeeze=False, sharex=True, sharey="row")
    axes[0, 0].set_xlim(*window)  # of all panels
    for number, label in enumerate(estimates):
        row, column = 3 * (number // columns), number % columns
        rows = table[table["method"] == label]
        _draw_column(axes[row : row + 3, column], rows, label, styles[label], scores[label])
        axes[row + 2, column].set_xlabel("time [s]")
        axes[row + 2, column].tick_params(labelbottom=True)
        if column == 0:
            for axis, torque in zip(axes[row : row + 3, 0], TORQUES, strict=True):
                axis.set_ylabel(f"{torque} torque [N·m]")
    for axis in axes.ravel():
        axis.set_visible(bool(axis.get_lines()))
    figure.suptitle(title)
    add_legend(figure, axes.flat)
    figure.data = table.reset_index(drop=True)
    return figure


def _window(time: np.ndarray, start: float, length: float) -> tuple[float, float]:
    end = min(start + length, float(time[-1]))
    return max(float(time[0]), end - length), end


def _first_scores(trial: PreparedTrial, estimate: Estimate) -> pd.DataFrame:
    """VAF of each torque, and against which torque of the trial: the true one, or the measured one."""
    scores = evaluate(trial, estimate).groupby("torque", sort=False).first()
    return scores.reindex(list(TORQUES)).fillna({"against": "true"})  # a true torque that is zero has no VAF


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


def _draw_column(axes: np.ndarray, table: pd.DataFrame, label: str, style: MethodStyle, scores: pd.DataFrame) -> None:
    """Three panels of one estimate."""
    for axis, torque in zip(axes, TORQUES, strict=True):
        rows = table[table["torque"] == torque]
        time = rows["time [s]"].to_numpy()
        true = rows["against"].iloc[0] == "true"
        target = {**TRUE_LINE, "label": "true (simulated)"} if true else {**MEASURED_LINE, "label": "measured"}
        axis.plot(time, rows["torque of the trial [N·m]"], **target)
        line = {"color": style.colour, "ls": (0, ESTIMATED), "lw": 1.0, "label": f"{label} (estimated)"}
        axis.plot(time, rows["estimated torque [N·m]"], **line)
        axis.set_title("{}: VAF {:.1f} % ({})".format(torque, *scores.loc[torque, ["vaf", "against"]]))
    axes[0].set_title(f"{label}\n{axes[0].get_title()}")
