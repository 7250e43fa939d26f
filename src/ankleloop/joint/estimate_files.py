"""Files of estimates with their models: one in NetCDF or MATLAB v5, those of a study in a Parquet table."""

from __future__ import annotations

import json
import os
import pickle
import weakref
from collections.abc import Iterable, Mapping
from tempfile import SpooledTemporaryFile
from typing import Any

import numpy as np
import pyarrow as pa
import xarray as xr
from pyarrow import parquet

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.models import dump_model, model_dataset, read_model
from ankleloop.joint.regressors import MEASURED, TORQUES, torque_dataset
from ankleloop.joint.time_varying_course import read_trajectories
from ankleloop.options import check_flag, check_path, show_value
from ankleloop.quantities import QUANTITIES
from ankleloop.trials.files import PathLike, atomic_file, check_readable
from ankleloop.trials.group_files import Fields, read_groups, write_groups
from ankleloop.trials.reading_process import name_errors

FORMAT, VERSION = "ankleloop estimate", 1
VARIABLE = "estimate"  # of a MATLAB file
JSON = "json"  # the diagnostics

MEMORY = 2**21  # bytes of a table that are in memory before they go to a temporary file
ROWS = 25  # estimates of a row group
TABLE: Any = {
    "compression": "zstd",
    "use_dictionary": False,
    "write_page_checksum": True,
}  # no number occurs twice
# Groups that a table holds as JSON, by their columns.
COLUMNS = {"reflex": "reflex_parameters"} | {
    name: name for name in ("stiffness", "intervals", "model", "trajectories")
}

ARRAY, COMPLEX = "$array", "$complex"  # keys that mark them


def save_estimate(
    estimate: Estimate, path: str | os.PathLike[str], *, overwrite: bool = False
) -> None:
    """Write an estimate and its model to a file, from which `load_estimate` reads the same estimate.

    docs/reference/estimates.md describes the file field by field, and how another program computes torques from it.

    Parameters
    ----------
    estimate : Estimate
        The estimate.
    path : path-like
        A file ending in .nc or .mat, in a folder that exists; it appears when it is complete.
    overwrite : bool
        Whether to replace a file of this name; without it an existing file is refused.

    Raises
    ------
    DataError
        For another suffix, if the file exists, or if it cannot be written.
    TypeError
        For diagnostics that are no numbers, texts, arrays, or lists and dictionaries of those.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop import identify, simulate
    >>> trial, other = (simulate(seed=seed, duration=20.0) for seed in (1, 2))
    >>> estimate = identify(trial, "riv")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_estimate(estimate, f"{folder}/estimate.nc")
    ...     same = load_estimate(f"{folder}/estimate.nc")
    >>> same.predict(other).torque.identical(estimate.predict(other).torque)
    True
    """
    path = check_path("save_estimate", "path", path)
    check_flag("save_estimate", "overwrite", overwrite)
    if not isinstance(estimate, Estimate):
        raise TypeError(f"save_estimate: estimate must be an Estimate, got {show_value(estimate)}.")
    warnings = " ".join(estimate.diagnostics.get("warnings", ()))
    attributes = {
        "format": FORMAT,
        "format_version": VERSION,
        "method": estimate.method,
        "warnings": warnings,
    }
    groups = {"": xr.Dataset(attrs=attributes), "torque": estimate.torque}
    groups |= {
        name: _parameter_dataset(getattr(estimate, name))
        for name in ("stiffness", "reflex", "intervals")
    }
    if estimate.predictor is not None:
        groups["model"] = model_dataset(estimate.predictor)
    if estimate.trajectories is not None:
        groups["trajectories"] = estimate.trajectories
    groups["diagnostics"] = xr.Dataset(attrs={JSON: dump_values(estimate.diagnostics)})
    write_groups(groups, path, VARIABLE, overwrite=overwrite)


def _parameter_dataset(values: Mapping[str, Any]) -> xr.Dataset:
    data = xr.Dataset(
        {
            name: (("end",)[: np.ndim(value)], np.array(value, float))
            for name, value in values.items()
        }
    )
    for name in values.keys() & QUANTITIES.keys():
        data[name].attrs = {"units": QUANTITIES[name].unit, "long_name": QUANTITIES[name].name}
    return data


def load_estimate(path: str | os.PathLike[str]) -> Estimate:
    """Read the estimate that `save_estimate` wrote, with its model.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    Estimate
        Tuples in its diagnostics have become lists.

    Raises
    ------
    DataError
        If there is no such file, it is damaged or of another origin, or a newer version of the library wrote it.

    Examples
    --------
    >>> load_estimate("nowhere.nc")
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: nowhere.nc: there is no such file: check the path.
    """
    path = check_path("load_estimate", "path", path)
    groups = read_groups(path, VARIABLE)
    with name_errors(
        path, "estimate file", "restore it from a copy, or identify again and save it"
    ):
        file = groups[""]
        if "format" not in file.values or file.text("format") != FORMAT:
            raise DataError(
                f"{file.source}: no estimate file, which has the format {FORMAT!r}: write it by save_estimate."
            )
        version = file.number("format_version")
        if version > VERSION:
            raise DataError(
                f"{file.source}: version {version:g} of the format is newer than this library: install the newest one."
            )
        return _read_estimate(groups)


