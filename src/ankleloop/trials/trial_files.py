"""Files of trials: one trial, or those of a study, of equal length, each with its point and its number there."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.options import as_plain, check_flag, check_path
from ankleloop.trials.files import PathLike, atomic_netcdf, write_netcdf
from ankleloop.trials.readable_files import readable_file
from ankleloop.trials.trial import validate

INDEX = "index"  # variable with point and number of each trial, and its attributes or why it is missing, as JSON
# Point and number of each; a text says why there is no trial.
Trials = Iterator[tuple[str, int, xr.Dataset | str]]


def save_trial(trial: xr.Dataset, path: PathLike, *, overwrite: bool = False) -> None:
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

    See Also
    --------
    ankleloop.load_trial : Reads the file.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop import new_trial
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


def load_trial(path: PathLike) -> xr.Dataset:
    """Load a trial that `save_trial` wrote: same bits, same attributes.

    Parameters
    ----------
    path : str or pathlib.Path
        The NetCDF file. Files of other origin are read by `ankleloop_lab.files.reading.read_trial`.

    Returns
    -------
    xarray.Dataset
        The trial, shape (N,) per variable [rad, N·m] over `time` [s].

    Raises
    ------
    DataError
        If the file does not exist, is not NetCDF-4, or does not hold a valid trial.

    See Also
    --------
    ankleloop.save_trial : Writes the file.
    ankleloop.read_trial : A trial from a file of a laboratory.

    Examples
    --------
    >>> load_trial("nowhere.nc")
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: nowhere.nc: there is no such file: check the path.
    """
    path = check_path("load_trial", "path", path)
    with readable_file(
        path, "NetCDF-4 file", "restore it from a copy, or write it with save_trial"
    ) as file:
        # Decoding by the CF conventions could change samples and attributes.
        trial = xr.load_dataset(file, engine="h5netcdf", decode_cf=False).drop_encoding()
        trial.attrs = {name: as_plain(value) for name, value in trial.attrs.items()}
        return validate(trial, source=path.name)


def save_trials(
    trials: Iterable[xr.Dataset | str],
    path: PathLike,
    index: Sequence[tuple[str, int]],
    precision: str = "double",
    *,
    overwrite: bool = False,
) -> None:
    """Write trials of equal length, rate and variables to one NetCDF file, which appears when it is complete.

    Signals that are zero throughout (the noise of a noise-free simulation) take no space.
    """
    import h5py

    rows = []
    with atomic_netcdf(path, overwrite=overwrite) as file:
        file.dimensions = {"trial": len(index)}
        for row, (trial, (point, number)) in enumerate(zip(trials, index, strict=True)):
            content = trial if isinstance(trial, str) else trial.attrs
            rows.append(json.dumps([point, number, content]))
            if isinstance(trial, str):
                continue
            if (
                "time" not in file.variables
            ):  # the variables of all trials are those of the first one
                size = trial.sizes["time"]
                file.dimensions["time"] = size
                file.create_variable("time", ("time",), data=trial["time"].values)
                for name in trial.data_vars:
                    file.create_variable(name, ("trial", "time"), precision, chunks=(1, size))
                for name in trial.variables:
                    file[name].attrs.update(trial[name].attrs)
            for name, variable in trial.data_vars.items():
                if variable.values.any():  # what is not written is zero
                    file[name][row] = variable.values.astype(precision)
        file.create_variable(INDEX, ("trial",), h5py.string_dtype(), np.array(rows, dtype=object))


def load_trials(path: PathLike) -> Iterator[xr.Dataset]:
    """Read the trials that `save_trials` wrote, one after the other; those that failed are left out."""
    yield from (trial for _, _, trial in load_rows(path) if not isinstance(trial, str))


def load_rows(path: PathLike, index: Sequence[tuple[str, int]] | None = None) -> Trials:
    """Read all trials of a file, or those of some points and numbers."""
    with _open(path) as (rows, read):
        for point, number in rows if index is None else index:
            yield point, number, read(point, number)


def load_trial_of(paths: Iterable[PathLike], point: str, number: int) -> xr.Dataset:
    """Read one trial of a study."""
    for path in paths:
        with _open(path) as (rows, read):
            if (point, number) in rows:
                trial = read(point, number)
                if isinstance(trial, str):
                    raise DataError(
                        f"trial {number} of the point {point!r} could not be simulated: {trial}"
                    )
                return trial
    raise DataError(
        f"no trial file has trial {number} of the point {point!r}: check the name and the number."
    )


@contextmanager
def _open(path: PathLike) -> Iterator[tuple[dict[tuple[str, int], int], Any]]:
    """The rows of a trial file by point and number, and a function that reads one; errors name the file."""
    import h5py

    with (
        readable_file(path, "trial file", "delete it and run again") as readable,
        h5py.File(readable) as file,
    ):
        texts = file[INDEX].asstr()[:]
        rows = {}
        for row, text in enumerate(texts):
            point, number, _ = json.loads(text)
            rows[point, number] = row
        # Decoding by the CF conventions could change samples and attributes.
        with xr.open_dataset(readable, engine="h5netcdf", decode_cf=False) as dataset:
            first = dataset.drop_vars(INDEX).isel(trial=0, missing_dims="ignore")
            template = first.load().drop_encoding()

        def read(point: str, number: int) -> xr.Dataset | str:
            row = rows[point, number]
            # Again: the attributes of all trials would take much memory.
            content = json.loads(texts[row])[2]
            if isinstance(content, str):
                return content
            # From HDF5 itself, as xarray takes ten times as long; variables that stay open would keep what was read.
            data = {name: file[name][row].astype(float) for name in template.data_vars}
            trial = template.copy(data=data).assign_attrs(content)
            return validate(trial, source=f"{path}, trial {number} of {point}")

        yield rows, read
