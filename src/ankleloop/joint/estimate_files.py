"""Estimate files: estimates of many trials in one file, with a group for each method."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.estimate import TORQUES, Estimate
from ankleloop.quantities import QUANTITIES
from ankleloop.records.files import atomic_file, parse_precision

__all__ = ["EstimateCollection", "load_estimates", "load_estimates_of", "save_estimates"]

Path = str | os.PathLike[str]


class EstimateCollection:
    """Estimates by one method, collected as they will be written: without their models, and in the chosen precision.

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
        self._rows: list[dict[str, Any]] = []
        for number, estimate in enumerate(estimates):
            self.add(estimate, "only", number)

    def add(self, estimate: Estimate, point: str, number: int) -> None:
        """Add the estimate of a trial; all have the same samples.

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
        for name, values in self._torques.items():
            values.append(estimate.torque.variables[name].values.astype(self._kind))
        self._rows.append(
            {
                "point": point,
                "number": number,
                "stiffness": list(estimate.stiffness.values()),
                "reflex_parameters": json.dumps(estimate.reflex, default=_to_json),
                "intervals": json.dumps(estimate.intervals, default=_to_json),
                "diagnostics": json.dumps(estimate.diagnostics, default=_to_json),
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
        data = torque.assign(
            {name: (("trial", "time"), np.stack(rows), torque[name].attrs) for name, rows in self._torques.items()}
        )
        data = data.assign(
            {name: (("trial", "parameter") if values.ndim > 1 else "trial", values) for name, values in columns.items()}
        ).assign_coords(parameter=names)
        data["stiffness"].attrs["units"] = ", ".join(QUANTITIES[name].unit for name in names)
        data.attrs["method"] = self._first.method
        return data


def save_estimates(collections: Mapping[str, EstimateCollection], path: Path) -> None:
    """Write estimates to one NetCDF file with a group for each method; it appears when it is complete.

    Parameters
    ----------
    collections : mapping of str to EstimateCollection
        Estimates by the name of their group.
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
        for group, collection in collections.items():
            collection.dataset().to_netcdf(partial, mode="a", group=group, engine="h5netcdf", encoding=encoding)


def load_estimates(path: Path, group: str) -> list[Estimate]:
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
        Without their models, which the file does not hold.
    """
    with xr.open_dataset(path, engine="h5netcdf", group=group) as data:
        return _estimates(data.load())


def load_estimates_of(paths: Iterable[Path], point: str, method: str) -> list[Estimate]:
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
        Without their models, which the files do not hold.

    Raises
    ------
    DataError
        If no file has this point.
    """
    estimates: list[tuple[int, Estimate]] = []
    for path in paths:
        with xr.open_dataset(path, engine="h5netcdf", group=method) as data:
            rows = np.flatnonzero(data["point"].values == point)
            if rows.size:
                part = data.isel(trial=rows).load()
                estimates += zip(part["number"].values.tolist(), _estimates(part), strict=True)
    if not estimates:
        raise DataError(f"no estimate file has the point {point!r}: check the name.")
    return [estimate for _, estimate in sorted(estimates, key=lambda pair: pair[0])]


def _to_json(value: Any) -> Any:
    """Numbers and arrays of numpy for JSON; complex numbers as [real, imaginary]."""
    if isinstance(value, (complex, np.complexfloating)):
        return [value.real, value.imag]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be kept in diagnostics")


def _estimates(data: xr.Dataset) -> list[Estimate]:
    names = data["parameter"].values.astype(str).tolist()
    torques = data[list(TORQUES)].astype(float)
    columns = {name: data[name].values for name in ("stiffness", "reflex_parameters", "intervals", "diagnostics")}
    return [
        Estimate(
            method=data.attrs["method"],
            torque=torques.isel(trial=row),
            matrices=None,
            stiffness=dict(zip(names, columns["stiffness"][row].tolist(), strict=True)),
            reflex=json.loads(columns["reflex_parameters"][row]),
            intervals={name: tuple(ends) for name, ends in json.loads(columns["intervals"][row]).items()},
            diagnostics=json.loads(columns["diagnostics"][row]),
        )
        for row in range(data.sizes["trial"])
    ]