def _read_estimate(groups: Mapping[str, Fields]) -> Estimate:
    """The estimate whose groups a file or a row of a table holds."""
    torque = groups["torque"]
    time, rate = torque.array("time"), torque.number("identification_rate")
    names = [*TORQUES, MEASURED] if MEASURED in torque.values else TORQUES
    torques = {name: torque.array(name, time.size, finite=False) for name in names}
    stiffness, reflex, intervals = (
        {name: group.array(name, finite=False).tolist() for name in group.values}
        for group in (
            groups["stiffness"],
            groups["reflex"],
            groups.get("intervals", Fields("", {})),
        )
    )
    return Estimate(
        method=groups[""].text("method"),
        torque=torque_dataset(time, rate, **torques),
        stiffness={name: value for name, (value,) in stiffness.items()},
        reflex={name: value for name, (value,) in reflex.items()},
        intervals={name: (low, high) for name, (low, high) in intervals.items()},
        diagnostics=load_values(groups["diagnostics"].text(JSON)),
        predictor=read_model(groups["model"]) if "model" in groups else None,
        trajectories=read_trajectories(groups["trajectories"])
        if "trajectories" in groups
        else None,
    )


class EstimateTable:
    """Estimates with their models, collected as they will be written; any number of them takes little memory.

    `precision`, "double" or "single", is that of the torques on disk, and `folder` holds the temporary file.

    >>> import tempfile
    >>> from ankleloop import identify, simulate
    >>> trial, table = simulate(seed=1, duration=10.0), EstimateTable()
    >>> table.add(identify(trial, "pr-moesp"), point="only", name="pr", number=0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table.write(f"{folder}/0.parquet")
    ...     estimates = load_estimates([f"{folder}/0.parquet"], "only", "pr")
    >>> estimates[0].predict(trial).method
    'pr-moesp'
    """

    def __init__(self, precision: str = "double", folder: PathLike | None = None) -> None:
        columns = dict.fromkeys(
            ("point", "name", "method", "diagnostics", *COLUMNS.values()), pa.string()
        )
        columns |= {
            "number": pa.int64(),
            "identification_rate": pa.float64(),
            "time": pa.list_(pa.float64()),
        }
        columns |= dict.fromkeys(TORQUES, pa.list_(pa.from_numpy_dtype(np.dtype(precision))))
        self._precision = precision
        self._schema = pa.schema(columns)
        self._rows = SpooledTemporaryFile(MEMORY, dir=None if folder is None else os.fspath(folder))  # noqa: SIM115
        weakref.finalize(self, self._rows.close)
        self._count = 0

    def add(self, estimate: Estimate, *, point: str, name: str, number: int) -> None:
        """Add the estimate of a trial, by a name of its method, at a point of a study."""
        torque, course = estimate.torque, estimate.trajectories
        row = {
            "point": point,
            "name": name,
            "number": number,
            "method": estimate.method,
            "time": torque["time"].values,
        }
        row |= torque.attrs | {
            signal: torque[signal].values.astype(self._precision) for signal in TORQUES
        }
        groups = {
            name: getattr(estimate, name)
            for name in ("stiffness", "reflex", "intervals", "diagnostics")
        }
        if estimate.predictor is not None:
            groups["model"] = dump_model(estimate.predictor)
        if course is not None:
            groups["trajectories"] = {**course.variables, **course.attrs}
        row |= {COLUMNS.get(group, group): dump_values(values) for group, values in groups.items()}
        pickle.dump(row, self._rows, pickle.HIGHEST_PROTOCOL)
        self._count += 1

    def write(self, path: PathLike, *, overwrite: bool = False) -> None:
        """Write all estimates; the file appears when it is complete."""
        self._rows.seek(0)
        with (
            atomic_file(path, overwrite=overwrite) as partial,
            open(partial, "wb") as file,
            parquet.ParquetWriter(file, self._schema, **TABLE) as writer,
        ):
            for start in range(0, self._count, ROWS):
                rows = [
                    pickle.load(self._rows) for _ in range(start, min(start + ROWS, self._count))
                ]
                writer.write_table(pa.Table.from_pylist(rows, self._schema))


def load_estimates(paths: Iterable[PathLike], point: str, name: str) -> dict[int, Estimate]:
    """Estimates by one method at one point of a study, by the number of the trial, from the tables of the study.

    They predict; tuples in their diagnostics have become lists. Trials that the method could not identify are left out.
    """
    estimates = {}
    for path in paths:
        check_readable(path)
        with name_errors(path, "estimate file", "delete it and run again"):
            filters = [("point", "==", point), ("name", "==", name)]
            table = parquet.read_table(path, filters=filters, page_checksum_verification=True)
            for row in table.to_pylist():
                source = f"{path}, row {row['number']}"
                groups = {
                    group: load_values(row[name]) for group, name in COLUMNS.items() if row[name]
                }
                groups |= {"": row, "torque": row, "diagnostics": {JSON: row["diagnostics"]}}
                fields = {group: Fields(source, values) for group, values in groups.items()}
                estimates[row["number"]] = _read_estimate(fields)
    return dict(sorted(estimates.items()))


def dump_values(values: Any) -> str:
    """Values as JSON; tuples become lists, complex numbers pairs."""
    return json.dumps(values, default=_mark)


def load_values(text: str) -> Any:
    """Values that `dump_values` wrote."""
    return json.loads(text, object_hook=_restore)


def _mark(value: Any) -> Any:
    """What takes the place of a value that JSON does not have."""
    if isinstance(value, xr.Variable):  # of a group, whose fields are read as numbers of a shape
        return value.values.tolist()
    if isinstance(value, np.ndarray):
        return {
            ARRAY: value.ravel().tolist(),
            "dtype": str(value.dtype),
            "shape": list(value.shape),
        }
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, complex):
        return {COMPLEX: [value.real, value.imag]}
    raise TypeError(f"{type(value).__name__} cannot be kept in diagnostics")


def _restore(values: dict[str, Any]) -> Any:
    if COMPLEX in values:
        return complex(*values[COMPLEX])
    if ARRAY in values:
        return np.array(values[ARRAY], dtype=values["dtype"]).reshape(values["shape"])
    return values
