"""Figures of one recording (spectra, models, residuals), and of a group of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.models import ResponseModel
from ankleloop.plotting.panels import Panel, Styles, draw_panels, finish
from ankleloop.plotting.studies import estimates_figure
from ankleloop.plotting.style import REFERENCE_LINE, DataFigure, MethodStyle, method_styles
from ankleloop.quantities import QUANTITIES

if TYPE_CHECKING:
    from ankleloop.assessment.residuals import ResidualTest
    from ankleloop.joint.estimate import Estimate

LONGEST = 0.4  # s of impulse responses
FREQUENCIES = np.geomspace(0.2, 38.0, 200)  # Hz of Bode diagrams
MARGIN = 0.08  # of the range of the values that are shown, at either side
FREQUENCY, COHERENCE = "frequency [Hz]", "squared coherence [1]"
SAMPLES = "samples"  # of the reflex response
SIGNAL = MethodStyle("#444444", "")
SPECTRA = {  # panel, legend and style of each
    "position": ("position [rad²/Hz]", "_position", SIGNAL),
    "torque": ("torque [(N·m)²/Hz]", "_torque", SIGNAL),
    "coherence": (COHERENCE, "position and torque", MethodStyle("#1B1044", "")),
    "reference_coherence": (
        COHERENCE,
        "reference and position",
        MethodStyle("#2A788E", "", dashes=(4, 1.2)),
    ),
}
MODEL_PANELS = {
    "phase": Panel("intrinsic phase [°]", xlabel=FREQUENCY, log="x"),
    "response": Panel("intrinsic response [N·m/rad]", "per sample, two-sided", xlabel="time [s]"),
    "gain": Panel("intrinsic gain [N·m/rad]", xlabel=FREQUENCY, log="xy"),
    "nonlinearity": Panel("nonlinearity [N·m]", xlabel="delayed velocity [rad/s]"),
    "reflex response": Panel(
        "reflex response [1/s]", "of unit gain", xlabel="time after the movement [s]"
    ),
    "reflex gain": Panel("reflex gain over that at rest [1]", xlabel=FREQUENCY, log="xy"),
    "reflex phase": Panel("reflex phase without delay [°]", xlabel=FREQUENCY, log="x"),
}


def spectra_figure(spectra: Mapping[str, np.ndarray]) -> DataFigure:
    """Power spectra of position and torque, and their coherence."""
    shown = {name: SPECTRA[name] for name in SPECTRA if name in spectra}
    panels = {label: Panel(label, xlabel=FREQUENCY, log="xy") for label, *_ in shown.values()}
    panels |= {COHERENCE: Panel(COHERENCE, limits=(0.0, 1.02), xlabel=FREQUENCY, log="x")}
    styles = {series.lstrip("_"): style for _, series, style in shown.values()}
    parts = [
        pd.DataFrame(
            {"panel": label, "series": series, "x": spectra["frequency"], "value": spectra[name]}
        )
        for name, (label, series, _) in shown.items()
    ]
    return finish(draw_panels(pd.concat(parts), panels, styles, height=48.0)[0])


def model_figure(estimates: Mapping[str, Estimate], *, styles: Styles | None = None) -> DataFigure:
    """Models of several methods: impulse responses, Bode diagrams, and the nonlinearity of the reflex.

    The first panel has the responses of methods that are not parametric, else the phase of the parametric models.
    """
    styles = styles or method_styles(
        {label: estimate.method for label, estimate in estimates.items()}
    )
    parts = [
        pd.DataFrame(
            {"panel": panel, "series": "_" * (panel == "response") + label, "x": x, "value": value}
        )
        for label, estimate in estimates.items()
        for panel, (x, value) in _list_curves(estimate).items()
    ]
    table = pd.concat(parts)
    points = table["panel"] == SAMPLES
    table.loc[points, "series"] = "_" + table.loc[points, "series"] + ", per sample"
    look = {"ls": "", "marker": ".", "ms": 2.5, "mew": 0.0}
    per_sample = {
        f"{label}, per sample": replace(style, more=look) for label, style in styles.items()
    }
    hidden = "phase" if "response" in set(table["panel"]) else "response"
    panels = {name: panel for name, panel in MODEL_PANELS.items() if name != hidden}
    table["panel"] = table["panel"].replace(SAMPLES, "reflex response")
    return finish(draw_panels(table, panels, {**styles, **per_sample}, height=52.0)[0])


def _list_curves(estimate: Estimate) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Abscissae and ordinates of a model by their panels; those of the reflex are after its delay."""
    details, values, s = estimate.diagnostics, estimate.reflex, 2j * np.pi * FREQUENCIES
    response = (
        estimate.stiffness["K"] + estimate.stiffness["B"] * s + estimate.stiffness["I"] * s**2
    )
    curves = {"phase": (FREQUENCIES, _phase(response)), "gain": (FREQUENCIES, np.abs(response))}
    model = estimate.predictor
    if isinstance(model, ResponseModel):
        curves["response"] = model.lags()["intrinsic_lag"].values, model.intrinsic
    if details.get("nonlinearity") is not None:
        curves["nonlinearity"] = (
            details["nonlinearity"]["velocity"],
            details["nonlinearity"]["torque"],
        )
    if "omega_n" in values:
        dynamics = ReflexDynamics(values["omega_n"], values["zeta"], values.get("pole"))
        low_pass = dynamics.response(s)[0]
        curves |= {
            "reflex gain": (FREQUENCIES, np.abs(low_pass)),
            "reflex phase": (FREQUENCIES, _phase(low_pass)),
        }
        time = np.arange(0.0, LONGEST, 1e-3)
        samples = (
            np.fft.irfft(dynamics.response(2j * np.pi * np.fft.rfftfreq(4096, 1e-3))[0])[
                : time.size
            ]
            * 1e3
        )
        curves["reflex response"] = values["delay"] + time, samples
    if "omega_n" in values and isinstance(model, ResponseModel):
        lags = model.lags()["reflex_lag"].values
        window = lags < LONGEST
        curves[SAMPLES] = (
            values["delay"] + lags[window],
            model.reflex[window] / values["G"] / (lags[1] - lags[0]),
        )
    return curves


