"""Files of estimates with their models: one in NetCDF or MATLAB v5, those of a study in a Parquet table."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import pyarrow as pa
import xarray as xr
from pyarrow import parquet

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.models import dump_model, model_dataset, read_model
from ankleloop.joint.regressors import MEASURED, TORQUES, number_trials, torque_dataset
from ankleloop.joint.time_varying_course import read_trajectories
from ankleloop.options import check_flag, check_path, show_value
from ankleloop.quantities import QUANTITIES
from ankleloop.trials.contents import as_text
from ankleloop.trials.files import PathLike, atomic_file, check_readable
from ankleloop.trials.group_files import Fields, read_groups, write_groups
from ankleloop.trials.reading_process import name_errors

FORMAT = "ankleloop estimate"
VERSION = 1
MATLAB_VARIABLE = "estimate"
PARAMETER_GROUPS = ("stiffness", "reflex", "intervals")
DIAGNOSTICS_TEXT = "json"  # field that holds the diagnostics

ROW_GROUP = 25  # estimates
PARQUET_OPTIONS: Any = {
    "compression": "zstd",
    "use_dictionary": False,  # no number occurs twice
    "write_page_checksum": True,
}

# Keys of a JSON object that stands for one of these.
ARRAY_KEY = "$array"
COMPLEX_KEY = "$complex"


def save_estimate(estimate: Estimate, path: PathLike, *, overwrite: bool = False) -> None:
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

    See Also
    --------
    ankleloop.load_estimate : Reads the file.

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
    attributes = {
        "format": FORMAT,
        "format_version": VERSION,
        "method": estimate.method,
        "warnings": " ".join(estimate.diagnostics.get("warnings", ())),
    }
    groups = {"": xr.Dataset(attrs=attributes), "torque": estimate.torque}
    for name in PARAMETER_GROUPS:
        groups[name] = _parameter_dataset(getattr(estimate, name))
    if estimate.predictor is not None:
        groups["model"] = model_dataset(estimate.predictor)
    if estimate.trajectories is not None:
        groups["trajectories"] = estimate.trajectories
    diagnostics = dump_values(estimate.diagnostics)
    groups["diagnostics"] = xr.Dataset(attrs={DIAGNOSTICS_TEXT: diagnostics})
    write_groups(groups, path, MATLAB_VARIABLE, overwrite=overwrite)


def _parameter_dataset(values: Mapping[str, Any]) -> xr.Dataset:
    """Numbers, or pairs of numbers, with their units and names."""
    variables = {}
    for name, value in values.items():
        dimensions = ("end",) if np.ndim(value) else ()
        attributes = {"units": QUANTITIES[name].unit, "long_name": QUANTITIES[name].name}
        variables[name] = (dimensions, np.array(value, float), attributes)
    return xr.Dataset(variables)


def load_estimate(path: PathLike) -> Estimate:
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

    See Also
    --------
    ankleloop.save_estimate : Writes the file.

    Examples
    --------
    >>> load_estimate("nowhere.nc")
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: nowhere.nc: there is no such file: check the path.
    """
    path = check_path("load_estimate", "path", path)
    groups = read_groups(path, MATLAB_VARIABLE)
    with name_errors(
        path, "estimate file", "restore it from a copy, or identify again and save it"
    ):
        file = groups[""]
        if as_text(file.values.get("format")) != FORMAT:
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
    time = torque.array("time")
    names = [*TORQUES, MEASURED] if MEASURED in torque.values else TORQUES
    torques = {name: torque.array(name, time.size, finite=False) for name in names}
    dataset = torque_dataset(time, torque.number("identification_rate"), **torques)
    if "trial" in torque.values:
        dataset = number_trials(dataset, torque.array("trial", time.size).astype(int))
    trajectories = groups.get("trajectories")
    return Estimate(
        method=groups[""].text("method"),
        torque=dataset,
        stiffness=_read_numbers(groups["stiffness"]),
        reflex=_read_numbers(groups["reflex"]),
        intervals=_read_intervals(groups.get("intervals", Fields("", {}))),
        diagnostics=load_values(groups["diagnostics"].text(DIAGNOSTICS_TEXT)),
        predictor=read_model(groups["model"]) if "model" in groups else None,
        trajectories=read_trajectories(trajectories) if trajectories else None,
    )


def _read_numbers(fields: Fields) -> dict[str, float]:
    """Numbers by name; one may be nan."""
    return {name: fields.array(name, 1, finite=False).item() for name in fields.values}


