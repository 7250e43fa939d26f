"""The contract of a trial: which variables it has, and which faults make its samples unusable."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.signals.sampling import check_same_rate, compute_rate_of_parts, format_samples, parse_rate
from ankleloop.trials.channels import check_unit

CHANNELS = ("position", "torque", "reference")
REQUIRED = ("position", "torque")

SMALLEST, LARGEST = 1e-15, 1e15  # of a channel, rad or N·m
MAX_SPEED = 20.0  # rad/s: no joint moves faster; a position that does is usually in degrees


def validate(trial: xr.Dataset, *, source: str = "trial") -> xr.Dataset:
    """Check that a data set keeps the contract of a trial; it gets the sampling rate of its times if it has none."""
    if not isinstance(trial, xr.Dataset):
        raise DataError(f"{source}: a trial is an xarray.Dataset, not {type(trial).__name__}: make it with new_trial.")
    for name in (*REQUIRED, "time"):
        if name not in trial.variables:
            raise DataError(
                f"{source}: there is no variable {name} among {sorted(map(str, trial.variables))}: make the trial with "
                "new_trial, or name the variable in read_trial."
            )
    for name, variable in ((str(name), variable) for name, variable in trial.variables.items()):
        if variable.dims != ("time",) or variable.dtype != np.float64:
            raise DataError(
                f"{source}: {name} is of type {variable.dtype} and of shape {variable.shape} over {variable.dims}, not "
                "one float64 for each time: make the trial with new_trial; put numbers into attrs."
            )
        if name in CHANNELS or name.startswith("torque"):
            check_unit(name, name, str(variable.attrs.get("units", "")), "rad", source=source)
    time = trial.variables["time"].values
    measured = compute_rate_of_parts([time], time.size, source=source)
    if "sampling_rate" not in trial.attrs:
        trial = trial.assign_attrs(sampling_rate=measured)
    rate = parse_rate(trial.attrs["sampling_rate"], source=source)
    check_same_rate(rate, measured, source=source)
    check_samples([{str(name): trial.variables[name].values for name in trial.data_vars}], rate, time[0], source=source)
    return trial


def check_samples(blocks: Iterable[Mapping[str, np.ndarray]], rate: float, start: float = 0.0, *, source: str) -> None:
    """Refuse samples that are not finite, channels that are constant, and speeds that no joint reaches.

    The samples come in one block or several, of which the first one begins at `start` [s].
    """
    channels: dict[str, _Channel] = {}
    fastest, fastest_sample, before = 0.0, 0, np.empty(0)
    for block in blocks:
        position = np.concatenate([before, block["position"]]) if before.size else block["position"]
        for name, values in block.items():
            channels.setdefault(name, _Channel()).add(values)
        if not channels["position"].missing:
            sample, speed = peak_speed(position, rate)
            if not speed <= fastest:
                fastest, fastest_sample = speed, channels["position"].samples - position.size + sample
        before = position[-2 * _speed_margin(rate) :].copy()
    for name, channel in channels.items():
        if channel.missing:
            raise DataError(
                f"{source}: {name} is not finite at sample {channel.sample} ({start + channel.sample / rate:g} s), "
                f"{format_samples(channel.missing)} in all: cut the trial there or repair the channel."
            )
    for name in CHANNELS:
        if name in channels:
            _check_spread(name, channels[name], source)
    if not fastest <= MAX_SPEED:
        raise DataError(
            f"{source}: position moves at {fastest:.4g} rad/s at sample {fastest_sample} "
            f"({start + fastest_sample / rate:g} s), above {MAX_SPEED:g} rad/s: is the position in degrees? pass "
            "position_unit='deg', or convert it to rad; otherwise look for a spike there."
        )


class _Channel:
    """Statistics of a channel."""

    def __init__(self) -> None:
        self.samples, self.missing, self.sample = 0, 0, -1  # `sample` is the first one that is missing
        self.low, self.high = np.inf, -np.inf

    def add(self, values: np.ndarray) -> None:
        """Take in the next samples."""
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size and not self.missing:
            self.sample = self.samples + int(bad[0])
        self.missing += bad.size
        self.low, self.high = min(self.low, values.min()), max(self.high, values.max())
        self.samples += values.size


def _speed_margin(rate: float) -> int:
    """Samples on each side of one that its speed is computed of."""
    return max(1, round(0.003 * rate))


def peak_speed(position: np.ndarray, rate: float) -> tuple[int, float]:
    """Sample at which the position (N,) moves fastest, and its speed there.

    Speed is the change between the mean of the 3 ms before a sample and the mean of the 3 ms after it: a difference of
    neighbours at 1 kHz would turn a noise of 0.02 rad into 20 rad/s and more.
    """
    half = min(_speed_margin(rate), (position.size - 1) // 2)
    end = position.size - half
    with np.errstate(over="ignore", invalid="ignore"):  # of what is refused
        change = np.diff(position, prepend=position[:1])  # of two samples
        if half:
            change = sum(position[half + k : end + k] - position[half - k : end - k] for k in range(1, half + 1))
        sample = int(np.argmax(np.abs(change)))
        # The means lie half + 1 samples apart, and each is a sum over half samples.
        return half + sample, float(abs(change[sample])) * rate / max(half * (half + 1), 1)


def _check_spread(name: str, channel: _Channel, source: str) -> None:
    """Refuse a channel that is constant, or that computers cannot hold the squares of with all digits."""
    with np.errstate(over="ignore"):
        spread, largest = channel.high - channel.low, max(-channel.low, channel.high)
    # Rounding alone makes a filtered constant vary, far below the resolution of any converter.
    if spread <= 1e-12 * largest:
        count, remedy = format_samples(channel.samples), "leave it out, or " * (name == "reference")
        raise DataError(f"{source}: {name} is constant ({channel.low:g} at all {count}): {remedy}check the channel.")
    if spread < SMALLEST or largest > LARGEST:
        fault = f"varies by {spread:.3g}" if spread < SMALLEST else f"reaches {largest:.3g}"
        raise DataError(f"{source}: {name} {fault}, and no channel of a joint does: check its unit and its scale.")
