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
ATTRIBUTES = "trial_attributes"  # those in which a trial differs from the first one, null where it has none
FAILURE = "failure"  # why a trial is missing; a file in which none is has no such variable
INDEX = ("point", "number", ATTRIBUTES, FAILURE)
KIND, REMEDY = "trial file", "delete it and run again; it is made anew"

Path = str | os.PathLike[str]


@dataclass(frozen=True)
class FailedTrial:
    """What stands in the place of a trial that could not be simulated."""

    point: str  # point of the study to which the trial belongs
    number: int  # number of the trial at its point
    reason: str  # what is wrong with it


@dataclass(frozen=True)
class TrialChunk:
    """Some trials of a file, read in one pass."""

    trials: list[xr.Dataset]  # valid trials
    points: list[str]  # point of the study to which each trial belongs
    numbers: list[int]  # number of each trial at its point
    failures: Sequence[FailedTrial] = ()  # trials of the same part of the file that could not be simulated


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
    attributes: list[str] = []
    reasons: list[str] = []
    first: xr.Dataset | None = None
    with atomic_netcdf(path, overwrite=overwrite) as (file, sink):
        file.dimensions = {"trial": len(index)}
        for row, (trial, (point, number)) in enumerate(zip(trials, index, strict=True)):
            if isinstance(trial, FailedTrial):
                attributes.append("{}")
                reasons.append(trial.reason)
                continue
            reasons.append("")
            if first is None:
                first = trial
                _create_variables(file, trial, kind)
            same = trial.sizes == first.sizes and set(trial.data_vars) == set(first.data_vars)
            if not same or trial.attrs["sampling_rate"] != first.attrs["sampling_rate"]:
                raise DataError(
                    f"trial {number} of {point} differs from the first trial in length, variables or sampling rate: "
                    "save it in a file of its own."
                )
            attributes.append(json.dumps(_keep_differences(trial.attrs, first.attrs)))
            for name in map(str, trial.data_vars):
                values = trial.variables[name].values
                if values.any():  # what is not written is zero
                    file[name][row] = values.astype(kind)
            sink.check()
        if not reasons:
            raise DataError(f"{path}: there are no trials to save.")
        file.create_variable("number", ("trial",), np.int64)[:] = [number for _, number in index]
        texts = {"point": [point for point, _ in index], ATTRIBUTES: attributes}
        for name, column in (texts | {FAILURE: reasons} if any(reasons) else texts).items():
            file.create_variable(name, ("trial",), h5py.string_dtype())[:] = np.array(column, dtype=object)


def _create_variables(file: Any, trial: xr.Dataset, kind: type[np.floating]) -> None:
    """Create the variables of trials like the first one, whose attributes become those of the file."""
    size = trial.sizes["time"]
    file.attrs.update(trial.attrs)
    file.dimensions["time"] = size
    file.create_variable("time", ("time",), np.float64)[:] = trial["time"].values
    for name in trial.data_vars:
        file.create_variable(name, ("trial", "time"), kind, chunks=(1, size))
    for name, variable in trial.variables.items():
        file[name].attrs.update(variable.attrs)


