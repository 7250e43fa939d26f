"""The table of the trials of a study: a row for each point, method and trial, in one Parquet file.

The job of a chunk writes its rows with their types; the table of the study is those of all chunks, one below the other.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import pandas as pd
import pyarrow as pa
from pyarrow import dataset, parquet

from ankleloop.errors import DataError
from ankleloop.joint.regressors import TORQUES
from ankleloop.methods.registry import METHODS
from ankleloop.quantities import POINT, QUANTITIES
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.trials.files import PathLike, atomic_file, check_readable, write_csv
from ankleloop.trials.readable_files import name_errors
from ankleloop_workflow.tables.captions import label_axis
from ankleloop_workflow.tables.outcomes import Labels
from ankleloop_workflow.tables.versions import read_versions

REMEDY = "delete it, and run again"
FAULT_COLUMNS = ("failure", "warnings")  # the last ones
TEXT_COLUMNS = ("study", "point", "method", "reference", "intervals", *FAULT_COLUMNS)
# Of columns that hold no floating-point numbers.
COLUMN_TYPES = {
    **dict.fromkeys(TEXT_COLUMNS, pa.string()),
    **dict.fromkeys(("trial", "order", "passes", "cycles"), pa.int64()),
    **dict.fromkeys(("converged", "stable"), pa.bool_()),
}
VERSIONS = b"ankleloop.versions"  # in the metadata of a table
ENDS = ("_low", "_high")  # of the 95 % interval of a quantity


def as_table(rows: Sequence[Mapping[str, Any]], types: Mapping[str, pa.DataType]) -> pa.Table:
    """Rows as a table whose columns have types that no row decides; nan and empty texts are no values.

    `types` are those of the columns with the values of a point.
    """
    columns = {}
    known_types = {**COLUMN_TYPES, **types}
    for name in dict.fromkeys([*(name for row in rows for name in row), *FAULT_COLUMNS]):
        values = [None if row.get(name) == "" else row.get(name) for row in rows]
        columns[name] = pa.array(values, known_types.get(name, pa.float64()), from_pandas=True)
    return pa.table(columns)


def save_table(table: pa.Table, path: PathLike, sources: Sequence[PathLike] = ()) -> None:
    """Write the table of a job with the versions of the packages that compute, or those of the tables that it joins."""
    versions = list_versions(sources) if sources else [read_versions()]
    metadata = {**(table.schema.metadata or {}), VERSIONS: json.dumps(versions)}
    table = table.replace_schema_metadata(metadata)
    with atomic_file(path, overwrite=True) as partial:
        parquet.write_table(table, partial, compression="zstd", write_page_checksum=True)


def list_versions(paths: Iterable[PathLike]) -> list[dict[str, str]]:
    """Versions of the packages that made some tables, each set of them once."""
    made = []
    for path in paths:
        metadata = _read_schema(path).metadata or {}
        made += [versions for versions in json.loads(metadata[VERSIONS]) if versions not in made]
    return made


def join_tables(path: PathLike, text: PathLike, chunks: Sequence[PathLike], *, rows: int) -> None:
    """Join the tables of all chunks, and write them as Parquet and as text.

    Neither rows nor their order depend on how the trials are divided into chunks.
    """
    schema = pa.unify_schemas(list(map(_read_schema, chunks)))
    schema = pa.schema([schema.field(name) for name in _order_columns(schema.names)])
    files = dataset.dataset([os.fspath(chunk) for chunk in chunks], schema=schema)
    table = files.to_table(use_threads=False)
    if len(table) != rows:
        raise DataError(
            f"{chunks[0]} …: they have {len(table)} of {rows} rows: delete them, and run again."
        )
    reasons = set(table["failure"].unique().to_pylist())
    if None not in reasons:
        raise DataError(f"no trial of the study could be identified by any method: {min(reasons)}")
    save_table(table, path, sources=chunks)
    write_csv(table.to_pandas(integer_object_nulls=True), text, overwrite=True)


def read_trial_table(path: PathLike) -> pd.DataFrame:
    """Read the table of the trials of a study.

    Parameters
    ----------
    path : path-like
        Parquet file, `results/tables/STUDY-trials.parquet`.

    Returns
    -------
    pandas.DataFrame
        A row for each point, method and trial, ordered by condition (points that share their trials), trial, point and
        method. Text is categorical; counts that some rows lack are floating-point numbers.

    Raises
    ------
    DataError
        If there is no such file, or it is damaged.

    Examples
    --------
    >>> read_trial_table("nowhere.parquet")
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: nowhere.parquet: there is no such file: check the path.
    """
    schema = _read_schema(path)
    texts = [field.name for field in schema if pa.types.is_string(field.type)]
    with name_errors(path, "table of trials", REMEDY):
        table = parquet.read_table(
            path,
            read_dictionary=texts,
            page_checksum_verification=True,
            use_threads=False,
        )
        return table.to_pandas(use_threads=False)


def read_results(path: PathLike) -> pd.DataFrame:
    """Trials of a study without the intervals of their VAF, by point, method and trial."""
    table = read_trial_table(path)
    table = table.sort_values(
        ["point", "method", "trial"],
        key=lambda column: pd.factorize(column)[0],  # in the order of their first appearance
        ignore_index=True,
    )
    table = table.astype(dict.fromkeys(table.select_dtypes("category").columns, object))
    return table.drop(columns=table.filter(regex="^vaf_.*_(low|high)$").columns)


def _read_schema(path: PathLike) -> pa.Schema:
    """Columns of a table with their types."""
    check_readable(path)
    with name_errors(path, "table of trials", REMEDY):
        return parquet.read_schema(path)


def _order_columns(names: Collection[str]) -> list[str]:
    """Keys, scores, parameters and diagnostics, faults."""
    varied = [name for name in names if name.startswith(POINT)]
    first = ["study", "point", *varied, "method", "trial"]
    quantities = [name + end for name in QUANTITIES for end in ("", *ENDS)]
    scores = [name for name in quantities if name.startswith("vaf_")]
    present = set(names) - set(FAULT_COLUMNS)
    others = sorted(present - {*first, *quantities})
    order = dict.fromkeys([*first, *scores, *quantities, *others])
    return [*(name for name in order if name in present), *FAULT_COLUMNS]


def default_quantities(columns: Collection[str]) -> list[str]:
    """Quantities that are shown where the configuration names none: against the true torques where there are any."""
    against = "true" if "vaf_net_true" in columns else "measured"
    names = [*(f"vaf_{torque}_{against}" for torque in TORQUES), "K_error", "G_error"]
    return [name for name in names if name.removesuffix("_error") in columns]


def label_parameter(name: str, labels: Labels) -> str:
    """Name and unit of a varied setting of the simulation, or option of a method."""
    if name in SimulationSettings.model_fields:
        return label_axis(name)
    method, _, field = name.rpartition(".")
    words = field.replace("_", " ")
    if method:
        words += f" of {labels.get(method, method)}"
    kinds = [entry.options for entry in METHODS.values()]
    units = (options.unit(field) for options in kinds if field in options.model_fields)
    return f"{words} [{next(units, '1')}]"
