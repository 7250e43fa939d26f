"""Figures of one recording (spectra, models, residuals), and of a group of recordings."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.plotting.legends import add_legend
from ankleloop.plotting.method_styles import MethodStyle, method_styles, ordinal_styles
from ankleloop.plotting.panels import panel_grid, split_label, tabulate_lines
from ankleloop.plotting.style import FAULT_RING, MARK, REFERENCE_LINE, STYLE, TWO_COLUMNS, DataFigure, inches
from ankleloop.quantities import QUANTITIES

if TYPE_CHECKING:
    import pandas as pd

    from ankleloop.assessment.residuals import ResidualTest
    from ankleloop.joint.estimate import Estimate

LONGEST = 0.4  # s of impulse responses
FREQUENCIES = np.geomspace(0.2, 38.0, 200)  # Hz of Bode diagrams
GROUP_COLUMNS = 4  # methods side by side; more are drawn below
TITLE = 24  # characters of a line above a panel
MOST_SUBJECTS = 9  # that have an entry in the legend
CHARACTERS = 110  # of tick labels that fit side by side into the width of a figure


@matplotlib.rc_context(STYLE)
def spectra_figure(spectra: Mapping[str, np.ndarray]) -> DataFigure:
    """Power spectra of position and torque, and their coherence."""
    figure, axes = panel_grid(3, 3, 48.0)
    position, torque, coherence = axes
    frequency = spectra["frequency"]
    for axis, name, unit in ((position, "position", "rad²/Hz"), (torque, "torque", "(N·m)²/Hz")):
        axis.loglog(frequency, spectra[name], color="#444444", label=name)
        axis.set_ylabel(f"{name} [{unit}]")
    names = {"coherence": "position and torque", "reference_coherence": "reference and position"}
    pairs = {name: label for name, label in names.items() if name in spectra}
    for (name, label), style in zip(pairs.items(), ordinal_styles(pairs).values(), strict=True):
        dashes = {"ls": (0, (4, 1.2))} if name == "reference_coherence" else {}
        coherence.semilogx(frequency, spectra[name], color=style.colour, label=label, **dashes)
    coherence.set(ylabel="squared coherence [1]", ylim=(0, 1.02))
    for axis in axes:
        axis.set_xlabel("frequency [Hz]")
        axis.xaxis.set_major_formatter("{x:g}")
    add_legend(figure, [coherence])
    figure.data = tabulate_lines(axes)
    return figure


@matplotlib.rc_context(STYLE)
def model_figure(estimates: Mapping[str, Estimate], *, styles: Mapping[str, MethodStyle] | None = None) -> DataFigure:
    """Models of several methods: impulse responses, Bode diagrams, and the nonlinearity of the reflex."""
    styles = styles or method_styles({label: estimate.method for label, estimate in estimates.items()})
    figure, axes = panel_grid(6, 3, 52.0)
    intrinsic, intrinsic_gain, curve, reflex, reflex_gain, reflex_phase = axes
    # The first panel has the responses of methods that are not parametric, else the phase of the parametric models.
    with_responses = any("intrinsic_response" in estimate.diagnostics for estimate in estimates.values())
    for label, estimate in estimates.items():
        style = {**styles[label].line, "label": label}
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
    intrinsic_gain.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))  # hardly more than a decade
    intrinsic_gain.yaxis.set_major_formatter("{x:g}")
    intrinsic_gain.yaxis.set_minor_formatter("")
    add_legend(figure, (intrinsic_gain, curve))  # the others have the same methods
    figure.data = tabulate_lines(axes)
    return figure


def _intrinsic_response(estimate: Estimate) -> np.ndarray:
    """Frequency response of K, B and I."""
    s = 2j * np.pi * FREQUENCIES
    K, B, I = (estimate.stiffness[name] for name in "KBI")  # noqa: E741 - the field's name
    return K + B * s + I * s**2


def _draw_intrinsic_response(axis: Axes, estimate: Estimate, style: Mapping[str, Any]) -> None:
    """Two-sided impulse response of a method that has one."""
    if "intrinsic_response" in estimate.diagnostics:
        lags, response = (estimate.diagnostics[f"intrinsic_{name}"] for name in ("lags", "response"))
        axis.plot(lags, response, marker="o", ms=1.6, **style)


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
        points = {"marker": ".", "ls": "", "ms": 2.5, "mew": 0.0, "color": style["color"]}
        response.plot(delay + lags[window], samples[window], **points, label=f"{style['label']}, per sample")
    low_pass = dynamics.response(2j * np.pi * FREQUENCIES)[0]
    gain.loglog(FREQUENCIES, np.abs(low_pass), **style)
    _draw_phase(phase, low_pass, style)


@matplotlib.rc_context(STYLE)
def residual_figure(
    tests: Mapping[str, ResidualTest], *, styles: Mapping[str, MethodStyle] | None = None
) -> DataFigure:
    """Residuals of several methods: spectra, and correlation with the signal that must not explain them."""
    styles = styles or method_styles({label: label for label in tests})
    figure, (density, correlation) = panel_grid(2, 2, 55.0)
    for label, test in tests.items():
        style = {**styles[label].line, "lw": 0.9, "label": label}
        density.loglog(test.frequency, test.density, **style)
        correlation.plot(test.lags, test.correlation, **style)
    limit = next(iter(tests.values())).limit
    for level in (-limit, limit):
        correlation.axhline(level, **REFERENCE_LINE, label="99 % of unrelated ones")
    density.set(xlabel="frequency [Hz]", ylabel="residual torque [(N·m)²/Hz]")
    density.xaxis.set_major_formatter("{x:g}")
    correlation.set(xlabel="time by which the residual is behind [s]", ylabel="whitened correlation [1]")
    add_legend(figure, (density, correlation))
    figure.data = tabulate_lines((density, correlation))
    return figure


@matplotlib.rc_context(STYLE)
def group_figure(
    table: pd.DataFrame, names: Sequence[str], *, condition: str = "condition", subject: str = "subject"
) -> DataFigure:
    """Parameters against the condition: a point for each recording, a line for the mean of each subject.

    Estimates with a warning are crosses where they lie within the axes, and are left out of the means; a ring marks
    such means.
    """
    labels, conditions, subjects = (list(dict.fromkeys(table[name])) for name in ("label", condition, subject))
    data = _tabulate_group(table, names, condition, subject)
    columns = min(GROUP_COLUMNS, len(labels))
    blocks = -(-len(labels) // columns)
    size = (inches(TWO_COLUMNS), inches((27.0 * len(names) + 14.0) * blocks))
    figure = DataFigure(figsize=size, layout="constrained")
    shape = len(names) * blocks, columns
    axes = figure.subplots(*shape, squeeze=False, sharex=True)
    styles = ordinal_styles(map(str, subjects))
    for number, (label, name) in enumerate(product(labels, names)):
        method, row = divmod(number, len(names))
        axis = axes[row + len(names) * (method // columns), method % columns]
        axis.sharey(axes[row, 0]) if axis is not axes[row, 0] else None
        rows = data[(data["method"] == label) & (data["name"] == name)]
        _draw_subjects(axis, rows, conditions, subjects, styles)
        axis.set_xticks(range(len(conditions)), conditions)
        axis.margins(x=0.15)
        axis.set_title(textwrap.fill(label, TITLE) if row == 0 else "")
        axis.tick_params(labelleft=method % columns == 0, labelbottom=row == len(names) - 1)
        axis.set_ylabel(QUANTITIES[name].label.replace(", ", ",\n") if method % columns == 0 else "")
        if row == len(names) - 1:
            axis.set_xlabel(condition)
            _turn_labels(axis, conditions, columns)
    for axis in axes.ravel():
        axis.set_visible(bool(axis.get_lines()))
    if len(subjects) <= MOST_SUBJECTS:
        add_legend(figure, axes.flat)
    figure.data = data.drop(columns="name")
    return figure


def _turn_labels(axis: Axes, conditions: Sequence[Any], columns: int) -> None:
    """Turn the names of conditions where they have no room side by side."""
    if sum(len(str(name)) + 2 for name in conditions) > CHARACTERS / columns:
        for label in axis.get_xticklabels():
            label.set(rotation=25, ha="right", rotation_mode="anchor")


def _tabulate_group(table: pd.DataFrame, names: Sequence[str], condition: str, subject: str) -> pd.DataFrame:
    """A row for each recording, method and parameter, with the mean over the recordings that are to be trusted."""
    table = table.assign(trusted=table["trusted"].eq(True) if "trusted" in table else True)
    columns = [*(["recording"] if "recording" in table else []), subject, condition, "label", "trusted"]
    data = table.melt(columns, list(names), "name", "value").rename(columns={"label": "method"})
    keys = ["method", "name", subject, condition]
    trusted = data.assign(value=data["value"].where(data["trusted"]))
    data["mean"] = trusted.groupby(keys, sort=False)["value"].transform("mean")
    quantities = [split_label(QUANTITIES[name].label) for name in data["name"]]
    data.insert(len(columns), "quantity", [quantity for quantity, _ in quantities])
    data.insert(len(columns) + 1, "unit", [unit for _, unit in quantities])
    return data.rename(columns={subject: "subject", condition: "condition"})


def _draw_subjects(
    axis: Axes,
    rows: pd.DataFrame,
    conditions: Sequence[Any],
    subjects: Sequence[Any],
    styles: Mapping[str, MethodStyle],
) -> None:
    """Values of each subject by the number of their condition, and a line through its means."""
    for number, person in enumerate(subjects):
        part = rows[rows["subject"] == person].assign(place=lambda part: part["condition"].map(conditions.index))
        offset = 0.24 * ((number + 0.5) / len(subjects) - 0.5)
        _draw_subject(axis, part.assign(place=part["place"] + offset), str(person), styles[str(person)])


def _draw_subject(axis: Axes, rows: pd.DataFrame, label: str, style: MethodStyle) -> None:
    """Values of one subject, and a line through the means of those to be trusted."""
    trusted = rows["trusted"].astype(bool)
    values, suspect = rows[trusted].dropna(subset="value"), rows[~trusted].dropna(subset="value")
    symbol = {**style.symbol, "markerfacecolor": "none", "ls": "", "ms": 2.6, "mew": 0.6}
    axis.plot(values["place"], values["value"], **symbol)
    means = values.drop_duplicates("place").sort_values("place")
    axis.plot(means["place"], means["mean"], **style.line, lw=1.0, label=label)
    reduced = means[means["place"].isin(suspect["place"])]
    if len(reduced):
        axis.plot(reduced["place"], reduced["mean"], **{**FAULT_RING, "label": "mean without those with a warning"})
    if len(suspect):  # as an artist, which does not widen the axis: such values may be anywhere
        marks = Line2D(suspect["place"], suspect["value"], marker="x", ms=4, ls="none", color="grey", gid=MARK)
        marks.set(label="with a warning", transform=axis.transData)
        axis.add_artist(marks)
