"""Trial files: trials of equal length in one file, each with its point of a study and its number there."""

from __future__ import annotations

import json
import os
from collections import ChainMap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.trials.files import atomic_netcdf, parse_precision
from ankleloop.trials.readable_files import describe_damage, readable_file
from ankleloop.trials.validation import validate

if TYPE_CHECKING:
    import h5netcdf

CHUNK = 25  # trials read at a time: each access to the file costs more than the numbers
WRITTEN = 2**22  # bytes of a channel that are written at a time
CHUNK_MEMORY = 2**25  # bytes of the signals read at a time, where the trials are long
ATTRIBUTES = "trial_attributes"  # those in which the trials of a file differ
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

    A variable that is constant in every trial (the noise of a noise-free simulation) takes one number per trial.
    """
    kind = parse_precision(precision)
    if index is None:
        trials = list(trials)
        index = [("only", number) for number in range(len(trials))]
    with atomic_netcdf(path, overwrite=overwrite) as (file, sink):
        attributes: list[Mapping[str, Any]] = []
        first: dict[str, Any] = {}
        reasons: list[str] = []
        writer: _ChannelWriter | None = None
        for row, (trial, key) in enumerate(zip(trials, index, strict=True)):
            if isinstance(trial, FailedTrial):
                attributes.append({})
                reasons.append(trial.reason)
                continue
            writer = writer or _ChannelWriter(file, trial, len(index), kind)
            writer.write(row, trial, key)
            sink.check()
            first = first or trial.attrs
            attributes.append(_keep_differences(trial.attrs, first))
            reasons.append("")
        if not attributes:
            raise DataError(f"{path}: there are no trials to save.")
        if writer is None:
            file.dimensions = {"trial": len(index)}
        else:
            writer.finish()
        _write_index(file, index, attributes, reasons)


class _ChannelWriter:
    """Writes the channels of one trial after the other, several trials at a time where they are short.

    A channel is a number for each trial until a trial has other samples than its first one.
    """

    def __init__(self, file: h5netcdf.File, template: xr.Dataset, count: int, kind: type[np.floating]) -> None:
        self._file, self._template, self._kind = file, template, kind
        self._constants = {str(name): np.full(count, np.nan) for name in template.data_vars}
        self._waiting: dict[str, tuple[int, list[np.ndarray]]] = {}  # first row and rows that are not yet written
        file.dimensions = {"trial": count, "time": template.sizes["time"]}
        self._create("time", ("time",), np.float64)[:] = template["time"].values

    def write(self, row: int, trial: xr.Dataset, key: tuple[str, int]) -> None:
        """Write a trial, which must have the length, variables and sampling rate of the first one."""
        template = self._template
        same = trial.sizes == template.sizes and set(trial.data_vars) == set(template.data_vars)
        if not same or trial.attrs["sampling_rate"] != template.attrs["sampling_rate"]:
            raise DataError(
                f"trial {key[1]} of {key[0]} differs from the first trial in length, variables or sampling rate: "
                "save it in a file of its own."
            )
        for name in map(str, trial.data_vars):
            values = trial.variables[name].values
            if name in self._constants:
                if values.min() == values.max():
                    self._constants[name][row] = values[0]
                    continue
                variable = self._create(name, ("trial", "time"), self._kind)
                for earlier, value in enumerate(self._constants.pop(name)[:row]):
                    variable[earlier] = np.full(values.size, value, self._kind)
            self._add_row(name, row, values.astype(self._kind))

    def finish(self) -> None:
        """Write what is not yet written: the last trials, and the channels that are constant in every trial."""
        for name in list(self._waiting):
            self._write_rows(name)
        for name, values in self._constants.items():
            self._create(name, ("trial",), np.float64)[:] = values

    def _add_row(self, name: str, row: int, values: np.ndarray) -> None:
        first, rows = self._waiting.setdefault(name, (row, []))
        if row != first + len(rows):  # a trial between them failed
            self._write_rows(name)
            _, rows = self._waiting.setdefault(name, (row, []))
        rows.append(values)
        if len(rows) * values.nbytes >= WRITTEN:
            self._write_rows(name)

    def _write_rows(self, name: str) -> None:
        first, rows = self._waiting.pop(name)
        self._file.variables[name][first : first + len(rows)] = np.stack(rows)

    def _create(self, name: str, dimensions: tuple[str, ...], kind: type[np.floating]) -> h5netcdf.Variable:
        variable = self._file.create_variable(name, dimensions, kind)
        variable.attrs.update(self._template[name].attrs)
        return variable


def _keep_differences(attributes: dict[str, Any], first: dict[str, Any]) -> Mapping[str, Any]:
    """The same attributes; values that are those of the first trial take no memory."""
    if attributes.keys() != first.keys():
        return attributes
    same = {name for name, value in attributes.items() if (type(value), value) == (type(first[name]), first[name])}
    return ChainMap({name: value for name, value in attributes.items() if name not in same}, first)


def _write_index(
    file: h5netcdf.File, index: Sequence[tuple[str, int]], attributes: Sequence[Mapping[str, Any]], reasons: list[str]
) -> None:
    """Write point, number and attributes of every trial; attributes that all trials share are those of the file."""
    import h5py

    present = [a for a, reason in zip(attributes, reasons, strict=True) if not reason] or [{}]
    shared = {name: value for name, value in present[0].items() if all(a.get(name) == value for a in present)}
    different = [json.dumps({name: a[name] for name in a if name not in shared}) for a in attributes]
    file.attrs.update(shared)
    file.create_variable("number", ("trial",), np.int64)[:] = [number for _, number in index]
    columns = {"point": [point for point, _ in index], ATTRIBUTES: different}
    if any(reasons):
        columns[FAILURE] = reasons
    for name, texts in columns.items():
        file.create_variable(name, ("trial",), h5py.string_dtype())[:] = np.array(texts, dtype=object)


def load_trials(path: Path) -> Iterator[xr.Dataset]:
    """Read the trials that `save_trials` wrote, one after the other."""
    for chunk in load_chunks(path):
        yield from chunk.trials


def load_chunks(path: Path, trials: Mapping[str, Sequence[int]] | None = None) -> Iterator[TrialChunk]:
    """Read the trials that `save_trials` wrote, several at a time: one pass over a signal serves all of them."""
    with _open(path) as data:
        count = _count_rows(data)
        for rows in _find_rows(data, trials, path):
            for start in range(rows.start, rows.stop, count):
                yield _read_chunk(data, slice(start, min(start + count, rows.stop)), path)


def _find_rows(data: xr.Dataset, trials: Mapping[str, Sequence[int]] | None, path: Path) -> list[range]:
    """Rows of the file that hold some trials, those that follow each other in one range."""
    if trials is None:
        return [range(data.sizes["trial"])]
    index = zip(data["point"].values.astype(str).tolist(), data["number"].values.tolist(), strict=True)
    rows = {key: row for row, key in enumerate(index)}
    ranges: list[range] = []
    for point, (first, stop) in trials.items():
        for number in range(first, stop):
            row = rows.get((point, number))
            if row is None:
                raise DataError(
                    f"{path} has no trial {number} of the point {point!r}: delete the file, and simulate again."
                )
            if ranges and ranges[-1].stop == row:
                ranges[-1] = range(ranges[-1].start, row + 1)
            else:
                ranges.append(range(row, row + 1))
    return ranges


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


def _count_rows(data: xr.Dataset) -> int:
    """Trials that are read at a time, at least one."""
    size = 8 * data.sizes.get("time", 0) * sum(variable.ndim > 1 for variable in data.variables.values())
    return min(CHUNK, max(1, CHUNK_MEMORY // size)) if size else CHUNK


def _read_chunk(data: xr.Dataset, rows: slice, path: Path) -> TrialChunk:
    part = data.isel(trial=rows)
    index = list(zip(part["point"].values.astype(str).tolist(), part["number"].values.tolist(), strict=True))
    reasons = part[FAILURE].values.astype(str).tolist() if FAILURE in part else [""] * len(index)
    failures = [FailedTrial(*key, reason) for key, reason in zip(index, reasons, strict=True) if reason]
    if len(failures) == len(index):
        return TrialChunk([], [], [], failures)
    if failures:
        part = part.isel(trial=[row for row, reason in enumerate(reasons) if not reason])
        index = [key for key, reason in zip(index, reasons, strict=True) if not reason]
    part = part.load()
    time = part["time"].variable
    shared = {name: value.item() if hasattr(value, "item") else value for name, value in part.attrs.items()}
    variables = {str(name): v for name, v in part.variables.items() if name not in (*INDEX, "time")}
    signals = {name: np.asarray(v.values, float) for name, v in variables.items() if v.ndim > 1}
    constants = {name: np.asarray(v.values, float) for name, v in variables.items() if name not in signals}
    empty = {name: ("time", np.empty(time.size), variable.attrs) for name, variable in variables.items()}
    template = xr.Dataset(empty, coords={"time": time})  # a copy takes a sixth of the time of a new dataset
    trials = []
    for row, (text, (point, number)) in enumerate(zip(part[ATTRIBUTES].values, index, strict=True)):
        samples = {name: np.full(time.size, values[row]) for name, values in constants.items()}
        trial = template.copy(data={**samples, **{name: values[row] for name, values in signals.items()}})
        trial.attrs = shared | json.loads(str(text))
        trials.append(validate(trial, source=f"{path}, trial {number} of {point}"))
    return TrialChunk(trials, [point for point, _ in index], [number for _, number in index], failures)
