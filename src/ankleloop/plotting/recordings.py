"""Figures of one recording (spectra, models, residuals), and of a group of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.plotting.style import COLOURS, FAULT_RING, REFERENCE_LINE, STYLE, add_legend
from ankleloop.quantities import QUANTITIES

if TYPE_CHECKING:
    import pandas as pd

    from ankleloop.assessment.residuals import ResidualTest
    from ankleloop.joint.estimate import Estimate

__all__ = ["group_figure", "model_figure", "residual_figure", "spectra_figure"]

LONGEST = 0.4  # s of impulse responses
FREQUENCIES = np.geomspace(0.2, 38.0, 200)  # Hz of Bode diagrams


@matplotlib.rc_context(STYLE)
def spectra_figure(spectra: Mapping[str, np.ndarray]) -> Figure:
    """Power spectra of position and torque, and their coherence.

    Parameters
    ----------
    spectra : dict of str to ndarray
        `ankleloop.recordings.checks.Check.spectra`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(9.6, 2.6), layout="constrained")
    position, torque, coherence = axes = figure.subplots(1, 3)
    frequency = spectra["frequency"]
    for axis, name, unit in ((position, "position", "rad²/Hz"), (torque, "torque", "(N·m)²/Hz")):
        axis.loglog(frequency, spectra[name], color=COLOURS[0], lw=1.0)
        axis.set_ylabel(f"{name} [{unit}]")
    pairs = {"coherence": "position and torque", "reference_coherence": "reference and position"}
    for colour, (name, label) in zip(COLOURS, pairs.items(), strict=False):
        if name in spectra:
            coherence.semilogx(frequency, spectra[name], color=colour, lw=1.0, label=label)
    coherence.set(ylabel="squared coherence [1]", ylim=(0, 1.02))
    for axis in axes:
        axis.set_xlabel("frequency [Hz]")
        axis.xaxis.set_major_formatter("{x:g}")
    add_legend(figure, [coherence])
    return figure


@matplotlib.rc_context(STYLE)
def model_figure(estimates: Mapping[str, Estimate]) -> Figure:
    """Models of several methods: impulse responses, Bode diagrams, and the nonlinearity of the reflex.

    Parameters
    ----------
    estimates : dict of str to Estimate
        Estimates by the label of the method.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(9.6, 5.0), layout="constrained")
    (intrinsic, intrinsic_gain, curve), (reflex, reflex_gain, reflex_phase) = figure.subplots(2, 3)
    # The first panel has the responses of methods that are not parametric, else the phase of the parametric models.
    with_responses = any("intrinsic_response" in estimate.diagnostics for estimate in estimates.values())
    for number, (label, estimate) in enumerate(estimates.items()):
        style = _line_style(number, label, width=1.1)
        if with_responses:
            _draw_intrinsic_response(intrinsic, estimate, style)
        else:
            _draw_phase(intrinsic, _intrinsic_response(estimate), style)
        intrinsic_gain.loglog(FREQUENCIES, np.abs(_intrinsic_response(estimate)), **style)
        if "omega_n" in estimate.reflex:
            _draw_reflex(reflex, reflex_gain, reflex_phase, estimate, style)
        nonlinearity = estimate.diagnostics.get("nonlinearity")
        if nonlinearity is not None:
            curve.plot(nonlinearity["velocity"], nonlinearity["torque"], **style)
    if with_responses:
        intrinsic.set(xlabel="time [s]", ylabel="intrinsic response [N·m/rad]", title="per sample, two-sided")
    else:
        intrinsic.set(xlabel="frequency [Hz]", ylabel="intrinsic phase [°]")
    intrinsic_gain.set(xlabel="frequency [Hz]", ylabel="intrinsic gain [N·m/rad]")
    curve.set(xlabel="delayed velocity [rad/s]", ylabel="nonlinearity [N·m]")
    reflex.set(xlabel="time after the movement [s]", ylabel="reflex response [1/s]", title="of unit gain")
    reflex_gain.set(xlabel="frequency [Hz]", ylabel="reflex gain over that at rest [1]")
    reflex_phase.set(xlabel="frequency [Hz]", ylabel="reflex phase without delay [°]")
    for axis in (intrinsic_gain, reflex_gain, reflex_phase):
        axis.xaxis.set_major_formatter("{x:g}")
    add_legend(figure, (intrinsic_gain, curve, reflex))
    return figure


def _line_style(number: int, label: str, width: float) -> dict[str, Any]:
    return {"color": COLOURS[number % len(COLOURS)], "lw": width, "label": label}


def _intrinsic_response(estimate: Estimate) -> np.ndarray:
    """Frequency response of K, B and I."""
    s = 2j * np.pi * FREQUENCIES
    K, B, I = (estimate.stiffness[name] for name in "KBI")  # noqa: E741 - the field's name
    return K + B * s + I * s**2


def _draw_intrinsic_response(axis: Axes, estimate: Estimate, style: Mapping[str, Any]) -> None:
    """Two-sided impulse response of a method that has one."""
    if "intrinsic_response" in estimate.diagnostics:
        lags, response = (estimate.diagnostics[f"intrinsic_{name}"] for name in ("lags", "response"))
        axis.plot(lags, response, "o-", ms=2, **style)


def _draw_phase(axis: Axes, response: np.ndarray, style: Mapping[str, Any]) -> None:
    axis.semilogx(FREQUENCIES, np.degrees(np.unwrap(np.angle(response))), **style)
    axis.xaxis.set_major_formatter("{x:g}")


def _draw_reflex(response: Axes, gain: Axes, phase: Axes, estimate: Estimate, style: Mapping[str, Any]) -> None:
    """Low-pass of the reflex, and the impulse response of a method that is not parametric; both after the delay."""
    values = estimate.reflex
    dynamics = ReflexDynamics(values["omega_n"], values["zeta"], values.get("pole"))
    time = np.arange(0.0, LONGEST, 1e-3)
    frequencies = 2j * np.pi * np.fft.rfftfreq(4096, 1e-3)
    delay = values["delay"]
    response.plot(delay + time, np.fft.irfft(dynamics.response(frequencies)[0])[: time.size] * 1e3, **style)
    if "reflex_response" in estimate.diagnostics:
        lags = np.asarray(estimate.diagnostics["reflex_lags"])
        samples = np.asarray(estimate.diagnostics["reflex_response"]) / values["G"] / (lags[1] - lags[0])
        window = lags < LONGEST
        response.plot(delay + lags[window], samples[window], ".", ms=2.5, color=style["color"])
    low_pass = dynamics.response(2j * np.pi * FREQUENCIES)[0]
    gain.loglog(FREQUENCIES, np.abs(low_pass), **style)
    _draw_phase(phase, low_pass, style)


@matplotlib.rc_context(STYLE)
def residual_figure(tests: Mapping[str, ResidualTest]) -> Figure:
    """Residuals of several methods: spectra, and correlation with the signal that must not explain them.

    Parameters
    ----------
    tests : dict of str to ResidualTest
        Tests by the label of the method.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = Figure(figsize=(9.6, 2.9), layout="constrained")
    density, correlation = figure.subplots(1, 2)
    for number, (label, test) in enumerate(tests.items()):
        style = _line_style(number, label, width=1.0)
        density.loglog(test.frequency, test.density, **style)
        correlation.plot(test.lags, test.correlation, **style)
    limit = next(iter(tests.values())).limit
    for level in (-limit, limit):
        correlation.axhline(level, **REFERENCE_LINE, label="99 % of unrelated ones")
    density.set(xlabel="frequency [Hz]", ylabel="residual torque [(N·m)²/Hz]")
    density.xaxis.set_major_formatter("{x:g}")
    correlation.set(xlabel="time by which the residual is behind [s]", ylabel="whitened correlation [1]")
    add_legend(figure, (density, correlation))
    return figure


