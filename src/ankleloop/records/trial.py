"""The trial: one recording of a joint, as an `xarray.Dataset` over time.

Every trial has `position` [rad] and `torque` [N·m], both float64 over a regular `time` [s], and the attribute
`sampling_rate` [Hz]. A closed-loop trial also has `reference` [rad], the command to the servo. A simulated trial
carries the true parts of its torque, named in `TRUTHS`.
"""

from pathlib import Path

import numpy as np
import xarray as xr
from numba import njit

from ankleloop.errors import DataError
from ankleloop.records.files import write_netcdf
from ankleloop.signals.sampling import as_rate, check_same_rate, in_samples, rate_from_time

__all__ = ["TRUTHS", "check_speed", "load_trial", "new_trial", "save_trial", "segment", "validate"]

TRUTHS = ("torque_intrinsic", "torque_reflex", "torque_voluntary", "torque_noise")

FASTEST = 20.0  # rad/s: no joint moves this fast, but one recorded in degrees seems to

_LONG_NAMES = {
    "time": "time from the first sample",
    "position": "joint position",
    "torque": "net torque, opposing stretch",
    "reference": "position command to the servo",
    "torque_intrinsic": "true intrinsic torque",
    "torque_reflex": "true reflex torque",
    "torque_voluntary": "true voluntary torque",
    "torque_noise": "true torque measurement noise",
}


def new_trial(position, torque, sampling_rate, reference=None, **more):
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
    **more : array_like, number or str
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
    source = more.get("source", "trial")
    rate = as_rate(sampling_rate, source=source)
    if "time" in more:
        raise DataError(f"{source}: time is made from sampling_rate: do not pass it, or give it another name.")
    given = {"position": position, "torque": torque, "reference": reference, **more}
    given = {name: value for name, value in given.items() if value is not None}
    arrays, attributes = {}, {"sampling_rate": rate}
    for name, value in given.items():
        if name in ("position", "torque", "reference") or np.ndim(_quiet_array(value)) > 0:
            arrays[name] = as_signal(value, name, source=source)
        else:
            attributes[name] = _as_attribute(value, name, source)
    for name in ("position", "torque"):
        if name not in arrays:
            raise DataError(f"{source}: there is no {name}: pass it as a 1-D array.")
    _check_lengths(arrays, source)
    time = np.arange(arrays["position"].size) / rate
    trial = xr.Dataset(
        {name: ("time", array, _describe(name)) for name, array in arrays.items()},
        coords={"time": ("time", time, _describe("time"))},
        attrs=attributes,
    )
    return validate(trial, source=source)


def validate(trial, *, source="trial"):
    """Check that a data set keeps the contract of a trial.

    Parameters
    ----------
    trial : xarray.Dataset
        The data set: `position`, `torque` and perhaps more, each of shape (N,) over `time` [s].
    source : str
        What to call the data in error messages, for instance the name of the file.

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
    >>> trial = new_trial([0.0, 0.01, 0.02], [0.0, 1.0, 2.0], 100.0)
    >>> validate(trial) is trial
    True
    >>> trial.position[1] = float("nan")
    >>> validate(trial)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: trial: position is not finite at sample 1 (0.01 s), 1 sample in all: cut the trial ...
    """
    _check_variables(trial, source)
    _check_time(trial, source)
    for name in trial.data_vars:
        _check_finite(trial, name, source)
    for name in ("position", "torque", "reference"):
        if name in trial:
            _check_varies(trial, name, source)
    check_speed(trial, source=source)
    return trial


