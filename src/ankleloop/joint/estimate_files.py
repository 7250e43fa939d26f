"""Estimate files: estimates of many trials in one file, with a group for each method."""

from __future__ import annotations

import os
import pickle
import weakref
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from tempfile import SpooledTemporaryFile
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.estimate import TORQUES, Estimate
from ankleloop.joint.models import model_from_fields
from ankleloop.joint.time_varying_trajectories import read_trajectories
from ankleloop.joint.typed_json import dump_values, load_values
from ankleloop.quantities import QUANTITIES
from ankleloop.records.files import atomic_netcdf, parse_precision
from ankleloop.records.group_files import Fields
from ankleloop.records.readable_files import readable_file

if TYPE_CHECKING:
    import h5netcdf

__all__ = ["EstimateCollection", "find_estimates", "load_estimates", "load_estimates_of", "save_estimates"]

PathLike = str | os.PathLike[str]
MEMORY = 2**21  # bytes of the estimates by a method that are in memory before they go to a temporary file
WRITTEN = 25  # estimates written at a time: each access to the file costs more than the numbers
TEXTS = ("reflex_parameters", "intervals", "diagnostics", "model", "trajectories")  # of each estimate, as JSON


class EstimateCollection:
    """Estimates by one method, collected as they will be written: with their models, torques in the chosen precision.

    They are in a temporary file, so that any number of them takes little memory.

    Parameters
    ----------
    estimates : iterable of Estimate
        The first estimates, of the trials 0, 1, … of one point, "only".
    precision : {"double", "single"}
        Floating-point numbers of the torques on disk.
    folder : path-like, optional
        Folder of the temporary file; by default that of the system.

    Raises
    ------
    ValueError
        For an unknown precision.
    """

    def __init__(
        self, estimates: Iterable[Estimate] = (), precision: str = "double", folder: PathLike | None = None
    ) -> None:
        self._kind = parse_precision(precision)
        self._rows = SpooledTemporaryFile(MEMORY, dir=None if folder is None else os.fspath(folder))  # noqa: SIM115
        weakref.finalize(self, self._rows.close)
        self._first: Estimate | None = None
        self._time = np.empty(0)
        self._starts: list[float] = []
        self._index: list[tuple[str, int]] = []
        for number, estimate in enumerate(estimates):
            self.add(estimate, "only", number)

    def __len__(self) -> int:
        return len(self._index)

    def add(self, estimate: Estimate, point: str, number: int) -> None:
        """Add the estimate of a trial; all have the same rate, but an estimated delay can shift their first sample."""
        model = estimate.predictor
        texts = {
            "reflex_parameters": dump_values(estimate.reflex),
            "intervals": dump_values(estimate.intervals),
            "diagnostics": dump_values(estimate.diagnostics),
            "model": dump_values(None if model is None else {"kind": model.kind, **model.fields()}),
            "trajectories": dump_values(_describe_trajectories(estimate)),
        }
        torques = {name: estimate.torque.variables[name].values.astype(self._kind) for name in TORQUES}
        pickle.dump((torques, list(estimate.stiffness.values()), texts), self._rows, pickle.HIGHEST_PROTOCOL)
        time = estimate.torque.variables["time"].values
        self._first = estimate if self._first is None else self._first
        self._time = _join_times(self._time, time, estimate.torque.attrs["identification_rate"])
        self._starts.append(float(time[0]))
        self._index.append((point, number))

    def write(self, group: h5netcdf.Group) -> None:
        """Write the estimates over `trial`, `time` and `parameter`, a few at a time."""
        if self._first is None:
            raise DataError("there are no estimates to save.")
        variables = self._create_variables(group, self._first)
        offsets = self._offsets()
        self._rows.seek(0)
        for start in range(0, len(self), WRITTEN):
            part = slice(start, min(start + WRITTEN, len(self)))
            torques, stiffness, texts = zip(*(pickle.load(self._rows) for _ in offsets[part]), strict=True)
            for name in TORQUES:
                variables[name][part] = _pad([row[name] for row in torques], offsets[part], self._time.size)
            for name in TEXTS:
                variables[name][part] = np.array([row[name] for row in texts], dtype=object)
            variables["stiffness"][part] = np.array(stiffness)

    def _create_variables(self, group: h5netcdf.Group, first: Estimate) -> dict[str, h5netcdf.Variable]:
        """The variables of a group, with all but the rows of the estimates."""
        import h5py

        torque, names, text = first.torque, list(first.stiffness), h5py.string_dtype()
        group.attrs.update({**torque.attrs, "method": first.method})
        group.dimensions = {"trial": len(self), "time": self._time.size, "parameter": len(names)}
        variables = {name: group.create_variable(name, ("trial", "time"), self._kind) for name in TORQUES}
        variables["time"] = group.create_variable("time", ("time",), float, data=self._time)
        for name, variable in variables.items():
            variable.attrs.update(torque[name].attrs)
        variables["stiffness"] = group.create_variable("stiffness", ("trial", "parameter"), float)
        variables["stiffness"].attrs["units"] = ", ".join(QUANTITIES[name].unit for name in names)
        variables |= {name: group.create_variable(name, ("trial",), text) for name in TEXTS}
        group.create_variable("parameter", ("parameter",), text)[:] = np.array(names, dtype=object)
        group.create_variable("point", ("trial",), text)[:] = np.array([p for p, _ in self._index], dtype=object)
        group.create_variable("number", ("trial",), np.int64)[:] = [number for _, number in self._index]
        return variables

    def _offsets(self) -> list[int]:
        """Place of the first sample of each estimate on the common grid of times."""
        rate = self._first.torque.attrs["identification_rate"] if self._first is not None else 0.0
        return [round((start - float(self._time[0])) * rate) for start in self._starts]


