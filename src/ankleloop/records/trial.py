"""The trial: one record of a joint, as an `xarray.Dataset` over time.

Every trial has `position` [rad] and `torque` [N·m], both float64 over a regular `time` [s], and the attribute
`sampling_rate` [Hz]. A closed-loop trial also has `reference` [rad], the command to the servo. A simulated trial
carries the true parts of its torque, named in `TRUE_TORQUES`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.records.files import write_netcdf
from ankleloop.records.validation import CHANNELS, REQUIRED, validate
from ankleloop.signals.sampling import format_samples, parse_rate

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike

__all__ = ["TRUE_TORQUES", "as_signal", "load_trial", "new_trial", "save_trial", "segment"]

# Unit and long name of each variable that the library writes.
VARIABLES = {
    "time": ("s", "time from the first sample"),
    "position": ("rad", "joint position"),
    "torque": ("N·m", "net torque, opposing stretch"),
    "reference": ("rad", "position command to the servo"),
    "torque_intrinsic": ("N·m", "true intrinsic torque"),
    "torque_reflex": ("N·m", "true reflex torque"),
    "torque_voluntary": ("N·m", "true voluntary torque"),
    "torque_noise": ("N·m", "true torque measurement noise"),
}
TRUE_TORQUES = tuple(name for name in VARIABLES if name.startswith("torque_"))


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
        raise DataError(f"{source}: time is made from sampling_rate: do not pass it, or give it another name.")
    arrays: dict[str, np.ndarray] = {}
    attributes: dict[str, Any] = {"sampling_rate": rate}
    for name, value in {"position": position, "torque": torque, "reference": reference, **extras}.items():
        if value is None:
            continue
        if name in CHANNELS or np.ndim(_as_masked_array(value)) > 0:
            arrays[name] = as_signal(value, name, source=source)
        else:
            attributes[name] = _as_attribute(value, name, source)
    _check_arrays(arrays, source)
    time = np.arange(arrays["position"].size) / rate
    trial = xr.Dataset(
        {name: ("time", array, _describe_variable(name)) for name, array in arrays.items()},
        coords={"time": ("time", time, _describe_variable("time"))},
        attrs=attributes,
    )
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
    time = trial["time"].values
    inside = (time >= start - 1e-9) & (time < stop - 1e-9)
    if inside.sum() < 2:
        raise DataError(
            f"the segment from {start:g} to {stop:g} s has no samples: the trial covers {time[0]:g} to {time[-1]:g} s."
        )
    return validate(trial.isel(time=inside), source=f"segment {start:g} to {stop:g} s")


def save_trial(trial: xr.Dataset, path: str | os.PathLike[str]) -> None:
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
    write_netcdf(trial.drop_encoding(), path, {str(name): {"_FillValue": None} for name in trial.variables})


def load_trial(path: str | os.PathLike[str]) -> xr.Dataset:
    """Load a trial that `save_trial` wrote: same bits, same attributes.

    Parameters
    ----------
    path : str or pathlib.Path
        The NetCDF file. Files of other origin are read by `ankleloop.records.readers.read_trial`.

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
        # Decoding by the CF conventions could change samples and attributes.
        trial = xr.load_dataset(path, engine="h5netcdf", decode_cf=False).drop_encoding()
    except Exception as cause:  # the HDF5 libraries raise almost anything on a damaged file
        reason = str(cause).partition("\n")[0]
        raise DataError(f"{path.name}: not a readable NetCDF-4 file ({reason}): write it with save_trial.") from cause
    trial.attrs.update({name: value.item() for name, value in trial.attrs.items() if isinstance(value, np.generic)})
    return validate(trial, source=path.name)


def as_signal(values: ArrayLike, name: str, *, source: str) -> np.ndarray:
    """Copy real numbers into a 1-D array of float64.

    Parameters
    ----------
    values : array_like, shape (N,), (N, 1) or (1, N)
        Integers or floating-point numbers; masked samples become nan.
    name, source : str
        Names of the variable and of the data in error messages.

    Returns
    -------
    ndarray, shape (N,)

    Raises
    ------
    DataError
        If the array is empty, not of real numbers, or has more than one channel.

    Examples
    --------
    >>> as_signal([[1], [2]], "torque", source="trial")
    array([1., 2.])
    """
    array = _as_masked_array(values)
    if array.size == 0:
        raise DataError(f"{source}: {name} is empty: record it, or choose another variable.")
    if array.dtype.kind not in "iuf":
        raise DataError(f"{source}: {name} is of type {array.dtype}, not real numbers: convert it, or choose another.")
    if array.ndim == 2 and 1 in array.shape:
        array = array.ravel()
    if array.ndim != 1:
        raise DataError(f"{source}: {name} has shape {array.shape}, not one sample per time: pass a single channel.")
    return np.ma.filled(array.astype(float), np.nan)


def _as_masked_array(values: Any) -> np.ma.MaskedArray[Any, Any]:
    """Masked array of the values; a ragged list becomes an array of objects, which `as_signal` refuses by its name."""
    try:
        return values if isinstance(values, np.ma.MaskedArray) else np.ma.asarray(np.asarray(values))
    except (TypeError, ValueError):
        return np.ma.asarray(np.array([values, None], dtype=object))


def _as_attribute(value: Any, name: str, source: str) -> int | float | str:
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


def _describe_variable(name: str) -> dict[str, str]:
    unit, long_name = VARIABLES.get(name, ("N·m" if name.startswith("torque") else "", name.replace("_", " ")))
    return {"units": unit, "long_name": long_name}


def _check_arrays(arrays: dict[str, np.ndarray], source: str) -> None:
    for name in REQUIRED:
        if name not in arrays:
            raise DataError(f"{source}: there is no {name}: pass it as a 1-D array.")
    size = arrays["position"].size
    for name, array in arrays.items():
        if array.size != size:
            raise DataError(
                f"{source}: {name} has {format_samples(array.size)} but position has {size}: cut all variables to the "
                "same samples."
            )