def segment(trial, start, stop):
    """Part of a trial between two times.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    start, stop : float
        First time, and the time that ends it [s].

    Returns
    -------
    xarray.Dataset
        A valid trial that keeps the times of the whole.

    Raises
    ------
    DataError
        If the part has no samples, or is not a valid trial.

    Examples
    --------
    >>> trial = new_trial(np.sin(np.arange(100.0)) / 100, np.cos(np.arange(100.0)), 100.0)
    >>> segment(trial, 0.2, 0.5).sizes["time"]
    30
    """
    time = trial["time"].values
    inside = (time >= start - 1e-9) & (time < stop - 1e-9)
    if inside.sum() < 2:
        raise DataError(
            f"the segment from {start:g} to {stop:g} s has no samples: the trial covers {time[0]:g} to {time[-1]:g} s."
        )
    return validate(trial.isel(time=inside), source=f"segment {start:g} to {stop:g} s")


def save_trial(trial, path):
    """Save a trial as a NetCDF-4 file.

    The file appears under its name only when it is complete, so that a crash never leaves half a trial.

    Parameters
    ----------
    trial : xarray.Dataset
        A trial, shape (N,) per variable.
    path : str or pathlib.Path
        The file to write, in a folder that exists; a file of this name is replaced.

    Raises
    ------
    DataError
        If the trial is not valid, or the folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> trial = new_trial([0.0, 0.01, 0.02], [0.0, 1.0, 2.0], 100.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_trial(trial, f"{folder}/trial.nc")
    ...     load_trial(f"{folder}/trial.nc").identical(trial)
    True
    """
    validate(trial, source=Path(path).name)
    # Encodings left from another file (packing, fill values) would change the samples.
    write_netcdf(trial.drop_encoding(), path, {name: {"_FillValue": None} for name in trial.variables})