def _describe_trajectories(estimate: Estimate) -> dict[str, Any] | None:
    """Trajectories by name with their coordinate and attributes; None for a method that has none."""
    if estimate.trajectories is None:
        return None
    curves = {str(name): variable.values for name, variable in estimate.trajectories.variables.items()}
    return {**curves, **estimate.trajectories.attrs}


def _join_times(grid: np.ndarray, time: np.ndarray, rate: float) -> np.ndarray:
    """A grid of times that holds those of another estimate, too."""
    if not grid.size:
        return time
    offset = round(float(time[0] - grid[0]) * rate)
    if offset >= 0 and offset + time.size <= grid.size:
        return grid
    before = max(-offset, 0)
    joined = grid[0] + np.arange(-before, max(grid.size, offset + time.size)) / rate
    joined[before + offset : before + offset + time.size] = time
    joined[before : before + grid.size] = grid
    return joined


def _pad(rows: Sequence[np.ndarray], offsets: Sequence[int], samples: int) -> np.ndarray:
    """Rows on one grid, nan where a row has no samples."""
    if all(row.size == samples for row in rows):
        return np.stack(rows)
    values = np.full((len(rows), samples), np.nan, rows[0].dtype)
    for value, row, offset in zip(values, rows, offsets, strict=True):
        value[offset : offset + row.size] = row
    return values


def save_estimates(collections: Mapping[str, EstimateCollection], path: PathLike, *, overwrite: bool = False) -> None:
    """Write estimates to one NetCDF file with a group for each method; it appears when it is complete."""
    with atomic_netcdf(path, overwrite=overwrite) as (file, sink):
        for group, collection in collections.items():
            collection.write(file.create_group(group))
            sink.check()


def load_estimates(path: PathLike, group: str) -> list[Estimate]:
    """Read the estimates by one method that `save_estimates` wrote.

    Parameters
    ----------
    path : path-like
        The file.
    group : str
        Name of the method in the file.

    Returns
    -------
    list of Estimate
        With their models, so that they predict. Tuples in their diagnostics have become lists.

    Raises
    ------
    DataError
        If there is no such file, it is damaged, or it has no such group.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop import identify, simulate
    >>> trial = simulate(seed=1, duration=10.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_estimates({"pr-moesp": EstimateCollection([identify(trial, "pr-moesp")])}, f"{folder}/0.nc")
    ...     [estimate] = load_estimates(f"{folder}/0.nc", "pr-moesp")
    >>> estimate.predict(trial).method
    'pr-moesp'
    """
    with _open(path) as file:
        return _estimates(_group(file, path, group).load(), path)