def _keep_differences(attributes: Mapping[str, Any], first: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes whose values or types are not those of the first trial, and null for those that are missing."""
    typed = {name: (type(value), value) for name, value in first.items()}
    changed = {name: value for name, value in attributes.items() if typed.get(name) != (type(value), value)}
    return changed | dict.fromkeys(first.keys() - attributes.keys())


def load_trials(path: Path) -> Iterator[xr.Dataset]:
    """Read the trials that `save_trials` wrote, one after the other."""
    for chunk in load_chunks(path):
        yield from chunk.trials


def load_chunks(path: Path, trials: Mapping[str, Sequence[int]] | None = None) -> Iterator[TrialChunk]:
    """Read the trials that `save_trials` wrote, several at a time: one pass over a signal serves all of them."""
    with _open(path) as data:
        rows = [*range(data.sizes["trial"])] if trials is None else _find_rows(data, trials, path)
        signals = sum(variable.ndim > 1 for variable in data.variables.values())
        count = max(1, min(CHUNK, CHUNK_MEMORY // max(1, 8 * data.sizes.get("time", 0) * signals)))
        while rows:
            together = sum(row == rows[0] + k for k, row in enumerate(rows[:count]))
            yield _read_chunk(data, slice(rows[0], rows[0] + together), path)
            rows = rows[together:]


def _find_rows(data: xr.Dataset, trials: Mapping[str, Sequence[int]], path: Path) -> list[int]:
    """Rows of the file that hold some trials: the first number of each point, and the one before which they end."""
    index = zip(data["point"].values.astype(str).tolist(), data["number"].values.tolist(), strict=True)
    rows = {key: row for row, key in enumerate(index)}
    wanted = [(point, number) for point, (first, stop) in trials.items() for number in range(first, stop)]
    for point, number in wanted:
        if (point, number) not in rows:
            raise DataError(
                f"{path} has no trial {number} of the point {point!r}: delete the file, and simulate again."
            )
    return [rows[key] for key in wanted]


def load_trial_of(paths: Iterable[Path], point: str, number: int) -> xr.Dataset:
    """Read one trial of a study."""
    for path in paths:
        with _open(path) as data:
            row = np.flatnonzero((data["point"].values == point) & (data["number"].values == number))
            if row.size:
                chunk = _read_chunk(data, slice(row[0], row[0] + 1), path)
                for failure in chunk.failures:
                    raise DataError(f"trial {number} of the point {point!r} could not be simulated: {failure.reason}")
                return chunk.trials[0]
    raise DataError(f"no trial file has trial {number} of the point {point!r}: check the name and the number.")


@contextmanager
def _open(path: Path) -> Iterator[xr.Dataset]:
    """The contents of a trial file, not yet read; errors of the block name the file."""
    with (
        readable_file(path, KIND, REMEDY) as readable,
        xr.open_dataset(readable, engine="h5netcdf", decode_times=False) as data,
    ):
        required = {*INDEX[:3]} if FAILURE in data else {*INDEX[:3], "time"}
        missing = required - set(data.variables)
        if missing:
            reason = f"no trial file of ankleloop, which save_trials writes: it has no variable {min(missing)!r}"
            raise DataError(describe_damage(path, KIND, REMEDY, reason))
        yield data


def _read_chunk(data: xr.Dataset, rows: slice, path: Path) -> TrialChunk:
    part = data.isel(trial=rows)
    keys = list(zip(part["point"].values.astype(str).tolist(), part["number"].values.tolist(), strict=True))
    reasons = part[FAILURE].values.astype(str).tolist() if FAILURE in part else [""] * len(keys)
    failures = [FailedTrial(*key, reason) for key, reason in zip(keys, reasons, strict=True) if reason]
    whole = [row for row, reason in enumerate(reasons) if not reason]
    if not whole:
        return TrialChunk([], [], [], failures)
    part = part.load()
    shared = {name: value.item() if isinstance(value, np.generic) else value for name, value in part.attrs.items()}
    signals = {str(name): variable for name, variable in part.variables.items() if variable.ndim > 1}
    time = part["time"].variable
    empty = {name: ("time", np.empty(time.size), variable.attrs) for name, variable in signals.items()}
    template = xr.Dataset(empty, coords={"time": time})  # a copy takes a sixth of the time of a new dataset
    trials = []
    for row in whole:
        trial = template.copy(data={name: variable.values[row].astype(float) for name, variable in signals.items()})
        attributes = shared | json.loads(str(part[ATTRIBUTES].values[row]))
        trial.attrs = {name: value for name, value in attributes.items() if value is not None}
        trials.append(validate(trial, source=f"{path}, trial {keys[row][1]} of {keys[row][0]}"))
    return TrialChunk(trials, [keys[row][0] for row in whole], [keys[row][1] for row in whole], failures)
