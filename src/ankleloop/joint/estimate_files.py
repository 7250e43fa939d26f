"""Estimate files: estimates of many trials by all methods of a study in one Parquet table, a row for each."""

from __future__ import annotations

import os
import pickle
import weakref
from collections.abc import Iterable, Mapping
from tempfile import SpooledTemporaryFile
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.model_files import dump_values, load_values
from ankleloop.joint.models import model_from_fields
from ankleloop.joint.regressors import TORQUES, torque_dataset
from ankleloop.joint.time_varying_course import read_trajectories
from ankleloop.trials.files import atomic_file, check_readable, parse_precision
from ankleloop.trials.group_files import Fields
from ankleloop.trials.readable_files import name_errors

PathLike = str | os.PathLike[str]
MEMORY = 2**21  # bytes of a table that are in memory before they go to a temporary file
ROWS = 25  # estimates of a row group
TEXTS = ("stiffness", "reflex_parameters", "intervals", "diagnostics", "model", "trajectories")  # as JSON


class EstimateTable:
    """Estimates with their models, collected as they will be written; any number of them takes little memory.

    Parameters
    ----------
    precision : {"double", "single"}
        Floating-point numbers of the torques on disk.
    folder : path-like, optional
        Folder of the temporary file; by default that of the system.

    Raises
    ------
    ValueError
        For an unknown precision.

    Examples
    --------
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
        torque = pa.list_(pa.from_numpy_dtype(np.dtype(parse_precision(precision))))
        texts = ("point", "name", "method", *TEXTS)
        self._schema = pa.schema(
            {
                **{text: pa.string() for text in texts},
                "number": pa.int64(),
                "identification_rate": pa.float64(),
                "time": pa.list_(pa.float64()),
                **dict.fromkeys(TORQUES, torque),
            }
        )
        self._rows = SpooledTemporaryFile(MEMORY, dir=None if folder is None else os.fspath(folder))  # noqa: SIM115
        weakref.finalize(self, self._rows.close)
        self._count = 0

    def add(self, estimate: Estimate, *, point: str, name: str, number: int) -> None:
        """Add the estimate of a trial, by a name of its method, at a point of a study."""
        model, torque = estimate.predictor, estimate.torque
        values = {
            "stiffness": estimate.stiffness,
            "reflex_parameters": estimate.reflex,
            "intervals": estimate.intervals,
            "diagnostics": estimate.diagnostics,
            "model": None if model is None else {"kind": model.kind, **model.fields()},
            "trajectories": _describe_trajectories(estimate),
        }
        row = {"point": point, "name": name, "method": estimate.method, "number": number, **torque.attrs}
        signals = {signal: torque.variables[signal].values for signal in ("time", *TORQUES)}
        row |= {**signals, **{text: dump_values(value) for text, value in values.items()}}
        pickle.dump(row, self._rows, pickle.HIGHEST_PROTOCOL)
        self._count += 1

    def write(self, path: PathLike, *, overwrite: bool = False) -> None:
        """Write all estimates; the file appears when it is complete."""
        self._rows.seek(0)
        with (
            atomic_file(path, overwrite=overwrite) as partial,
            open(partial, "wb") as file,
            parquet.ParquetWriter(file, self._schema, compression="zstd", write_page_checksum=True) as writer,
        ):
            for start in range(0, self._count, ROWS):
                rows = [pickle.load(self._rows) for _ in range(start, min(start + ROWS, self._count))]
                writer.write_table(pa.Table.from_pylist(rows, self._schema))


def _describe_trajectories(estimate: Estimate) -> dict[str, Any] | None:
    """Trajectories by name with their coordinate and attributes; None for a method that has none."""
    if estimate.trajectories is None:
        return None
    curves = {str(name): variable.values for name, variable in estimate.trajectories.variables.items()}
    return {**curves, **estimate.trajectories.attrs}


def load_estimates(paths: Iterable[PathLike], point: str, name: str) -> dict[int, Estimate]:
    """Read the estimates by one method at one point of a study, by the number of the trial.

    Parameters
    ----------
    paths : iterable of path-like
        Estimate files of the study.
    point : str
        Point of the study.
    name : str
        Name of the method in the study.

    Returns
    -------
    dict of int to Estimate
        In the order of the trials, with their models, so that they predict; without the trials that the method could
        not identify. Tuples in their diagnostics have become lists.

    Raises
    ------
    DataError
        If there is no such file, or one is damaged.
    """
    estimates = {}
    for path in paths:
        check_readable(path)
        with name_errors(path, "estimate file", "delete it and run again; it is made anew"):
            filters = [("point", "==", point), ("name", "==", name)]
            table = parquet.read_table(path, filters=filters, page_checksum_verification=True)
            for row in table.to_pylist():
                estimates[row["number"]] = _read_estimate(row, f"{path}, row {row['number']}")
    return dict(sorted(estimates.items()))


def _read_estimate(row: Mapping[str, Any], source: str) -> Estimate:
    values = {name: load_values(row[name], source) for name in TEXTS}
    model = None if values["model"] is None else model_from_fields(Fields(source, values["model"]))
    curves = values["trajectories"]
    torques = {name: np.array(row[name], dtype=float) for name in TORQUES}
    return Estimate(
        method=row["method"],
        torque=torque_dataset(np.array(row["time"]), row["identification_rate"], **torques),
        matrices=None if model is None else model.matrices,
        stiffness=values["stiffness"],
        reflex=values["reflex_parameters"],
        intervals={name: tuple(ends) for name, ends in values["intervals"].items()},
        diagnostics=values["diagnostics"],
        predictor=model,
        trajectories=None if curves is None else read_trajectories(Fields(source, curves)),
    )
