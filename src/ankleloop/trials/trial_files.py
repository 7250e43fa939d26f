"""Trial files: trials of equal length in one file, each with its point of a study and its number there."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.trials.files import atomic_netcdf, parse_precision
from ankleloop.trials.reading_process import describe_damage, readable_file
from ankleloop.trials.validation import validate

CHUNK = 25  # trials read at a time: each access to the file costs more than the numbers
CHUNK_MEMORY = 2**25  # bytes of the signals read at a time, where the trials are long
ATTRIBUTES = "trial_attributes"  # of each trial, as JSON
FAILURE = "failure"  # why a trial is missing, else empty
INDEX = ("point", "number", ATTRIBUTES, FAILURE)
KIND, REMEDY = "trial file", "delete it and run again"

Path = str | os.PathLike[str]


@dataclass(frozen=True)
class FailedTrial:
    """What stands in the place of a trial that could not be simulated."""

    point: str  # point of the study to which the trial belongs
    number: int  # number of the trial at its point
    reason: str  # what is wrong with it


Row = tuple[str, int, xr.Dataset | FailedTrial]  # point, number and trial


def save_trials(
    trials: Iterable[xr.Dataset | FailedTrial],
    path: Path,
    precision: str = "double",
    index: Sequence[tuple[str, int]] | None = None,
    *,
    overwrite: bool = False,
) -> None:
    """Write trials of equal length and sampling rate to one NetCDF file, which appears when it is complete.

    Signals that are zero throughout (the noise of a noise-free simulation) take no space.
    """
    import h5py

    kind = parse_precision(precision)
    if index is None:
        trials = list(trials)
        index = [("only", number) for number in range(len(trials))]
    if not index:
        raise DataError(f"{path}: there are no trials to save.")
    rows: list[tuple[str, int, str, str]] = []
    first: xr.Dataset | None = None
    with atomic_netcdf(path, overwrite=overwrite) as (file, sink):
        file.dimensions = {"trial": len(index)}
        for row, (trial, (point, number)) in enumerate(zip(trials, index, strict=True)):
            if isinstance(trial, FailedTrial):
                rows.append((point, number, "{}", trial.reason))
                continue
            if first is None:
                first = trial
                _create_variables(file, trial, kind)
            same = trial.sizes == first.sizes and set(trial.data_vars) == set(first.data_vars)
            if not same or trial.attrs["sampling_rate"] != first.attrs["sampling_rate"]:
                raise DataError(
                    f"trial {number} of {point} differs from the first trial in length, variables or sampling rate: "
                    "save it in a file of its own."
                )
            rows.append((point, number, json.dumps(trial.attrs), ""))
            for name in map(str, trial.data_vars):
                values = trial.variables[name].values
                if values.any():  # what is not written is zero
                    file[name][row] = values.astype(kind)
            sink.check()
        for name, column in zip(INDEX, zip(*rows, strict=True), strict=True):
            is_number = name == "number"
            variable = file.create_variable(name, ("trial",), np.int64 if is_number else h5py.string_dtype())
            variable[:] = np.array(column, dtype=np.int64 if is_number else object)


def _create_variables(file: Any, trial: xr.Dataset, kind: type[np.floating]) -> None:
    """Create the variables of trials like the first one."""
    size = trial.sizes["time"]
    file.dimensions["time"] = size
    file.create_variable("time", ("time",), np.float64)[:] = trial["time"].values
    for name in trial.data_vars:
        file.create_variable(name, ("trial", "time"), kind, chunks=(1, size))
    for name, variable in trial.variables.items():
        file[name].attrs.update(variable.attrs)


def load_trials(path: Path) -> Iterator[xr.Dataset]:
    """Read the trials that `save_trials` wrote, one after the other; those that failed are left out."""
    yield from (trial for _, _, trial in load_rows(path) if not isinstance(trial, FailedTrial))


def load_rows(path: Path, trials: Mapping[str, Sequence[int]] | None = None) -> Iterator[Row]:
    """Read all trials of a file, or some: the first number at each point, and the one before which they end."""
    with _open(path) as (data, index):
        rows = [*range(len(index))]
        if trials is not None:
            places = {key: row for row, key in enumerate(index)}
            wanted = [(point, number) for point, (first, stop) in trials.items() for number in range(first, stop)]
            for point, number in wanted:
                if (point, number) not in places:
                    raise DataError(
                        f"{path} has no trial {number} of the point {point!r}: delete the file, and simulate again."
                    )
            rows = [places[key] for key in wanted]
        signals = sum(variable.ndim > 1 for variable in data.variables.values())
        count = max(1, min(CHUNK, CHUNK_MEMORY // max(1, 8 * data.sizes.get("time", 0) * signals)))
        for start in range(0, len(rows), count):
            yield from _read_rows(data, rows[start : start + count], path)


def load_trial_of(paths: Iterable[Path], point: str, number: int) -> xr.Dataset:
    """Read one trial of a study."""
    for path in paths:
        with _open(path) as (data, index):
            if (point, number) in index:
                ((_, _, trial),) = _read_rows(data, [index.index((point, number))], path)
                if isinstance(trial, FailedTrial):
                    raise DataError(f"trial {number} of the point {point!r} could not be simulated: {trial.reason}")
                return trial
    raise DataError(f"no trial file has trial {number} of the point {point!r}: check the name and the number.")


@contextmanager
def _open(path: Path) -> Iterator[tuple[xr.Dataset, list[tuple[str, int]]]]:
    """The contents of a trial file, not yet read, and point and number of each trial; errors name the file."""
    with (
        readable_file(path, KIND, REMEDY) as readable,
        xr.open_dataset(readable, engine="h5netcdf", decode_times=False) as data,
    ):
        missing = {*INDEX} - set(data.variables)
        if missing:
            reason = f"no trial file of ankleloop, which save_trials writes: it has no variable {min(missing)!r}"
            raise DataError(describe_damage(path, KIND, REMEDY, reason))
        yield data, list(zip(data["point"].values.astype(str).tolist(), data["number"].values.tolist(), strict=True))


def _read_rows(data: xr.Dataset, rows: list[int], path: Path) -> Iterator[Row]:
    """Trials of some rows, in one pass over each signal."""
    part = data.isel(trial=rows).load()
    signals = {str(name): variable for name, variable in part.variables.items() if variable.ndim > 1}
    template = xr.Dataset()  # a copy takes a sixth of the time of a new dataset
    if "time" in part:
        time = part["time"].variable
        empty = {name: ("time", np.empty(time.size), variable.attrs) for name, variable in signals.items()}
        template = xr.Dataset(empty, coords={"time": time})
    for row, values in enumerate(zip(*(part[name].values.tolist() for name in INDEX), strict=True)):
        point, number, attributes, reason = values
        if reason:
            yield point, number, FailedTrial(point, number, reason)
            continue
        trial = template.copy(data={name: variable.values[row].astype(float) for name, variable in signals.items()})
        trial.attrs = json.loads(attributes)
        yield point, number, validate(trial, source=f"{path}, trial {number} of {point}")
