"""Estimate files: estimates of many trials in one file, with a group for each method."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.estimate import TORQUES, Estimate
from ankleloop.joint.models import model_from_fields
from ankleloop.joint.typed_json import dump_values, load_values
from ankleloop.quantities import QUANTITIES
from ankleloop.records.files import atomic_file, parse_precision
from ankleloop.records.group_files import Fields

__all__ = ["EstimateCollection", "find_estimates", "load_estimates", "load_estimates_of", "save_estimates"]

PathLike = str | os.PathLike[str]
TEXTS = ("reflex_parameters", "intervals", "diagnostics", "model")  # of each estimate, as JSON


class EstimateCollection:
    """Estimates by one method, collected as they will be written: with their models, torques in the chosen precision.

    Parameters
    ----------
    estimates : iterable of Estimate
        The first estimates, of the trials 0, 1, … of one point, "only".
    precision : {"double", "single"}
        Floating-point numbers of the torques on disk.

    Raises
    ------
    ValueError
        For an unknown precision.
    """

    def __init__(self, estimates: Iterable[Estimate] = (), precision: str = "double") -> None:
        self._kind = parse_precision(precision)
        self._first: Estimate | None = None
        self._torques: dict[str, list[np.ndarray]] = {name: [] for name in TORQUES}
        self._times: list[np.ndarray] = []
        self._rows: list[dict[str, Any]] = []
        for number, estimate in enumerate(estimates):
            self.add(estimate, "only", number)

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, estimate: Estimate, point: str, number: int) -> None:
        """Add the estimate of a trial; all have the same rate, but an estimated delay can shift their first sample.

        Parameters
        ----------
        estimate : Estimate
            The estimate.
        point : str
            Point of the study to which the trial belongs.
        number : int
            Number of the trial at this point.

        Raises
        ------
        TypeError
            For diagnostics that JSON does not represent.
        """
        self._first = estimate if self._first is None else self._first
        model = estimate.predictor
        time = estimate.torque.variables["time"].values
        shared = bool(self._times) and np.array_equal(time, self._times[0])
        self._times.append(self._times[0] if shared else time)
        for name, values in self._torques.items():
            values.append(estimate.torque.variables[name].values.astype(self._kind))
        self._rows.append(
            {
                "point": point,
                "number": number,
                "stiffness": list(estimate.stiffness.values()),
                "reflex_parameters": dump_values(estimate.reflex),
                "intervals": dump_values(estimate.intervals),
                "diagnostics": dump_values(estimate.diagnostics),
                "model": dump_values(None if model is None else {"kind": model.kind, **model.fields()}),
            }
        )

    def dataset(self) -> xr.Dataset:
        """The estimates as one data set over `trial`, `time` and `parameter`.

        Raises
        ------
        DataError
            If there are none.
        """
        if self._first is None:
            raise DataError("there are no estimates to save.")
        torque, names = self._first.torque, list(self._first.stiffness)
        columns = {name: np.array([row[name] for row in self._rows]) for name in self._rows[0]}
        time, offsets = _align(self._times, torque.attrs["identification_rate"])
        data = xr.Dataset(coords={"time": ("time", time, torque["time"].attrs)}, attrs=torque.attrs)
        data = data.assign(
            {
                name: (("trial", "time"), _pad(rows, offsets, time.size), torque[name].attrs)
                for name, rows in self._torques.items()
            }
        )
        data = data.assign(
            {name: (("trial", "parameter") if values.ndim > 1 else "trial", values) for name, values in columns.items()}
        ).assign_coords(parameter=names)
        data["stiffness"].attrs["units"] = ", ".join(QUANTITIES[name].unit for name in names)
        data.attrs["method"] = self._first.method
        return data


def _align(times: list[np.ndarray], rate: float) -> tuple[np.ndarray, list[int]]:
    """Times of several estimates on one grid, and the place of each on it."""
    start = min(float(time[0]) for time in times)
    offsets = [round((float(time[0]) - start) * rate) for time in times]
    grid = np.empty(max(offset + time.size for offset, time in zip(offsets, times, strict=True)))
    for offset, time in zip(offsets, times, strict=True):
        grid[offset : offset + time.size] = time
    return grid, offsets


def _pad(rows: list[np.ndarray], offsets: list[int], samples: int) -> np.ndarray:
    """Rows on one grid, nan where a row has no samples."""
    if all(row.size == samples for row in rows):
        return np.stack(rows)
    values = np.full((len(rows), samples), np.nan, rows[0].dtype)
    for value, row, offset in zip(values, rows, offsets, strict=True):
        value[offset : offset + row.size] = row
    return values


def save_estimates(collections: Mapping[str, EstimateCollection], path: PathLike) -> None:
    """Write estimates to one NetCDF file with a group for each method; it appears when it is complete.

    Parameters
    ----------
    collections : mapping of str to EstimateCollection
        Estimates by the name of their group; of none, where every method failed, the file is empty.
    path : path-like
        File to write.

    Raises
    ------
    DataError
        If a collection is empty, or the folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop import identify, simulate
    >>> estimate = identify(simulate(seed=1, duration=10.0))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_estimates({"pr-moesp": EstimateCollection([estimate])}, f"{folder}/0.nc")
    ...     load_estimates(f"{folder}/0.nc", "pr-moesp")[0].stiffness == estimate.stiffness
    True
    """
    encoding: dict[str, dict[str, Any]] = {name: {"_FillValue": None} for name in TORQUES}
    with atomic_file(path) as partial:
        if not collections:
            xr.Dataset().to_netcdf(partial, engine="h5netcdf")
        for group, collection in collections.items():
            collection.dataset().to_netcdf(partial, mode="a", group=group, engine="h5netcdf", encoding=encoding)


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
    """
    with _open(path, group) as data:
        return _estimates(data.load(), Path(path).name)


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
    """
    estimates = find_estimates(paths, point, method)
    if not estimates:
        raise DataError(
            f"no estimate file has the point {point!r} by {method!r}: check the names, or whether all trials failed."
        )
    return list(estimates.values())


def find_estimates(paths: Iterable[PathLike], point: str, method: str) -> dict[int, Estimate]:
    """Read all estimates by one method at one point of a study, by the number of the trial.

    Parameters
    ----------
    paths, point, method
        As of `load_estimates_of`.

    Returns
    -------
    dict of int to Estimate
        In the order of the trials; those that the method could not identify are left out.

    Raises
    ------
    DataError
        If there is no such file, or one is damaged.
    """
    estimates: list[tuple[int, Estimate]] = []
    for path in paths:
        if _lacks_group(path, method):  # the method identified no trial of this chunk
            continue
        with _open(path, method) as data:
            rows = np.flatnonzero(data["point"].values == point)
            if rows.size:
                part = data.isel(trial=rows).load()
                estimates += zip(part["number"].values.tolist(), _estimates(part, Path(path).name), strict=True)
    return dict(sorted(estimates, key=lambda pair: pair[0]))


def _lacks_group(path: PathLike, group: str) -> bool:
    """Whether a readable file has no such group."""
    import h5netcdf

    try:
        with h5netcdf.File(path, "r") as file:
            return group not in file.groups
    except Exception:  # `_open` says what is wrong with the file
        return False


def _open(path: PathLike, group: str) -> xr.Dataset:
    """A group of an estimate file, not yet read."""
    name = Path(path).name
    if not Path(path).is_file():
        raise DataError(f"{path}: there is no such file: check the path.")
    try:
        data = xr.open_dataset(path, engine="h5netcdf", group=group)
    except Exception as cause:  # the HDF5 libraries raise almost anything on a damaged file
        reason = str(cause).partition("\n")[0]
        raise DataError(f"{name}: no readable estimate file with the group {group!r} ({reason}).") from cause
    missing = {*TORQUES, *TEXTS, "parameter", "stiffness", "point", "number"} - set(data.variables)
    if missing:
        data.close()
        raise DataError(f"{name}: there is no variable {min(missing)!r}: identify again, or load another file.")
    return data


def _trim(torque: xr.Dataset) -> xr.Dataset:
    """The samples of an estimate, without those that only others of its file have."""
    samples = np.flatnonzero(np.isfinite(torque["net"].values))
    return torque if samples.size == torque.sizes["time"] else torque.isel(time=slice(samples[0], samples[-1] + 1))


def _estimates(data: xr.Dataset, source: str) -> list[Estimate]:
    names = data["parameter"].values.astype(str).tolist()
    torques = data[list(TORQUES)].astype(float)
    columns = {name: [load_values(text) for text in data[name].values] for name in TEXTS}
    estimates = []
    for row, fields in enumerate(columns["model"]):
        model = None if fields is None else model_from_fields(Fields(f"{source}, model {row}", fields))
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
            )
        )
    return estimates
