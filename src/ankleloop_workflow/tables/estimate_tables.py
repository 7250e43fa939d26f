"""Estimates of a study with their models, in Parquet tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import (
    DIAGNOSTICS_TEXT,
    PARAMETER_GROUPS,
    dump_values,
    load_values,
    read_estimate,
)
from ankleloop.joint.models import dump_model
from ankleloop.joint.regressors import TORQUES
from ankleloop.trials.files import PathLike, atomic_file, check_readable
from ankleloop.trials.group_files import Fields
from ankleloop.trials.readable_files import name_errors

ROW_GROUP = 25  # estimates
PARQUET_OPTIONS: Any = {
    "compression": "zstd",
    "use_dictionary": False,  # no number occurs twice
    "write_page_checksum": True,
}


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
                estimates[number] = read_estimate(fields)
    return dict(sorted(estimates.items()))
