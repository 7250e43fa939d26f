"""The contract of a trial: which variables it has, and which faults make its samples unusable."""

from __future__ import annotations

from typing import NoReturn

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.signals.sampling import check_same_rate, compute_rate, format_samples, parse_rate
from ankleloop.trials.channel_units import check_unit

CHANNELS = ("position", "torque", "reference")
REQUIRED = ("position", "torque")

SMALLEST, LARGEST = 1e-15, 1e15  # of a channel, rad or N·m
MAX_SPEED = 20.0  # rad/s: no joint moves faster; a position that does is usually in degrees


def validate(trial: xr.Dataset, *, source: str = "trial") -> xr.Dataset:
    """Check that a data set keeps the contract of a trial."""
    _check_form(trial, source)
    _check_units(trial, source)
    time, rate = trial.variables["time"].values, parse_rate(trial.attrs["sampling_rate"], source=source)
    check_same_rate(rate, compute_rate(time, source=source), source=source)
    for name in map(str, trial.data_vars):
        values = trial.variables[name].values
        if not np.isfinite(values).all():
            bad = np.flatnonzero(~np.isfinite(values))
            refuse_missing(name, int(bad[0]), time[bad[0]], bad.size, source=source)
    for name in CHANNELS:
        if name in trial:
            values = trial.variables[name].values
            check_spread(name, values.min(), values.max(), values[0], values.size, source=source)
    sample, speed = peak_speed(trial.variables["position"].values, rate)
    refuse_speed(speed, sample, time[sample], source=source)
    return trial


def refuse_speed(speed: float, sample: int, time: float, *, source: str) -> None:
    """Refuse a largest speed of the position that no joint reaches."""
    if not speed <= MAX_SPEED:
        raise DataError(
            f"{source}: position moves at {speed:.4g} rad/s at sample {sample} ({time:g} s), above "
            f"{MAX_SPEED:g} rad/s: is the position in degrees? pass position_unit='deg', or convert it to rad; "
            "otherwise look for a spike there."
        )


def _check_form(trial: xr.Dataset, source: str) -> None:
    """Refuse what lacks a variable or an attribute, and variables of another shape or type."""
    if not isinstance(trial, xr.Dataset):
        raise DataError(f"{source}: a trial is an xarray.Dataset, not {type(trial).__name__}: make it with new_trial.")
    for name in REQUIRED:
        if name not in trial.data_vars:
            raise DataError(
                f"{source}: there is no variable {name} among {sorted(map(str, trial.data_vars))}: make the trial with "
                "new_trial, or name the variable in read_trial."
            )
    if "sampling_rate" not in trial.attrs:
        raise DataError(f"{source}: the attribute sampling_rate is missing: set trial.attrs['sampling_rate'] in Hz.")
    if "time" not in trial.coords:
        raise DataError(f"{source}: there is no coordinate time: make the trial with new_trial.")
    for name in (*trial.data_vars, "time"):
        variable = trial.variables[name]
        if variable.dims != ("time",):
            raise DataError(
                f"{source}: {name} has shape {variable.shape} over {variable.dims}, not one sample per time: cut all "
                "variables to the same samples over time; put numbers into attrs."
            )
        if variable.dtype != np.float64:
            raise DataError(
                f"{source}: {name} is of type {variable.dtype}, not float64: make the trial with new_trial."
            )


def _check_units(trial: xr.Dataset, source: str) -> None:
    """Refuse a channel whose attribute says that it is in another unit than that of the contract."""
    for name in map(str, trial.data_vars):
        stated = trial.variables[name].attrs.get("units", "")
        if stated and (name in CHANNELS or name.startswith("torque")):
            try:
                check_unit(name, name, str(stated), "rad", source=source)
            except DataError:
                unit = "N·m" if name.startswith("torque") else "rad"
                raise DataError(
                    f"{source}: {name} is in {stated!r} by its attribute units, and a trial has {unit}: convert the "
                    "samples, or correct the attribute."
                ) from None


def refuse_missing(name: str, sample: int, time: float, count: int, *, source: str) -> NoReturn:
    """Refuse a channel of which samples are not finite."""
    raise DataError(
        f"{source}: {name} is not finite at sample {sample} ({time:g} s), {format_samples(count)} in all: cut the "
        "trial there or repair the channel."
    )


def check_spread(name: str, low: float, high: float, first: float, count: int, *, source: str) -> None:
    """Refuse a channel that is constant."""
    with np.errstate(over="ignore"):
        spread = high - low
    # Rounding alone makes a filtered constant vary, far below the resolution of any converter.
    if spread > 1e-12 * max(-low, high):
        if spread < SMALLEST or max(-low, high) > LARGEST:  # computers cannot hold squares of these with all digits
            fault = f"varies by {spread:.3g}" if spread < SMALLEST else f"reaches {max(-low, high):.3g}"
            raise DataError(
                f"{source}: {name} {fault}, and no channel of a joint does: check its unit and its scale; if the file "
                "is damaged, copy it again."
            )
        return
    remedy = "check the channel"
    if name == "reference":
        remedy = "it carries no information: leave it out, or check the channel"
    raise DataError(f"{source}: {name} is constant ({first:g} at all {format_samples(count)}): {remedy}.")


def speed_margin(rate: float) -> int:
    """Samples on each side of one that its speed is computed of."""
    return max(1, round(0.003 * rate))


def peak_speed(position: np.ndarray, rate: float) -> tuple[int, float]:
    """Sample at which the position moves fastest, and its speed there.

    Speed is the change between the mean of the 3 ms before a sample and the mean of the 3 ms after it: a difference of
    neighbours at 1 kHz would turn a noise of 0.02 rad into 20 rad/s and more.

    Shapes: position (N,).
    """
    if position.size < 2:
        return 0, 0.0
    half = min(speed_margin(rate), (position.size - 1) // 2)
    middle = np.arange(half, position.size - half)
    with np.errstate(over="ignore", invalid="ignore"):  # of what is refused
        if half:
            change = sum(position[middle + lag] - position[middle - lag] for lag in range(1, half + 1))
        else:
            change = np.diff(position, prepend=position[:1])  # of two samples
        sample = int(np.argmax(np.abs(change)))
        # The means lie half + 1 samples apart, and each is a sum over half samples.
        return int(middle[sample]), float(abs(change[sample])) * rate / max(half * (half + 1), 1)