def load_estimates_of(paths: Iterable[PathLike], point: str, method: str) -> list[Estimate]:
    """Read all estimates by one method at one point of a study, in the order of the trials.

    Parameters
    ----------
    paths : iterable of path-like
        Estimate files of the study.
    point : str
        Point of the study.
    method : str
        Name of the method in the study.

    Returns
    -------
    list of Estimate
        With their models, as `load_estimates` reads them; without the trials that the method could not identify.

    Raises
    ------
    DataError
        If there is no such file, one is damaged, or none has estimates by this method at this point.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop import identify, simulate
    >>> collection = EstimateCollection([identify(simulate(seed=seed, duration=10.0)) for seed in (1, 2)])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_estimates({"pr-moesp": collection}, f"{folder}/0.nc")
    ...     len(load_estimates_of([f"{folder}/0.nc"], "only", "pr-moesp"))
    2
    """
    estimates = find_estimates(paths, point, method)
    if not estimates:
        raise DataError(
            f"no estimate file has the point {point!r} by {method!r}: check the names, or whether all trials failed."
        )
    return list(estimates.values())


def find_estimates(paths: Iterable[PathLike], point: str, method: str) -> dict[int, Estimate]:
    """Read all estimates by one method at one point of a study, by the number of the trial."""
    estimates: list[tuple[int, Estimate]] = []
    for path in paths:
        with _open(path) as file:
            if method in file.groups:  # otherwise it identified no trial of this chunk
                estimates += _find_rows(_group(file, path, method), path, point)
    return dict(sorted(estimates, key=lambda pair: pair[0]))


@contextmanager
def _open(path: PathLike) -> Iterator[h5netcdf.File]:
    """An estimate file; errors of the block name it."""
    import h5netcdf  # here, with h5py: jobs of the workflow do not read estimates

    remedy = "delete it and run again; it is made anew"
    with readable_file(path, "estimate file", remedy) as readable, h5netcdf.File(readable, "r") as file:
        yield file


def _group(file: h5netcdf.File, path: PathLike, group: str) -> xr.Dataset:
    """A group of an estimate file, not yet read."""
    if group not in file.groups:
        raise DataError(
            f"{path}: there is no group {group!r}; it has {', '.join(file.groups) or 'none'}: take one of these, "
            "or identify again."
        )
    data = xr.open_dataset(xr.backends.H5NetCDFStore(file, group=group))
    missing = {*TORQUES, *TEXTS, "parameter", "stiffness", "point", "number"} - set(data.variables)
    if missing:
        raise DataError(f"{path}: there is no variable {min(missing)!r}: identify again, or load another file.")
    return data


def _find_rows(data: xr.Dataset, path: PathLike, point: str) -> list[tuple[int, Estimate]]:
    """Numbers and estimates of the trials of a point."""
    part = data.isel(trial=np.flatnonzero(data["point"].values == point)).load()
    return list(zip(part["number"].values.tolist(), _estimates(part, path), strict=True))


def _trim(torque: xr.Dataset) -> xr.Dataset:
    """The samples of an estimate, without those that only others of its file have."""
    samples = np.flatnonzero(np.isfinite(torque["net"].values))
    return torque if samples.size == torque.sizes["time"] else torque.isel(time=slice(samples[0], samples[-1] + 1))


def _estimates(data: xr.Dataset, source: PathLike) -> list[Estimate]:
    names = data["parameter"].values.astype(str).tolist()
    torques = data[list(TORQUES)].astype(float)
    try:
        columns = {name: [load_values(text) for text in data[name].values] for name in TEXTS}
    except DataError as cause:
        raise DataError(f"{source}: {cause}") from cause
    estimates = []
    for row, fields in enumerate(columns["model"]):
        model = None if fields is None else model_from_fields(Fields(f"{source}, model {row}", fields))
        curves = columns["trajectories"][row]
        estimates.append(
            Estimate(
                method=data.attrs["method"],
                torque=_trim(torques.isel(trial=row)),
                matrices=None if model is None else model.matrices,
                stiffness=dict(zip(names, data["stiffness"].values[row].tolist(), strict=True)),
                reflex=columns["reflex_parameters"][row],
                intervals={name: tuple(ends) for name, ends in columns["intervals"][row].items()},
                diagnostics=columns["diagnostics"][row],
                predictor=model,
                trajectories=None if curves is None else read_trajectories(Fields(f"{source}, row {row}", curves)),
            )
        )
    return estimates