def _read_intervals(fields: Fields) -> dict[str, tuple[float, float]]:
    """Ends of intervals by name."""
    ends = {name: fields.array(name, 2, finite=False).tolist() for name in fields.values}
    return {name: (low, high) for name, (low, high) in ends.items()}


class EstimateTable:
    """Estimates with their models, written in groups as they come."""

    def __init__(self, writer: parquet.ParquetWriter, precision: str) -> None:
        self._writer = writer
        self._precision = precision
        self._rows: list[dict[str, Any]] = []  # that wait for a whole group

    def add(self, estimate: Estimate, *, point: str, name: str, number: int) -> None:
        """Add the estimate of a trial, by a name of its method, at a point of a study."""
        groups = {group: getattr(estimate, group) for group in PARAMETER_GROUPS}
        if estimate.predictor is not None:
            groups["model"] = dump_model(estimate.predictor)
        course = estimate.trajectories
        if course is not None:
            groups["trajectories"] = {**course.variables, **course.attrs}
        torque = estimate.torque
        row = {
            "point": point,
            "name": name,
            "number": number,
            "method": estimate.method,
            "time": torque["time"].values,
            "diagnostics": dump_values(estimate.diagnostics),
            "groups": dump_values(groups),  # parameters, intervals, model and trajectories
            **torque.attrs,
        }
        for signal in TORQUES:
            row[signal] = torque[signal].values.astype(self._precision)
        self._rows.append(row)
        if len(self._rows) == ROW_GROUP:
            self.write_group()

    def write_group(self) -> None:
        """Write the estimates that wait."""
        self._writer.write_table(pa.Table.from_pylist(self._rows, self._writer.schema))
        self._rows.clear()


@contextmanager
def write_estimates(
    path: PathLike, precision: str = "double", *, overwrite: bool = False
) -> Iterator[EstimateTable]:
    """Provide a table for estimates; its file appears if the block ends without an error.

    `precision`, "double" or "single", is that of the torques.

    >>> import tempfile
    >>> from ankleloop import identify, simulate
    >>> trial = simulate(seed=1, duration=10.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with write_estimates(f"{folder}/0.parquet") as table:
    ...         table.add(identify(trial, "pr-moesp"), point="only", name="pr", number=0)
    ...     estimates = load_estimates([f"{folder}/0.parquet"], "only", "pr")
    >>> estimates[0].predict(trial).method
    'pr-moesp'
    """
    columns = dict.fromkeys(("point", "name", "method", "diagnostics", "groups"), pa.string())
    columns |= {
        "number": pa.int64(),
        "identification_rate": pa.float64(),
        "time": pa.list_(pa.float64()),
    }
    columns |= dict.fromkeys(TORQUES, pa.list_(pa.from_numpy_dtype(precision)))
    with (
        atomic_file(path, overwrite=overwrite) as partial,
        open(partial, "wb") as file,
        parquet.ParquetWriter(file, pa.schema(columns), **PARQUET_OPTIONS) as writer,
    ):
        table = EstimateTable(writer, precision)
        yield table
        table.write_group()


def load_estimates(paths: Iterable[PathLike], point: str, name: str) -> dict[int, Estimate]:
    """Estimates by one method at one point of a study, by the number of the trial, from the tables of the study.

    They predict; tuples in their diagnostics have become lists. Trials that the method could not identify are left out.
    """
    filters = [("point", "==", point), ("name", "==", name)]
    estimates = {}
    for path in paths:
        check_readable(path)
        with name_errors(path, "estimate file", "delete it and run again"):
            table = parquet.read_table(path, filters=filters, page_checksum_verification=True)
            for row in table.to_pylist():
                number = row["number"]
                groups = {
                    "": row,
                    "torque": row,
                    "diagnostics": {DIAGNOSTICS_TEXT: row["diagnostics"]},
                    **load_values(row["groups"]),
                }
                source = f"{path}, row {number}"
                fields = {name: Fields(source, values) for name, values in groups.items()}
                estimates[number] = _read_estimate(fields)
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
            ARRAY_KEY: value.ravel().tolist(),
            "dtype": str(value.dtype),
            "shape": list(value.shape),
        }
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, complex):
        return {COMPLEX_KEY: [value.real, value.imag]}
    raise TypeError(f"{type(value).__name__} cannot be kept in diagnostics")


def _restore(values: dict[str, Any]) -> Any:
    """The value that an object stands for; another object as it is."""
    if COMPLEX_KEY in values:
        return complex(*values[COMPLEX_KEY])
    if ARRAY_KEY in values:
        return np.array(values[ARRAY_KEY], dtype=values["dtype"]).reshape(values["shape"])
    return values
