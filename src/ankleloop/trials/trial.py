"""The trial: one record of a joint, as an `xarray.Dataset` over time.

Every trial has `position` [rad] and `torque` [N·m], both float64 over a regular `time` [s], and the attribute
`sampling_rate` [Hz]. A closed-loop trial also has `reference` [rad], the command to the servo. A simulated trial
carries the true parts of its torque, named in `TRUE_TORQUES`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.options import check_integer, check_number
from ankleloop.signals.sampling import (
    check_same_rate,
    compute_rate_of_parts,
    format_samples,
    parse_rate,
)
from ankleloop.trials.channels import VARIABLES, check_unit

CHANNELS = ("position", "torque", "reference")
REQUIRED = ("position", "torque")

SMALLEST, LARGEST = 1e-15, 1e15  # of a channel, rad or N·m
MAX_SPEED = 20.0  # rad/s: no joint moves faster; a position that does is usually in degrees
MAX_DEGREE = 10  # of a drift


def new_trial(
    position: ArrayLike,
    torque: ArrayLike,
    sampling_rate: float,
    reference: ArrayLike | None = None,
    **extras: Any,
) -> xr.Dataset:
    """Make a trial from arrays, and check it.

    Parameters
    ----------
    position : array_like, shape (N,), (N, 1) or (1, N)
        Joint position [rad].
    torque : array_like, shape as `position`
        Net torque [N·m]; it opposes stretch, so stiffness comes out positive.
    sampling_rate : float
        Sampling rate [Hz].
    reference : array_like, shape as `position`, optional
        Position command to the servo [rad].
    **extras : array_like, number or str
        Arrays of the same length become variables (those named `torque…` in N·m, others without unit); numbers and
        strings become attributes; None is left out. The attribute `source` names the data in error messages.

    Returns
    -------
    xarray.Dataset
        Float64 variables over `time` [s], which starts at 0.

    Raises
    ------
    DataError
        If an array is empty, not 1-D, not real numbers, or of another length; or if `validate` finds a fault.

    Examples
    --------
    >>> import numpy as np
    >>> phase = 2 * np.pi * np.arange(100) / 100
    >>> trial = new_trial(0.02 * np.sin(phase), 3 * np.sin(phase), 1000, subject="S1")
    >>> trial.position.attrs["units"], trial.attrs["sampling_rate"], trial.attrs["subject"]
    ('rad', 1000.0, 'S1')
    """
    source = extras.get("source", "trial")
    rate = parse_rate(sampling_rate, source=source)
    if "time" in extras:
        raise DataError(
            f"{source}: time is made from sampling_rate: do not pass it, or give it another name."
        )
    arrays: dict[str, np.ndarray] = {}
    attributes: dict[str, Any] = {"sampling_rate": rate}
    for name, value in {
        "position": position,
        "torque": torque,
        "reference": reference,
        **extras,
    }.items():
        if value is None and name not in REQUIRED:
            continue
        if name in CHANNELS or isinstance(value, list | tuple) or np.ndim(value) > 0:
            arrays[name] = as_signal(value, name, source=source)
        else:
            attributes[name] = _as_attribute(np.asarray(value).item(), name, source)
    check_sizes({name: array.size for name, array in arrays.items()}, source=source)
    time = np.arange(arrays["position"].size) / rate
    trial = xr.Dataset(
        {name: ("time", array) for name, array in arrays.items()}, {"time": time}, attributes
    )
    for name in ("time", *arrays):
        unit, long_name = VARIABLES.get(
            name, ("N·m" if name.startswith("torque") else "", name.replace("_", " "))
        )
        trial[name].attrs = {"units": unit, "long_name": long_name}
    return validate(trial, source=source)


def segment(trial: xr.Dataset, start: float, stop: float) -> xr.Dataset:
    """Cut a trial to the samples between two times.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    start, stop : float
        First time of the segment, and the time before which it ends [s].

    Returns
    -------
    xarray.Dataset
        A valid trial with the times of the whole trial.

    Raises
    ------
    DataError
        If the segment has no samples, or is not a valid trial.

    Examples
    --------
    >>> trial = new_trial(np.sin(np.arange(100.0)) / 100, np.cos(np.arange(100.0)), 100.0)
    >>> segment(trial, 0.2, 0.5).sizes["time"]
    30
    """
    start, stop = (
        check_number("segment", *edge, "s") for edge in (("start", start), ("stop", stop))
    )
    time = trial["time"].values
    inside = (time >= start - 1e-9) & (time < stop - 1e-9)
    source = f"{trial.attrs['source']}: " if "source" in trial.attrs else ""
    if inside.sum() < 2:
        raise DataError(
            f"{source}the segment from {start:g} to {stop:g} s has no samples: the trial covers {time[0]:g} to "
            f"{time[-1]:g} s."
        )
    return validate(trial.isel(time=inside), source=f"{source}segment {start:g} to {stop:g} s")


def remove_drift(trial: xr.Dataset, degree: int) -> xr.Dataset:
    """Subtract a polynomial, fitted by least squares, from the torque.

    The torque drifts more slowly than any perturbation, because the muscle tires or the sensor warms up. The position
    stays as it is, because the nonlinearity depends on it.
    """
    degree = check_integer("remove_drift", "degree", degree, ge=0, le=MAX_DEGREE)
    torque = trial["torque"].values
    grid = np.linspace(-1.0, 1.0, torque.size)
    detrended = torque - np.polynomial.Legendre.fit(grid, torque, degree)(grid)
    if np.ptp(detrended) <= 1e-9 * np.ptp(torque):
        raise DataError(
            f"a polynomial of degree {degree} takes all of the torque: there is nothing but drift in it."
        )
    return validate(trial.assign(torque=trial["torque"].copy(data=detrended)))


def as_signal(values: ArrayLike, name: str, *, source: str) -> np.ndarray:
    """Copy real numbers into a 1-D array of float64.

    Shapes: values (N,); returns (N,).
    """
    try:
        array = (
            values if isinstance(values, np.ma.MaskedArray) else np.ma.asarray(np.asarray(values))
        )
    except (TypeError, ValueError):  # lists of different lengths
        array = np.ma.asarray(np.array(None))
    if array.dtype.kind not in "iuf":
        raise DataError(
            f"{source}: {name} is of type {array.dtype}, not real numbers: convert it, or choose another."
        )
    check_shape(array.shape, name, source=source)
    return np.ma.filled(array.ravel().astype(float), np.nan)


def check_shape(shape: tuple[int, ...], name: str, *, source: str) -> int:
    """Check that an array holds a single channel, and count its samples."""
    size = int(np.prod(shape))
    if size == 0:
        raise DataError(f"{source}: {name} is empty: record it, or choose another variable.")
    if len(shape) not in (1, 2) or size != max(shape):
        raise DataError(
            f"{source}: {name} has shape {shape}, not one sample per time: pass a single channel."
        )
    return size


def _as_attribute(value: Any, name: str, source: str) -> int | float | str:
    """An int, a float or a str, the types that every NetCDF library writes."""
    if isinstance(value, bool):
        return int(value)
    if isinstance(value, float | str) or (isinstance(value, int) and -(2**63) <= value < 2**63):
        return value
    raise DataError(
        f"{source}: the attribute {name} is {value!r}, which NetCDF cannot keep: pass a string, a float or a 64-bit "
        "integer."
    )


def check_sizes(sizes: Mapping[str, int], *, source: str) -> None:
    """Check that all channels have as many samples as the position."""
    for name, size in sizes.items():
        if size != sizes["position"]:
            raise DataError(
                f"{source}: {name} has {format_samples(size)} but position has {sizes['position']}: cut all variables "
                "to the same samples."
            )


# --- What a trial must keep, and which faults make its samples unusable


def validate(trial: xr.Dataset, *, source: str = "trial") -> xr.Dataset:
    """Check that a data set keeps the contract of a trial; it gets the sampling rate of its times if it has none."""
    if not isinstance(trial, xr.Dataset):
        raise DataError(
            f"{source}: a trial is an xarray.Dataset, not {type(trial).__name__}: make it with new_trial."
        )
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
    rate = parse_rate(trial.attrs.get("sampling_rate", measured), source=source)
    check_same_rate(rate, measured, source=source)
    check_samples(
        [{str(name): trial.variables[name].values for name in trial.data_vars}],
        rate,
        time[0],
        source=source,
    )
    return trial if "sampling_rate" in trial.attrs else trial.assign_attrs(sampling_rate=rate)


def check_samples(
    blocks: Iterable[Mapping[str, np.ndarray]], rate: float, start: float = 0.0, *, source: str
) -> None:
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
                fastest, fastest_sample = (
                    speed,
                    channels["position"].samples - position.size + sample,
                )
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
        self.samples, self.missing, self.sample = (
            0,
            0,
            -1,
        )  # `sample` is the first one that is missing
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
            change = sum(
                position[half + k : end + k] - position[half - k : end - k]
                for k in range(1, half + 1)
            )
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
        raise DataError(
            f"{source}: {name} is constant ({channel.low:g} at all {count}): {remedy}check the channel."
        )
    if spread < SMALLEST or largest > LARGEST:
        fault = f"varies by {spread:.3g}" if spread < SMALLEST else f"reaches {largest:.3g}"
        raise DataError(
            f"{source}: {name} {fault}, and no channel of a joint does: check its unit and its scale."
        )
