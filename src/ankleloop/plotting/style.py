"""Figures: units on every axis, legends that can be read, files that are the same for the same data."""

from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from ankleloop.assessment.scores import evaluate
from ankleloop.joint.estimate import TORQUES
from ankleloop.joint.regressors import decimated

__all__ = ["add_legend", "save_figure", "torque_figure"]

# Okabe and Ito's colours can be told apart by colour-blind readers, and differ in print; two of Tol's for more.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222", "#882255", "#999933")
STYLE = {
    "font.size": 8.5,
    "axes.titlesize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "pdf.fonttype": 42,
    "svg.hashsalt": "ankleloop",
}
# What would differ between two runs is left out.
NO_DATES = {
    ".png": {"Software": None},
    ".pdf": {"CreationDate": None, "Producer": None},
    ".svg": {"Date": None, "Creator": None},
}


def torque_figure(trial, estimates, *, start=10.0, length=5.0, title=""):
    """Measured and estimated torques: a row for net, intrinsic and reflex torque, a column for each method.

    In a simulation the intrinsic and reflex torque stand before their true ones; in a recording, where nobody knows
    these, all three stand before the measured net torque. The VAF over the whole trial is in the title of each panel.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    estimates : dict of str to Estimate
        Estimates of it by their label.
    start, length : float
        Window that is shown [s]; a trial that ends earlier is shown to its end.
    title : str
        Title of the figure.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(3.6 * len(estimates) + 0.4, 5.6), layout="constrained")
        axes = figure.subplots(len(TORQUES), len(estimates), sharex=True, sharey="row", squeeze=False)
        for column, (label, estimate) in enumerate(estimates.items()):
            scores = evaluate(trial, estimate).groupby("torque", sort=False).first()
            for row, torque in enumerate(TORQUES):
                axis = axes[row, column]
                _torque_panel(axis, trial, estimate, torque, scores.loc[torque])
                axis.get_lines()[1].set(color=COLOURS[column % len(COLOURS)], label=f"{label} (estimated)")
                axis.set_xlim(*_window(trial, start, length))
                if column == 0:
                    axis.set_ylabel(f"{torque} torque [N·m]")
            axes[0, column].set_title(f"{label}\n{axes[0, column].get_title()}")
            axes[-1, column].set_xlabel("time [s]")
        figure.suptitle(title)
        add_legend(figure, axes.flat)
    return figure


def add_legend(figure, axes):
    """Put one legend for all axes below them; each label appears once.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.
    axes : iterable of matplotlib.axes.Axes
        Its axes.
    """
    lines = {line.get_label(): line for axis in axes for line in axis.get_lines() if line.get_label()[0] != "_"}
    figure.legend(lines.values(), lines.keys(), loc="outside lower center", ncols=min(3, len(lines)))


def _window(trial, start, length):
    time = trial["time"].values
    end = min(start + length, float(time[-1]))
    return max(float(time[0]), end - length), end


def _torque_panel(axis, trial, estimate, torque, score):
    time = estimate.torque["time"].values
    true = score["against"] == "true"
    name = f"torque_{torque}" if true else "torque"
    target = decimated(trial, name, time, estimate.torque.attrs["identification_rate"])
    shade = "#000000" if true else "#888888"
    axis.plot(time, target - target.mean(), color=shade, lw=1.1, label="true (simulated)" if true else "measured")
    estimated = estimate.torque[torque].values
    axis.plot(time, estimated - estimated.mean(), lw=1.0, ls=(0, (4, 1.2)))
    axis.set_title(f"{torque}: VAF {score['vaf']:.1f} % ({score['against']})")


def save_figure(figure, stem, endings=(".png", ".pdf")):
    """Write a figure, the same bytes for the same data.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.
    stem : path-like
        Path without its ending.
    endings : sequence of str
        Of ".png", ".pdf" and ".svg".
    """
    stem = Path(stem)
    with matplotlib.rc_context(STYLE):
        for ending in endings:
            figure.savefig(stem.with_name(stem.name + ending), dpi=200, metadata=NO_DATES[ending])
