"""The trial: one record of a joint, as an `xarray.Dataset` over time.

Every trial has `position` [rad] and `torque` [N·m], both float64 over a regular `time` [s], and the attribute
`sampling_rate` [Hz]. A closed-loop trial also has `reference` [rad], the command to the servo. A simulated trial
carries the true parts of its torque, named in `TRUE_TORQUES`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.options import check_flag, check_integer, check_number, check_path
from ankleloop.signals.sampling import format_samples, parse_rate
from ankleloop.trials.channels import VARIABLES
from ankleloop.trials.files import write_netcdf
from ankleloop.trials.reading_process import readable_file
from ankleloop.trials.validation import CHANNELS, REQUIRED, validate

MAX_DEGREE = 10  # of a drift
PLAIN = (str, bool, int, float)  # attributes that need no conversion: a simulated trial has dozens


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
        if value is None and name not in REQUIRED:
            continue
        if name in CHANNELS or (type(value) not in PLAIN and np.ndim(_as_masked_array(value)) > 0):
            arrays[name] = as_signal(value, name, source=source)
        else:
            attributes[name] = _as_attribute(value, name, source)
    check_sizes({name: array.size for name, array in arrays.items()}, source=source)
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
    start, stop = (check_number("segment", *edge, "s") for edge in (("start", start), ("stop", stop)))
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
    legendre = np.polynomial.legendre
    detrended = torque - legendre.legval(grid, legendre.legfit(grid, torque, degree))
    if np.ptp(detrended) <= 1e-9 * np.ptp(torque):
        raise DataError(f"a polynomial of degree {degree} takes all of the torque: there is nothing but drift in it.")
    return validate(trial.assign(torque=trial["torque"].copy(data=detrended)))


def save_trial(trial: xr.Dataset, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Save a trial as a NetCDF-4 file.

    The file appears under its name only when it is complete, so that a crash never leaves half a trial.

    Parameters
    ----------
    trial : xarray.Dataset
        A trial, shape (N,) per variable.
    path : str or pathlib.Path
        The file to write, in a folder that exists.
    overwrite : bool
        Whether to replace a file of this name; without it an existing file is refused.

    Raises
    ------
    DataError
        If the trial is not valid, the file exists, or it cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> trial = new_trial([0.0, 0.01, 0.02], [0.0, 1.0, 2.0], 100.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_trial(trial, f"{folder}/trial.nc")
    ...     load_trial(f"{folder}/trial.nc").identical(trial)
    True
    """
    path = check_path("save_trial", "path", path)
    check_flag("save_trial", "overwrite", overwrite)
    trial = validate(trial, source=path.name)
    write_netcdf({"": trial}, path, overwrite=overwrite)


def load_trial(path: str | os.PathLike[str]) -> xr.Dataset:
    """Load a trial that `save_trial` wrote: same bits, same attributes.

    Parameters
    ----------
    path : str or pathlib.Path
        The NetCDF file. Files of other origin are read by `ankleloop.trials.readers.read_trial`.

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
    path = check_path("load_trial", "path", path)
    with readable_file(path, "NetCDF-4 file", "restore it from a copy, or write it with save_trial") as file:
        # Decoding by the CF conventions could change samples and attributes.
        trial = xr.load_dataset(file, engine="h5netcdf", decode_cf=False).drop_encoding()
        trial.attrs.update({name: value.item() for name, value in trial.attrs.items() if isinstance(value, np.generic)})
        return validate(trial, source=path.name)


def as_signal(values: ArrayLike, name: str, *, source: str) -> np.ndarray:
    """Copy real numbers into a 1-D array of float64.

    Shapes: values (N,); returns (N,).
    """
    array = _as_masked_array(values)
    if array.dtype.kind not in "iuf":
        raise DataError(f"{source}: {name} is of type {array.dtype}, not real numbers: convert it, or choose another.")
    check_shape(array.shape, name, source=source)
    return np.ma.filled(array.ravel().astype(float), np.nan)


def check_shape(shape: tuple[int, ...], name: str, *, source: str) -> int:
    """Check that an array holds a single channel, and count its samples."""
    size = int(np.prod(shape))
    if size == 0:
        raise DataError(f"{source}: {name} is empty: record it, or choose another variable.")
    if len(shape) not in (1, 2) or size != max(shape):
        raise DataError(f"{source}: {name} has shape {shape}, not one sample per time: pass a single channel.")
    return size


def _as_masked_array(values: Any) -> np.ma.MaskedArray[Any, Any]:
    """Masked array of the values; a ragged list becomes an array of objects, which `as_signal` refuses by its name."""
    try:
        return values if isinstance(values, np.ma.MaskedArray) else np.ma.asarray(np.asarray(values))
    except (TypeError, ValueError):
        return np.ma.asarray(np.array([values, None], dtype=object))


def _as_attribute(value: Any, name: str, source: str) -> int | float | str:
    """Plain int, float or str, the types that every NetCDF library writes."""
    value = value if type(value) in PLAIN else np.asarray(value).item()
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


def check_sizes(sizes: Mapping[str, int], *, source: str) -> None:
    """Check that all channels have as many samples as the position."""
    for name, size in sizes.items():
        if size != sizes["position"]:
            raise DataError(
                f"{source}: {name} has {format_samples(size)} but position has {sizes['position']}: cut all variables "
                "to the same samples."
            )
