"""Figures of one recording (spectra, models, residuals), and of a group of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ankleloop.assessment.residuals import ResidualTest
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.models import ResponseModel
from ankleloop.plotting.panels import Panel, Styles, curve, draw_panels, estimates_figure, finish
from ankleloop.plotting.style import (
    REFERENCE_LINE,
    DataFigure,
    MethodStyle,
    estimate_styles,
    method_styles,
)
from ankleloop.quantities import QUANTITIES, STIFFNESS
from ankleloop_lab.recordings.comparison import select_rows

LONGEST_RESPONSE = 0.4  # s
RESPONSE_RATE = 1e3  # Hz
BODE_FREQUENCIES = np.geomspace(0.2, 38.0, 200)  # Hz
MARGIN = 0.08  # of the range of the values that are shown, at either side
FREQUENCY = "frequency [Hz]"
PER_SAMPLE = {"ls": "", "marker": ".", "ms": 2.5, "mew": 0.0}  # look of a reflex response
SIGNAL = MethodStyle("#444444", "")
SUBJECT = MethodStyle("#999999", "o", more={"lw": 0.7, "ms": 2.5})
MEAN = MethodStyle("#1B1044", "D")
MEAN_SERIES = "mean over subjects"
DIFFERENCE = MethodStyle("#1B1044", "s")
DIFFERENCE_SERIES = "mean of the differences within subjects"
SPECTRUM_STYLES = {
    "position": SIGNAL,
    "torque": SIGNAL,
    "position and torque": MethodStyle("#1B1044", ""),
    "reference and position": MethodStyle("#2A788E", "", dashes=(4, 1.2)),
}
SPECTRUM_PANELS = {
    "position": Panel("position [rad²/Hz]", xlabel=FREQUENCY, log="xy"),
    "torque": Panel("torque [(N·m)²/Hz]", xlabel=FREQUENCY, log="xy"),
    "coherence": Panel("squared coherence [1]", limits=(0.0, 1.02), xlabel=FREQUENCY, log="x"),
}
SPECTRA = {  # panel and series of each
    "position": ("position", "_position"),
    "torque": ("torque", "_torque"),
    "coherence": ("coherence", "position and torque"),
    "reference_coherence": ("coherence", "reference and position"),
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
    parts = [
        curve(*place, spectra["frequency"], spectra[name])
        for name, place in SPECTRA.items()
        if name in spectra
    ]
    table = pd.concat(parts)
    return finish(draw_panels(table, SPECTRUM_PANELS, SPECTRUM_STYLES, height=48.0))


def model_figure(estimates: Mapping[str, Estimate]) -> DataFigure:
    """Models of several methods: impulse responses, Bode diagrams, and the nonlinearity of the reflex.

    The first panel has the responses of methods that are not parametric, else the phase of the parametric models.
    """
    styles = estimate_styles(estimates)
    parts = []
    for label, estimate in estimates.items():
        parts += _list_curves(label, estimate)
        styles[f"{label}, per sample"] = replace(styles[label], more=PER_SAMPLE)
    table = pd.concat(parts)
    panels = dict(MODEL_PANELS)
    del panels["phase" if "response" in set(table["panel"]) else "response"]
    return finish(draw_panels(table, panels, styles, height=52.0))


def _list_curves(label: str, estimate: Estimate) -> list[pd.DataFrame]:
    """Curves of a model; those of the reflex are after its delay."""
    s = 2j * np.pi * BODE_FREQUENCIES
    curves = []
    if set(STIFFNESS) <= set(estimate.stiffness):  # the record may not show all of them
        coefficients = np.array([estimate.stiffness[name] for name in STIFFNESS])
        response = coefficients @ np.vander(s, 3, increasing=True).T
        curves = [
            curve("phase", label, BODE_FREQUENCIES, _phase(response)),
            curve("gain", label, BODE_FREQUENCIES, np.abs(response)),
        ]
    model = estimate.predictor
    if isinstance(model, ResponseModel):
        lags = model.lags()["intrinsic_lag"].values
        curves.append(curve("response", f"_{label}", lags, model.intrinsic))
    nonlinearity = estimate.diagnostics.get("nonlinearity")
    if nonlinearity is not None:
        curves.append(
            curve("nonlinearity", label, nonlinearity["velocity"], nonlinearity["torque"])
        )
    reflex = estimate.reflex
    if "omega_n" not in reflex:
        return curves
    dynamics = ReflexDynamics(reflex["omega_n"], reflex["zeta"], reflex.get("pole"))
    low_pass = dynamics.response(s)[0]
    time = np.arange(0.0, LONGEST_RESPONSE, 1.0 / RESPONSE_RATE)
    frequencies = np.fft.rfftfreq(4096, 1.0 / RESPONSE_RATE)
    samples = np.fft.irfft(dynamics.response(2j * np.pi * frequencies)[0])[: time.size]
    curves += [
        curve("reflex gain", label, BODE_FREQUENCIES, np.abs(low_pass)),
        curve("reflex phase", label, BODE_FREQUENCIES, _phase(low_pass)),
        curve("reflex response", label, reflex["delay"] + time, samples * RESPONSE_RATE),
    ]
    if isinstance(model, ResponseModel):
        lags = model.lags()["reflex_lag"].values
        shown = lags < LONGEST_RESPONSE
        times = reflex["delay"] + lags[shown]
        unit_gain = model.reflex[shown] / reflex["G"] / lags[1]
        curves.append(curve("reflex response", f"_{label}, per sample", times, unit_gain))
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
        parts.append(curve("density", label, test.frequency, test.density))
        parts.append(curve("correlation", label, test.lags, test.correlation))
    figure = draw_panels(pd.concat(parts), panels, styles, columns=2, height=55.0)
    limit = next(iter(tests.values())).limit
    for level in (-limit, limit):
        figure.axes[1].axhline(level, **REFERENCE_LINE, label="99 % of unrelated ones")
    return finish(figure)


def recordings_figure(table: pd.DataFrame, names: Sequence[str]) -> DataFigure:
    """Parameters of all recordings with their 95 % intervals: a panel for each, a row for a recording.

    A ring marks estimates with a warning. They may be anywhere: the axes are those of the others, and arrow heads
    stand for what is beyond. A recording without an estimate has an empty row.
    """
    rows = table.apply(_name_recording, axis="columns")
    trusted = table["trusted"].eq(True)
    labels = table["label"].astype("string")
    parts = []
    panels = {}
    for name in names:
        values = table.reindex(columns=[name, f"{name}_low", f"{name}_high"])
        values = values.set_axis(["value", "low", "high"], axis="columns")
        marked = ~trusted & values["value"].notna()
        parts.append(
            pd.DataFrame({"panel": name, "row": rows, "series": labels, **values, "marked": marked})
        )
        shown = values[trusted if trusted.any() else ~trusted]
        low = shown.min(axis=None)
        high = shown.max(axis=None)
        margin = MARGIN * (high - low) or MARGIN * abs(high) or 1.0
        limits = (low - margin, high + margin) if np.isfinite(high) else None
        panels[name] = Panel(QUANTITIES[name].label, limits=limits)
    return estimates_figure(pd.concat(parts), panels)


def _name_recording(row: pd.Series) -> str:
    """Name of a recording, with subject and condition where the table has them."""
    known = row.reindex(["subject", "condition"]).fillna("").astype(str)
    group = ", ".join(text for text in known if text not in ("", "–"))
    return f"{row['recording']} ({group})" if group else str(row["recording"])


def comparison_figure(
    table: pd.DataFrame,
    comparison: pd.DataFrame,
    condition: str = "condition",
    within: str = "subject",
) -> DataFigure:
    """Parameters against the condition: a line for each subject, and the mean over subjects with its 95 % interval.

    Beside them are the paired differences from the first condition with their 95 % intervals.

    Conditions that are all numbers have their places on the axis, others are side by side.

    Parameters
    ----------
    table : pandas.DataFrame
        A row for each recording.
    comparison : pandas.DataFrame
        What `ankleloop.compare` makes of it.
    condition, within : str
        Columns of the conditions and of the subjects.

    Returns
    -------
    DataFigure

    Examples
    --------
    >>> from ankleloop import compare
    >>> table = pd.DataFrame({"subject": list("abab"), "condition": [0, 0, 10, 10], "K": [90.0, 110.0, 130.0, 152.0]})
    >>> figure = comparison_figure(table, compare(table))
    >>> figure.axes[0].get_ylabel(), len(figure.axes[0].lines)
    ('K [N·m/rad]', 3)
    """
    means = comparison[comparison["kind"] == "mean"]
    conditions = means["condition"].unique()
    is_numeric = pd.api.types.is_numeric_dtype(means["condition"])
    x = conditions if is_numeric else np.arange(len(conditions))
    used = select_rows(table, [condition, within])
    places = dict(zip(conditions, x, strict=True))
    differences = comparison[
        (comparison["kind"] == "difference") & (comparison["reference"] == conditions[0])
    ]
    parts = []
    panels = {}
    styles = {MEAN_SERIES: MEAN}
    for name, rows in means.groupby("parameter", sort=False):
        panels[name] = Panel(QUANTITIES[name].label, xlabel=condition)
        values = used.pivot_table(name, condition, within, observed=True).reindex(conditions)
        for subject in values:
            series = f"{within} {subject}"
            styles[series] = SUBJECT
            parts.append(curve(name, f"_{series}", x, values[subject].to_numpy()))
        ends = rows[["low", "high"]].to_numpy().T
        mean = rows["value"].to_numpy()
        parts.append(curve(name, MEAN_SERIES, x, mean, low=ends[0], high=ends[1]))
        beside = differences[differences["parameter"] == name]
        if beside.empty:
            continue
        title = f"difference from {conditions[0]}"
        label = f"Δ{QUANTITIES[name].label}"
        panels[f"{name} difference"] = Panel(label, title, xlabel=condition, joined=False)
        ends = beside[["low", "high"]].to_numpy().T
        columns = {"low": ends[0], "high": ends[1]}
        at = beside["condition"].map(places).to_numpy(float)
        parts.append(curve(f"{name} difference", DIFFERENCE_SERIES, at, beside["value"], **columns))
    styles[DIFFERENCE_SERIES] = DIFFERENCE
    figure = draw_panels(pd.concat(parts), panels, styles, columns=2)
    margin = 0.3 * np.min(np.diff(x), initial=1.0)
    for axis, panel in zip(figure.axes, panels.values(), strict=True):
        axis.set_xticks(x, list(map(str, conditions)))
        axis.set_xlim(np.min(x) - margin, np.max(x) + margin)
        if not panel.joined:
            axis.axhline(0.0, **REFERENCE_LINE)
    return finish(figure)


def levels_figure(table: pd.DataFrame) -> DataFigure:
    """K of all recordings against the mean torque and the mean position, by condition.

    A joint is stiffer where it is held with more torque: what looks like an effect of a condition may be one of that.
    """
    conditions = table.get("condition", pd.Series("", table.index)).fillna("").astype(str)
    series = conditions.where(conditions != "", "recordings")
    parts = []
    panels = {}
    for level in ("mean_torque", "mean_position"):
        panels[level] = Panel(QUANTITIES["K"].label, xlabel=QUANTITIES[level].label, joined=False)
        for name, rows in table.groupby(series, sort=False):
            ends = rows.reindex(columns=["K_low", "K_high"]).to_numpy(float).T
            columns = {"low": ends[0], "high": ends[1]}
            parts.append(curve(level, str(name), rows[level], rows["K"], **columns))
    figure = draw_panels(pd.concat(parts), panels, columns=2)
    for axis in figure.axes:  # long numbers stand beside one another
        axis.locator_params("x", nbins=4)
    return finish(figure)
