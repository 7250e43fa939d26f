"""The trial: one record of a joint, as an `xarray.Dataset` over time.

Every trial has `position` [rad] and `torque` [N·m], both float64 over a regular `time` [s], and the attribute
`sampling_rate` [Hz]. A closed-loop trial also has `reference` [rad], the command to the servo. A simulated trial
carries the true parts of its torque, named in `TRUE_TORQUES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.options import check_integer, check_number
from ankleloop.signals.sampling import (
    check_same_rate,
    compute_rate,
    format_samples,
    parse_rate,
)
from ankleloop.trials.channels import CHANNELS, VARIABLES
from ankleloop.trials.units import (
    POSITION_UNITS,
    TORQUE_UNIT,
    check_unit,
    find_stated_unit,
    normalise_unit,
)

REQUIRED = ("position", "torque")
SMALLEST_SPREAD, LARGEST_SPREAD = 1e-15, 1e15  # of a channel, rad or N·m
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
        Position command to the servo [rad]. An array with an attribute `units`, as a DataArray has, is read as a
        variable of a file: a position in deg is converted, with its reference, and another unit is refused.
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

    See Also
    --------
    ankleloop.read_trial : A trial from a file.
    ankleloop.segment : A part of a trial.

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
    values = {"position": position, "torque": torque, "reference": reference, **extras}
    position_unit = "deg" if normalise_unit(_unit_of(position)) == "deg" else "rad"
    for name, value in values.items():
        if value is None and name not in REQUIRED:
            continue
        if name in CHANNELS or isinstance(value, list | tuple) or np.ndim(value) > 0:
            arrays[name] = as_samples(value, name, source=source)
            if name.startswith("torque"):
                check_unit(name, _unit_of(value), TORQUE_UNIT, source=source)
            elif name in CHANNELS:
                check_unit(name, _unit_of(value), position_unit, source=source)
                arrays[name] *= POSITION_UNITS[position_unit]
        else:
            attributes[name] = _as_attribute(value, name, source)
    check_sizes({name: array.size for name, array in arrays.items()}, source=source)
    time = np.arange(arrays["position"].size) / rate
    variables = {name: ("time", array, _describe(name)) for name, array in arrays.items()}
    trial = xr.Dataset(variables, {"time": ("time", time, _describe("time"))}, attributes)
    return validate(trial, source=source)


def _unit_of(values: ArrayLike) -> str:
    """Unit that an array states by its attribute `units`, as a variable of a file does."""
    return find_stated_unit(getattr(values, "attrs", {}))


def _describe(name: str) -> dict[str, str]:
    """Unit and long name of a variable, as its attributes."""
    if name in VARIABLES:
        unit, long_name = VARIABLES[name]
    else:
        unit = "N·m" if name.startswith("torque") else ""
        long_name = name.replace("_", " ")
    return {"units": unit, "long_name": long_name}


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

    See Also
    --------
    ankleloop.new_trial : A trial from arrays.

    Examples
    --------
    >>> trial = new_trial(np.sin(np.arange(100.0)) / 100, np.cos(np.arange(100.0)), 100.0)
    >>> segment(trial, 0.2, 0.5).sizes["time"]
    30
    """
    start = check_number("segment", "start", start, "s")
    stop = check_number("segment", "stop", stop, "s")
    time = trial["time"].values
    inside = (time >= start - 1e-9) & (time < stop - 1e-9)
    source = trial.attrs.get("source", "trial")
    if inside.sum() < 2:
        raise DataError(
            f"{source}: the segment from {start:g} to {stop:g} s has no samples: the trial covers {time[0]:g} to "
            f"{time[-1]:g} s."
        )
    return validate(trial.isel(time=inside), source=f"{source}: segment {start:g} to {stop:g} s")


def remove_drift(trial: xr.Dataset, degree: int) -> xr.Dataset:
    """Subtract a polynomial, fitted by least squares, from the torque.

    The torque drifts more slowly than any perturbation, because the muscle tires or the sensor warms up. The position
    stays as it is, because the nonlinearity depends on it.
    """
    degree = check_integer("remove_drift", "degree", degree, ge=0, le=MAX_DEGREE)
    torque = trial["torque"].values
    grid = np.linspace(-1.0, 1.0, torque.size)
    drift = np.polynomial.Legendre.fit(grid, torque, degree)
    detrended = torque - drift(grid)
    if np.ptp(detrended) <= 1e-9 * np.ptp(torque):
        raise DataError(
            f"a polynomial of degree {degree} takes all of the torque: there is nothing but drift in it."
        )
    return validate(trial.assign(torque=trial["torque"].copy(data=detrended)))


