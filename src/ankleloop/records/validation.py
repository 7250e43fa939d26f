"""The contract of a trial: which variables it has, and which faults make its samples unusable."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numba import njit

from ankleloop.errors import DataError
from ankleloop.signals.sampling import check_same_rate, compute_rate, format_samples, parse_rate

__all__ = ["CHANNELS", "REQUIRED", "check_speed", "validate"]

CHANNELS = ("position", "torque", "reference")
REQUIRED = ("position", "torque")

MAX_SPEED = 20.0  # rad/s: no joint moves faster; a position that does is usually in degrees


def validate(trial: xr.Dataset, *, source: str = "trial") -> xr.Dataset:
    """Check that a data set keeps the contract of a trial.

    Parameters
    ----------
    trial : xarray.Dataset
        The data set: `position` [rad], `torque` [N·m] and perhaps more, each of shape (N,) over `time` [s].
    source : str
        Name of the data in error messages, for instance the name of the file.

    Returns
    -------
    xarray.Dataset
        The trial, unchanged.

    Raises
    ------
    DataError
        If a variable is missing, not float64, not over time, or not finite; if the position, torque or reference is
        constant; if the time has gaps or contradicts the sampling rate; if the position moves faster than 20 rad/s,
        as positions in degrees do. The message names the variable, the sample and its time, and what to do.

    Examples
    --------
    >>> from ankleloop.records.trial import new_trial
    >>> trial = new_trial([0.0, 0.01, 0.02], [0.0, 1.0, 2.0], 100.0)
    >>> validate(trial) is trial
    True
    >>> trial.position[1] = float("nan")
    >>> validate(trial)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: trial: position is not finite at sample 1 (0.01 s), 1 sample in all: cut the trial ...
    """
    _check_presence(trial, source)
    _check_types(trial, source)
    _check_time(trial, source)
    for name in trial.data_vars:
        _check_finite(trial, str(name), source)
    for name in CHANNELS:
        if name in trial:
            _check_variation(trial, name, source)
    check_speed(trial, source=source)
    return trial


def check_speed(trial: xr.Dataset, *, source: str, first: int = 0) -> None:
    """Refuse a position that moves faster than a joint can, as a position in degrees does.

    Parameters
    ----------
    trial : xarray.Dataset
        Position [rad] over time [s], of a trial or of a chunk of one, and the sampling rate [Hz].
    source : str
        Name of the data in error messages.
    first : int
        Number of the first sample of the chunk.

    Raises
    ------
    DataError
        If the speed exceeds 20 rad/s; the message names the sample.

    Examples
    --------
    >>> from ankleloop.records.trial import new_trial
    >>> check_speed(new_trial([0.0, 0.01, 0.02], [0.0, 1.0, 2.0], 100.0), source="trial")
    """
    sample, speed = _peak_speed(trial.variables["position"].values, float(trial.attrs["sampling_rate"]))
    if not speed <= MAX_SPEED:
        time = trial.variables["time"].values[sample]
        raise DataError(
            f"{source}: position moves at {speed:.4g} rad/s at sample {first + sample} ({time:g} s), above "
            f"{MAX_SPEED:g} rad/s: is the position in degrees? pass position_unit='deg', or convert it to rad; "
            "otherwise look for a spike there."
        )


def _check_presence(trial: xr.Dataset, source: str) -> None:
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


def _check_types(trial: xr.Dataset, source: str) -> None:
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


def _check_time(trial: xr.Dataset, source: str) -> None:
    stated = parse_rate(trial.attrs["sampling_rate"], source=source)
    check_same_rate(stated, compute_rate(trial.variables["time"].values, source=source), source=source)


def _check_finite(trial: xr.Dataset, name: str, source: str) -> None:
    values = trial.variables[name].values
    if not np.isfinite(values).all():
        bad = np.flatnonzero(~np.isfinite(values))
        raise DataError(
            f"{source}: {name} is not finite at sample {bad[0]} ({trial['time'].to_numpy()[bad[0]]:g} s), "
            f"{format_samples(bad.size)} in all: cut the trial there or repair the channel."
        )


def _check_variation(trial: xr.Dataset, name: str, source: str) -> None:
    values = trial.variables[name].values
    low, high = values.min(), values.max()
    with np.errstate(over="ignore"):
        spread = high - low
    # Rounding alone makes a filtered constant vary, far below the resolution of any converter.
    if spread > 1e-12 * max(-low, high):
        return
    remedy = "check the channel"
    if name == "reference":
        remedy = "it carries no information: leave it out, or check the channel"
    raise DataError(f"{source}: {name} is constant ({values[0]:g} at all {format_samples(values.size)}): {remedy}.")


def _peak_speed(position: np.ndarray, rate: float) -> tuple[int, float]:
    """Sample at which the position moves fastest, and its speed there [rad/s].

    Speed is the change between the mean of the 3 ms before a sample and the mean of the 3 ms after it: a difference of
    neighbours at 1 kHz would turn a noise of 0.02 rad into 20 rad/s and more.
    """
    half = min(max(1, round(0.003 * rate)), (position.size - 1) // 2)
    sample, change = _largest_change(np.ascontiguousarray(position), half)
    return sample, change * rate


@njit(cache=True)
def _largest_change(position, half):
    """Sample with the largest change per sample, between the means of `half` samples on each side, and that change.

    With `half` 0, in a record of two samples, it is the difference of the neighbours.
    """
    sample, largest = 0, 0.0
    span = half * (half + 1)  # the means lie half + 1 samples apart, and each is a sum over half samples
    for k in range(max(half, 1), position.size - half):
        change = 0.0 if half else position[k] - position[k - 1]
        for lag in range(1, half + 1):
            change += position[k + lag] - position[k - lag]
        if not abs(change) <= largest:
            sample, largest = k, abs(change)
            if not largest < np.inf:  # the sum overflows
                break
    return sample, largest / max(span, 1)