def load_trial(path):
    """Load a trial that `save_trial` wrote: same bits, same attributes.

    Parameters
    ----------
    path : str or pathlib.Path
        The NetCDF file. For files of other origin there is `ankleloop.records.readers.read_trial`.

    Returns
    -------
    xarray.Dataset
        The trial, shape (N,) per variable [rad, N·m] over `time` [s].

    Raises
    ------
    DataError
        If the file does not exist, is not NetCDF-4, or does not hold a valid trial.

    Examples
    --------
    >>> load_trial("nowhere.nc")
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: nowhere.nc: there is no such file: check the path.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path}: there is no such file: check the path.")
    try:
        # Samples and attributes are taken as they stand: decoding could only change them.
        trial = xr.load_dataset(path, engine="h5netcdf", decode_cf=False).drop_encoding()
    except Exception as cause:  # the HDF5 libraries raise almost anything on a damaged file
        reason = str(cause).partition("\n")[0]
        raise DataError(f"{path.name}: not a readable NetCDF-4 file ({reason}): write it with save_trial.") from cause
    trial.attrs.update({name: value.item() for name, value in trial.attrs.items() if isinstance(value, np.generic)})
    return validate(trial, source=path.name)


def as_signal(values, name, *, source):
    """Copy real numbers of shape (N,), (N, 1) or (1, N) into a float64 array of shape (N,); masked samples are nan."""
    array = _quiet_array(values)
    if array.size == 0:
        raise DataError(f"{source}: {name} is empty: record it, or choose another variable.")
    if array.dtype.kind not in "iuf":
        raise DataError(f"{source}: {name} is of type {array.dtype}, not real numbers: convert it, or choose another.")
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.ndim != 1:
        raise DataError(f"{source}: {name} has shape {array.shape}, not one sample per time: pass a single channel.")
    return array.astype(float).filled(np.nan)


def _quiet_array(values):
    """Masked array of the values; a ragged list becomes an object array, refused later with its name."""
    try:
        return values if isinstance(values, np.ma.MaskedArray) else np.ma.asarray(np.asarray(values))
    except (TypeError, ValueError):
        return np.ma.asarray(np.array([values, None], dtype=object))


def _as_attribute(value, name, source):
    """Plain int, float or str, the types that every NetCDF library writes."""
    value = np.asarray(value).item()
    if isinstance(value, bool):
        return int(value)
    if isinstance(value, float | str) or (isinstance(value, int) and -(2**63) <= value < 2**63):
        return value
    raise DataError(
        f"{source}: the attribute {name} is {value!r}, which NetCDF cannot keep: pass a string, a float or a 64-bit "
        "integer."
    )


def _describe(name):
    unit = {"time": "s", "position": "rad", "reference": "rad"}.get(name, "N·m" if name.startswith("torque") else "")
    return {"units": unit, "long_name": _LONG_NAMES.get(name, name.replace("_", " "))}


def _check_lengths(arrays, source):
    size = arrays["position"].size
    for name, array in arrays.items():
        if array.size != size:
            raise DataError(
                f"{source}: {name} has {in_samples(array.size)} but position has {size}: cut all variables to the same "
                "samples."
            )


def _check_variables(trial, source):
    if not isinstance(trial, xr.Dataset):
        raise DataError(f"{source}: a trial is an xarray.Dataset, not {type(trial).__name__}: make it with new_trial.")
    for name in ("position", "torque"):
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


def _check_time(trial, source):
    stated = as_rate(trial.attrs["sampling_rate"], source=source)
    check_same_rate(stated, rate_from_time(trial.variables["time"].values, source=source), source=source)


def _check_finite(trial, name, source):
    values = trial.variables[name].values
    if not np.isfinite(values).all():
        bad = np.flatnonzero(~np.isfinite(values))
        raise DataError(
            f"{source}: {name} is not finite at sample {bad[0]} ({trial['time'].to_numpy()[bad[0]]:g} s), "
            f"{in_samples(bad.size)} in all: cut the trial there or repair the channel."
        )


def _check_varies(trial, name, source):
    values = trial.variables[name].values
    low, high = values.min(), values.max()
    with np.errstate(over="ignore"):
        spread = high - low
    # A filtered constant differs from itself by rounding, far below the resolution of any converter.
    if spread > 1e-12 * max(-low, high):
        return
    remedy = "check the channel"
    if name == "reference":
        remedy = "it carries no information: leave it out, or check the channel"
    raise DataError(f"{source}: {name} is constant ({values[0]:g} at all {in_samples(values.size)}): {remedy}.")


def check_speed(trial, *, source, first=0):
    """Refuse a position that moves faster than a joint can, as one in degrees seems to.

    Parameters
    ----------
    trial : xarray.Dataset
        The position [rad] over time [s], of a trial or of a piece of one, and the sampling rate [Hz].
    source : str
        What to call the data in the error.
    first : int
        Number of the first sample of the piece.

    Raises
    ------
    DataError
        Naming the sample.
    """
    at, speed = _fastest(trial.variables["position"].values, float(trial.attrs["sampling_rate"]))
    if not speed <= FASTEST:
        moment = trial.variables["time"].values[at]
        raise DataError(
            f"{source}: position moves at {speed:.4g} rad/s at sample {first + at} ({moment:g} s), above "
            f"{FASTEST:g} rad/s: is the position in degrees? pass position_unit='deg', or convert it to rad; otherwise "
            "look for a spike there."
        )


def _fastest(position, rate):
    """Sample at which the position moves fastest, and how fast [rad/s].

    Speed is the mean of the 3 ms after a sample less the mean of the 3 ms before it: a plain difference at 1 kHz would
    turn a noise of 0.02 rad into 20 rad/s and more.
    """
    half = min(max(1, round(0.003 * rate)), (position.size - 1) // 2)
    at, change = _largest_change(np.ascontiguousarray(position), half)
    return at, change * rate


@njit(cache=True)
def _largest_change(position, half):
    """Sample with the largest change for one sample, from means over `half` samples at either side, and that change."""
    at, largest = 0, 0.0
    span = half * (half + 1)  # of sums over the samples at either side; of neighbours, if there are but those
    for k in range(max(half, 1), position.size - half):
        change = 0.0 if half else position[k] - position[k - 1]
        for lag in range(1, half + 1):
            change += position[k + lag] - position[k - lag]
        if not abs(change) <= largest:
            at, largest = k, abs(change)
            if not largest < np.inf:  # an overflow
                break
    return at, largest / max(span, 1)
