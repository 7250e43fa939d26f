"""Torques of a whole record as series: measured, true, estimated by each method, and what each method leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import TORQUES
from ankleloop.plotting.envelopes import envelope
from ankleloop.plotting.method_styles import MethodStyle, method_styles
from ankleloop.plotting.style import MEASURED_LINE, TRUE_LINE

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.joint.estimate import Estimate
    from ankleloop.joint.prepared import PreparedTrial


@dataclass(frozen=True, eq=False)
class Trace:
    """A torque over regular times, as samples or as the ends of bins of samples."""

    start: float  # time of the first sample, or of the start of the first bin [s]
    step: float  # time between samples, or between the starts of bins [s]
    low: np.ndarray  # shape (N,): lower end of each bin [N·m]
    high: np.ndarray  # shape (N,): upper end of each bin [N·m]; for samples the same array

    @property
    def sampled(self) -> bool:
        """Whether these are samples."""
        return self.low is self.high

    @property
    def values(self) -> int:
        """Numbers that it takes."""
        return self.low.size if self.sampled else 2 * self.low.size


@dataclass(frozen=True, eq=False)
class TorqueSeries:
    """What one switch of a figure shows: a trace of each torque that it has."""

    label: str  # name of the series
    kind: str  # what it is
    colour: str  # as "#rrggbb", or a name
    traces: Mapping[str, Trace]  # by "net", "intrinsic" and "reflex"


@dataclass(frozen=True, eq=False)
class CentredTorques:
    """Torques at the samples of an estimate, each less its mean over them [N·m]."""

    time: np.ndarray  # shape (N,): times of the samples [s]
    measured: np.ndarray  # shape (N,): the measured torque
    true: Mapping[str, np.ndarray]  # shape (N,): true torques by "net", "intrinsic" and "reflex"; none of a recording
    estimated: Mapping[str, np.ndarray]  # shape (N,): estimated torques by the same names


def centre_torques(trial: PreparedTrial, estimate: Estimate) -> CentredTorques:
    """Measured, true and estimated torques at the samples of an estimate, each less its mean."""
    time, rate = estimate.torque["time"].values, estimate.torque.attrs["identification_rate"]
    true: dict[str, np.ndarray] = {}
    if {"torque_intrinsic", "torque_reflex"} <= set(trial.trial.data_vars):
        parts = {part: _centre(trial.channel_at(f"torque_{part}", time, rate)) for part in ("intrinsic", "reflex")}
        true = {"net": parts["intrinsic"] + parts["reflex"], **parts}
    return CentredTorques(
        time=time,
        measured=_centre(trial.channel_at("torque", time, rate)),
        true=true,
        estimated={torque: _centre(estimate.torque[torque].values) for torque in TORQUES},
    )


def _centre(values: np.ndarray) -> np.ndarray:
    return values - values.mean()


def torque_series(
    trial: xr.Dataset | PreparedTrial,
    estimates: Mapping[str, Estimate],
    *,
    styles: Mapping[str, MethodStyle] | None = None,
) -> list[TorqueSeries]:
    """Torques of a whole record, all less their means over the samples of their estimate.

    A residual is the torque of the trial less the estimated one. The net torque of a trial is the measured one; its
    parts are known in simulations only, so that a recording has no residual of them.
    """
    trial = prepare(trial)
    styles = styles or method_styles({label: estimate.method for label, estimate in estimates.items()})
    longest = max(estimates.values(), key=lambda estimate: estimate.torque.sizes["time"])
    torques = centre_torques(trial, longest)
    measured = {"net": _trace(longest, torques.measured)}
    series = [TorqueSeries("measured", "measured", MEASURED_LINE["color"], measured)]
    if torques.true:
        true = {torque: _trace(longest, values) for torque, values in torques.true.items()}
        series.append(TorqueSeries("true (simulated)", "true", TRUE_LINE["color"], true))
    residuals = []
    for label, estimate in estimates.items():
        torques = centre_torques(trial, estimate)
        targets = {**torques.true, "net": torques.measured}
        errors = {torque: targets[torque] - torques.estimated[torque] for torque in TORQUES if torque in targets}
        estimated = {torque: _trace(estimate, values) for torque, values in torques.estimated.items()}
        residual = {torque: _trace(estimate, values) for torque, values in errors.items()}
        colour = styles[label].colour
        series.append(TorqueSeries(label, "estimate", colour, estimated))
        residuals.append(TorqueSeries(f"residual of {label}", "residual", colour, residual))
    return series + residuals


def _trace(estimate: Estimate, values: np.ndarray) -> Trace:
    samples = np.asarray(values, dtype=np.float32)
    start, step = float(estimate.torque["time"].values[0]), 1.0 / float(estimate.torque.attrs["identification_rate"])
    return Trace(start, step, samples, samples)


def limit_values(series: Sequence[TorqueSeries], most: int) -> list[TorqueSeries]:
    """Series in a limited amount of numbers: those of long records become ends of bins, in which no peak is lost."""
    total = sum(trace.values for item in series for trace in item.traces.values())
    if total <= most:
        return list(series)
    count = sum(len(item.traces) for item in series)
    width = -(-2 * total // max(most - 2 * count, 2))  # the last bin of each trace may be incomplete
    return [
        replace(item, traces={torque: _bin_trace(trace, width) for torque, trace in item.traces.items()})
        for item in series
    ]


def _bin_trace(trace: Trace, width: int) -> Trace:
    low, high = envelope(trace.low, width)
    return Trace(trace.start, trace.step * width, low, high)