def _phase(response: np.ndarray) -> np.ndarray:
    return np.degrees(np.unwrap(np.angle(response)))


def residual_figure(
    tests: Mapping[str, ResidualTest], *, styles: Styles | None = None
) -> DataFigure:
    """Residuals of several methods: spectra, and correlation with the signal that must not explain them."""
    styles = styles or method_styles({label: label for label in tests})
    panels = {
        "density": Panel("residual torque [(N·m)²/Hz]", xlabel=FREQUENCY, log="xy"),
        "correlation": Panel(
            "whitened correlation [1]", xlabel="time by which the residual is behind [s]"
        ),
    }
    parts = []
    for label, test in tests.items():
        for panel, x in (("density", test.frequency), ("correlation", test.lags)):
            parts.append(
                pd.DataFrame(
                    {"panel": panel, "series": label, "x": x, "value": getattr(test, panel)}
                )
            )
    figure, axes = draw_panels(pd.concat(parts), panels, styles, columns=2, height=55.0)
    limit = next(iter(tests.values())).limit
    for level in (-limit, limit):
        axes[1].axhline(level, **REFERENCE_LINE, label="99 % of unrelated ones")
    return finish(figure)


def recordings_figure(
    table: pd.DataFrame, names: Sequence[str], *, styles: Styles | None = None
) -> DataFigure:
    """Parameters of all recordings with their 95 % intervals: a panel for each, a row for a recording.

    A ring marks estimates with a warning. They may be anywhere: the axes are those of the others, and arrow heads
    stand for what is beyond.
    """
    rows = table.apply(_name_recording, axis="columns")
    trusted = table["trusted"].eq(True)
    parts, panels = [], {}
    for name in names:
        ends = {
            end: table.get(f"{name}_{end}", pd.Series(np.nan, table.index))
            for end in ("low", "high")
        }
        part = pd.DataFrame(
            {"panel": name, "row": rows, "series": table["label"], "value": table[name], **ends}
        )
        parts.append(part.assign(fault=~trusted & table[name].notna()))
        shown = part.loc[trusted if trusted.any() else ~trusted, ["value", "low", "high"]]
        low, high = shown.min(axis=None), shown.max(axis=None)
        margin = MARGIN * (high - low) or MARGIN * abs(high) or 1.0
        panels[name] = Panel(
            QUANTITIES[name].label,
            limits=(low - margin, high + margin) if np.isfinite(high) else None,
        )
    return estimates_figure(pd.concat(parts, ignore_index=True), panels, styles=styles)


def _name_recording(row: pd.Series) -> str:
    """Name of a recording, with subject and condition where the table has them."""
    groups = [str(row[name]) for name in ("subject", "condition") if pd.notna(row.get(name))]
    named = ", ".join(name for name in groups if name not in ("", "–"))
    return f"{row['recording']} ({named})" if named else str(row["recording"])