def as_samples(values: ArrayLike, name: str, *, source: str) -> np.ndarray:
    """Copy real numbers into a 1-D array of float64.

    Shapes: values (N,); returns (N,).
    """
    try:
        array: np.ndarray = np.ma.asarray(values)
    except (TypeError, ValueError):  # lists of different lengths
        array = np.ma.array(None)
    if array.dtype.kind not in "iuf":
        raise DataError(
            f"{source}: {name} is of type {array.dtype}, not real numbers: convert it, or choose another."
        )
    if array.size == 0:
        raise DataError(f"{source}: {name} is empty: record it, or choose another variable.")
    if array.ndim not in (1, 2) or array.size != max(array.shape):
        raise DataError(
            f"{source}: {name} has shape {array.shape}, not one sample per time: pass a single channel."
        )
    return np.ma.filled(array.ravel().astype(float), np.nan)


def _as_attribute(value: Any, name: str, source: str) -> int | float | str:
    """An int, a float or a str, the types that every NetCDF library writes."""
    plain = np.asarray(value).item()
    if isinstance(plain, bool):
        return int(plain)
    if isinstance(plain, float | str) or (isinstance(plain, int) and abs(plain) < 2**63):
        return plain
    raise DataError(
        f"{source}: the attribute {name} is {plain!r}, which NetCDF cannot keep: pass a string, a float or a 64-bit "
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
    for key, variable in trial.variables.items():
        name = str(key)
        if variable.dims != ("time",) or variable.dtype != np.float64:
            raise DataError(
                f"{source}: {name} is of type {variable.dtype} and of shape {variable.shape} over {variable.dims}, not "
                "one float64 for each time: make the trial with new_trial; put numbers into attrs."
            )
        if name in CHANNELS or name.startswith("torque"):
            unit = TORQUE_UNIT if name.startswith("torque") else "rad"
            check_unit(name, str(variable.attrs.get("units", "")), unit, source=source)
    time = trial.variables["time"].values
    measured = compute_rate(time, source=source)
    rate = parse_rate(trial.attrs.get("sampling_rate", measured), source=source)
    check_same_rate(rate, measured, source=source)
    samples = {str(name): trial.variables[name].values for name in trial.data_vars}
    _check_samples(samples, rate, time[0], source)
    return trial.assign_attrs(sampling_rate=rate)


def _check_samples(
    samples: Mapping[str, np.ndarray], rate: float, start: float, source: str
) -> None:
    """Refuse samples that are not finite, channels that are constant, and speeds that no joint reaches."""
    for name, values in samples.items():
        missing = np.flatnonzero(~np.isfinite(values))
        if missing.size:
            raise DataError(
                f"{source}: {name} is not finite at sample {missing[0]} ({start + missing[0] / rate:g} s), "
                f"{format_samples(missing.size)} in all: cut the trial there or repair the channel."
            )
        if name in CHANNELS:
            _check_spread(name, values, source)
    sample, speed = peak_speed(samples["position"], rate)
    if not speed <= MAX_SPEED:
        raise DataError(
            f"{source}: position moves at {speed:.4g} rad/s at sample {sample} ({start + sample / rate:g} s), above "
            f"{MAX_SPEED:g} rad/s: is the position in degrees? pass position_unit='deg', or convert it to rad; "
            "otherwise look for a spike there.",
            remedy={"position_unit": "deg"},
        )


def peak_speed(position: np.ndarray, rate: float) -> tuple[int, float]:
    """Sample at which the position (N,) moves fastest, and its speed there.

    Speed is the change between the mean of the 3 ms before a sample and the mean of the 3 ms after it: a difference of
    neighbours at 1 kHz would turn a noise of 0.02 rad into 20 rad/s and more.
    """
    half = min(max(1, round(0.003 * rate)), (position.size - 1) // 2)
    with np.errstate(over="ignore", invalid="ignore"):  # of what is refused
        if half == 0:  # two samples
            return 1, abs(position[1] - position[0]) * rate
        change = np.correlate(position, np.sign(np.arange(-half, half + 1.0)))
        sample = int(np.argmax(np.abs(change)))
        # The means lie half + 1 samples apart, and each is a sum over half samples.
        speed = abs(change[sample]) * rate / (half * (half + 1))
    return half + sample, speed


def _check_spread(name: str, values: np.ndarray, source: str) -> None:
    """Refuse a channel that is constant, or has numbers of which no computer holds the squares."""
    with np.errstate(over="ignore"):
        spread = np.ptp(values)
    # Rounding alone makes a filtered constant vary, far below the resolution of any converter.
    if spread <= 1e-12 * np.max(np.abs(values)):
        advice = "leave it out, or check" if name == "reference" else "check"
        raise DataError(
            f"{source}: {name} is constant ({values[0]:g} at all {format_samples(values.size)}): {advice} the channel."
        )
    if not SMALLEST_SPREAD < spread < LARGEST_SPREAD:
        raise DataError(
            f"{source}: {name} varies by {spread:.3g}, and no channel of a joint does: check its unit and its scale."
        )