@matplotlib.rc_context(STYLE)
def group_figure(
    table: pd.DataFrame, names: Sequence[str], *, condition: str = "condition", subject: str = "subject"
) -> Figure:
    """Parameters against the condition: a point for each recording, a line for the mean of each subject.

    Estimates with a warning are crosses where they lie within the axes, and are left out of the means; a ring marks
    such means.

    Parameters
    ----------
    table : pandas.DataFrame
        One row for each recording and method: `condition`, `subject`, `label`, the parameters, and where there are
        estimates with a warning `trusted`.
    names : sequence of str
        Parameters, a row of panels each; a column for each method. Names of `ankleloop.quantities.QUANTITIES`.
    condition, subject : str
        Columns.

    Returns
    -------
    matplotlib.figure.Figure
    """
    labels, conditions, subjects = (list(dict.fromkeys(table[name])) for name in ("label", condition, subject))
    size = (max(2.6, 0.5 * len(conditions) + 1.6) * len(labels) + 0.6, 1.7 * len(names) + 0.9)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(len(names), len(labels), squeeze=False, sharex=True, sharey="row")
    for column, label in enumerate(labels):
        rows = table[table["label"] == label]
        for axis, name in zip(axes[:, column], names, strict=True):
            for number, person in enumerate(subjects):
                style = _line_style(number, str(person), width=1.0)
                offset = 0.24 * ((number + 0.5) / len(subjects) - 0.5)
                values = rows[rows[subject] == person].set_index(condition)
                values.index = values.index.map(conditions.index)
                _draw_subject(axis, values, name, offset, style)
            axis.set_xticks(range(len(conditions)), conditions)
            axis.margins(x=0.15)
        axes[0, column].set_title(label)
        axes[-1, column].set_xlabel(condition)
    for axis, name in zip(axes[:, 0], names, strict=True):
        axis.set_ylabel(QUANTITIES[name].label)
    if len(subjects) <= len(COLOURS):
        add_legend(figure, axes.flat)
    return figure


def _draw_subject(axis: Axes, rows: pd.DataFrame, name: str, offset: float, style: Mapping[str, Any]) -> None:
    """Values of one subject by the number of their condition, and a line through the means of those to be trusted."""
    trusted = rows["trusted"].eq(True) if "trusted" in rows else np.ones(len(rows), dtype=bool)
    values, suspect = rows.loc[trusted, name].dropna(), rows.loc[~trusted, name].dropna()
    axis.plot(values.index + offset, values, "o", ms=2.6, mfc="none", color=style["color"], alpha=0.8)
    means = values.groupby(level=0).mean()
    axis.plot(means.index + offset, means, "-", **style)
    reduced = means[means.index.isin(suspect.index)]
    if len(reduced):
        axis.plot(reduced.index + offset, reduced, **{**FAULT_RING, "label": "mean without those with a warning"})
    if len(suspect):  # as an artist, which does not widen the axis: such values may be anywhere
        marks = Line2D(suspect.index + offset, suspect, marker="x", ms=4, ls="none", color="grey")
        marks.set(label="with a warning", transform=axis.transData)
        axis.add_artist(marks)
