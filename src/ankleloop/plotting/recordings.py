"""Figures of one recording (spectra, models, residuals), and of a group of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator

from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.plotting.method_styles import MethodStyle, method_styles, ordinal_styles
from ankleloop.plotting.panels import Panel, add_legend, panel_grid, tabulate_lines
from ankleloop.plotting.studies import estimates_figure
from ankleloop.plotting.style import REFERENCE_LINE, STYLE, DataFigure
from ankleloop.quantities import QUANTITIES

if TYPE_CHECKING:
    from ankleloop.assessment.residuals import ResidualTest
    from ankleloop.joint.estimate import Estimate

LONGEST = 0.4  # s of impulse responses
FREQUENCIES = np.geomspace(0.2, 38.0, 200)  # Hz of Bode diagrams
MARGIN = 0.08  # of the range of the values that are shown, at either side


@matplotlib.rc_context(STYLE)
def spectra_figure(spectra: Mapping[str, np.ndarray]) -> DataFigure:
    """Power spectra of position and torque, and their coherence."""
    figure, axes = panel_grid(3, 3, 48.0)
    frequency = spectra["frequency"]
    for axis, name, unit in zip(axes, ("position", "torque"), ("rad²/Hz", "(N·m)²/Hz"), strict=False):
        axis.loglog(frequency, spectra[name], color="#444444", label=name)
        axis.set_ylabel(f"{name} [{unit}]")
    names = {"coherence": "position and torque", "reference_coherence": "reference and position"}
    pairs = {name: label for name, label in names.items() if name in spectra}
    for (name, label), style in zip(pairs.items(), ordinal_styles(pairs).values(), strict=True):
        dashes = {"ls": (0, (4, 1.2))} if name == "reference_coherence" else {}
        axes[2].semilogx(frequency, spectra[name], color=style.colour, label=label, **dashes)
    axes[2].set(ylabel="squared coherence [1]", ylim=(0, 1.02))
    for axis in axes:
        axis.set_xlabel("frequency [Hz]")
        axis.xaxis.set_major_formatter("{x:g}")
    add_legend(figure, axes[2:])
    figure.data = tabulate_lines(axes)
    return figure


@matplotlib.rc_context(STYLE)
def model_figure(estimates: Mapping[str, Estimate], *, styles: Mapping[str, MethodStyle] | None = None) -> DataFigure:
    """Models of several methods: impulse responses, Bode diagrams, and the nonlinearity of the reflex."""
    styles = styles or method_styles({label: estimate.method for label, estimate in estimates.items()})
    figure, axes = panel_grid(6, 3, 52.0)
    intrinsic, intrinsic_gain, curve, *_ = axes
    # The first panel has the responses of methods that are not parametric, else the phase of the parametric models.
    with_responses = any("intrinsic_response" in estimate.diagnostics for estimate in estimates.values())
    if with_responses:
        intrinsic.set(xlabel="time [s]", ylabel="intrinsic response [N·m/rad]", title="per sample, two-sided")
    else:
        intrinsic.set(xlabel="frequency [Hz]", ylabel="intrinsic phase [°]", xscale="log")
        intrinsic.xaxis.set_major_formatter("{x:g}")
    for label, estimate in estimates.items():
        style = {**styles[label].line, "label": label}
        s = 2j * np.pi * FREQUENCIES
        response = estimate.stiffness["K"] + estimate.stiffness["B"] * s + estimate.stiffness["I"] * s**2
        if not with_responses:
            intrinsic.plot(FREQUENCIES, np.degrees(np.unwrap(np.angle(response))), **style)
        elif "intrinsic_response" in estimate.diagnostics:
            lags, samples = (estimate.diagnostics[f"intrinsic_{name}"] for name in ("lags", "response"))
            intrinsic.plot(lags, samples, marker="o", ms=1.6, **style)
        intrinsic_gain.loglog(FREQUENCIES, np.abs(response), **style)
        if "omega_n" in estimate.reflex:
            _draw_reflex(axes[3:], estimate, style)
        nonlinearity = estimate.diagnostics.get("nonlinearity")
        if nonlinearity is not None:
            curve.plot(nonlinearity["velocity"], nonlinearity["torque"], **style)
    intrinsic_gain.set(xlabel="frequency [Hz]", ylabel="intrinsic gain [N·m/rad]")
    curve.set(xlabel="delayed velocity [rad/s]", ylabel="nonlinearity [N·m]")
    axes[3].set(xlabel="time after the movement [s]", ylabel="reflex response [1/s]", title="of unit gain")
    axes[4].set(xlabel="frequency [Hz]", ylabel="reflex gain over that at rest [1]")
    axes[5].set(xlabel="frequency [Hz]", ylabel="reflex phase without delay [°]")
    for axis in (intrinsic_gain, *axes[4:]):
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter("{x:g}")
    intrinsic_gain.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))  # hardly more than a decade
    intrinsic_gain.yaxis.set_major_formatter("{x:g}")
    intrinsic_gain.yaxis.set_minor_formatter("")
    add_legend(figure, (intrinsic_gain, curve))  # the others have the same methods
    figure.data = tabulate_lines(axes)
    return figure


def _draw_reflex(axes: Sequence[Axes], estimate: Estimate, style: Mapping[str, Any]) -> None:
    """Low-pass of the reflex, and the impulse response of a method that is not parametric; both after the delay."""
    response, gain, phase = axes
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
    phase.plot(FREQUENCIES, np.degrees(np.unwrap(np.angle(low_pass))), **style)


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


def recordings_figure(
    table: pd.DataFrame, names: Sequence[str], *, styles: Mapping[str, MethodStyle] | None = None
) -> DataFigure:
    """Parameters of all recordings with their 95 % intervals: a panel for each, a row for a recording.

    A ring marks estimates with a warning. They may be anywhere: the axes are those of the others, and arrow heads
    stand for what is beyond.
    """
    rows = table.apply(_name_recording, axis="columns")
    trusted = table["trusted"].eq(True)
    parts, panels = [], {}
    for name in names:
        ends = {end: table.get(f"{name}_{end}", pd.Series(np.nan, table.index)) for end in ("low", "high")}
        part = pd.DataFrame({"panel": name, "row": rows, "series": table["label"], "value": table[name], **ends})
        parts.append(part.assign(fault=~trusted & table[name].notna()))
        shown = part.loc[trusted if trusted.any() else ~trusted, ["value", "low", "high"]]
        low, high = shown.min(axis=None), shown.max(axis=None)
        margin = MARGIN * (high - low) or MARGIN * abs(high) or 1.0
        limits = (low - margin, high + margin) if np.isfinite(high) else None
        panels[name] = Panel(QUANTITIES[name].label, limits=limits)
    return estimates_figure(pd.concat(parts, ignore_index=True), panels, styles=styles)


def _name_recording(row: pd.Series) -> str:
    """Name of a recording, with subject and condition where the table has them."""
    groups = [str(row[name]) for name in ("subject", "condition") if pd.notna(row.get(name))]
    named = ", ".join(name for name in groups if name not in ("", "–"))
    return f"{row['recording']} ({named})" if named else str(row["recording"])
