"""The table of the trials of a study: a row for each point, method and trial, in one Parquet file."""

from __future__ import annotations

import csv
import itertools
import os
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import csv as arrow_csv
from pyarrow import parquet

from ankleloop.errors import DataError
from ankleloop.paper.completeness import check_scores
from ankleloop.paper.results import KEYS
from ankleloop.paper.trial_columns import (
    Kind,
    column_kind,
    describe_column,
    order_columns,
    score_columns,
    value_kind,
)
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.trials.files import atomic_file, check_readable
from ankleloop.trials.reading_process import name_errors

PathLike = str | os.PathLike[str]

GROUP_ROWS = 20_000  # that are written at a time
SCORE = ["torque", "against"]
TYPES = {"number": pa.float64(), "count": pa.int64(), "flag": pa.bool_(), "text": pa.string()}
STORED = {**TYPES, "text": pa.dictionary(pa.int32(), pa.string())}
REMEDY = "delete it, and run again: it is made anew"


def write_trial_table(
    path: PathLike,
    parameters: Sequence[PathLike],
    scores: Sequence[PathLike],
    varied: Sequence[str] = (),
    *,
    text: PathLike | None = None,
    points: int | None = None,
    methods: Collection[str] | None = None,
    trials: int | None = None,
) -> None:
    r"""Write the table of the trials of a study, chunk by chunk; memory does not grow with the study.

    The rows do not depend on how the trials are divided into chunks, and their order only where the points of one
    condition are divided, which are more than a job takes.
    """
    kinds, pairs = _scan(parameters, scores, varied)
    names = order_columns(kinds, varied, pairs)
    kinds = {name: kinds.get(name) or column_kind(name) for name in names}
    counts = _Counts()
    chunks = _join_chunks(parameters, scores, kinds, names, counts)
    with ExitStack() as stack:
        partial = stack.enter_context(atomic_file(path, overwrite=True))
        rows = None if text is None else stack.enter_context(atomic_file(text, overwrite=True))
        _write(partial, rows, _group_rows(chunks), _schema(kinds, varied))
        counts.check(parameters, points, methods, trials)


def read_trial_table(path: PathLike, columns: Sequence[str] | None = None) -> pd.DataFrame:
    """Read the table of the trials of a study.

    Parameters
    ----------
    path : path-like
        Parquet file of `write_trial_table`.
    columns : sequence of str, optional
        Columns to read; by default all of them.

    Returns
    -------
    pandas.DataFrame
        A row for each point, method and trial, ordered by condition (points that share their trials), trial, point and
        method. Text is categorical; counts that some rows lack are floating-point numbers.

    Raises
    ------
    DataError
        If there is no such file, it is damaged, or it has no such column.

    Examples
    --------
    >>> read_trial_table("nowhere.parquet")
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: nowhere.parquet: there is no such file: check the path.
    """
    known = trial_table_columns(path)
    for name in columns or ():
        if name not in known:
            raise DataError(f"{path}: there is no column {name!r}; there are {', '.join(known)}.")
    with _readable(path, "table of trials"):
        table = parquet.read_table(
            path, columns=None if columns is None else list(columns), page_checksum_verification=True, use_threads=False
        )
        return table.to_pandas(use_threads=False)


def trial_table_columns(path: PathLike) -> list[str]:
    """Columns of the table of the trials of a study."""
    with _readable(path, "table of trials"):
        return list(parquet.read_schema(path).names)


@contextmanager
def _readable(path: PathLike, kind: str) -> Iterator[None]:
    """Say in plain words what is wrong with a table that is read in the block."""
    check_readable(path)
    with name_errors(path, kind, REMEDY):
        yield


def _scan(
    parameters: Sequence[PathLike], scores: Sequence[PathLike], varied: Sequence[str]
) -> tuple[dict[str, Kind], set[tuple[str, str]]]:
    """Kinds of all columns of the parameters, and torques that were scored with what they were scored against."""
    names: dict[str, None] = {}
    values: dict[str, set[str]] = {name: set() for name in varied}
    pairs: set[tuple[str, str]] = set()
    for path in parameters:
        header = _read_header(path)
        names |= dict.fromkeys(header)
        present = [name for name in varied if name in header]
        if present:
            table = _read_csv(path, dict.fromkeys(present, "text"), present)
            for name in present:
                values[name] |= {value or "" for value in table[name].unique().to_pylist()}
    for path in scores:
        table = _read_csv(path, dict.fromkeys(SCORE, "text"), SCORE)
        pairs |= set(zip(*(table[name].to_pylist() for name in SCORE), strict=True))
    kinds = {name: value_kind(values[name]) if name in values else column_kind(name) for name in names}
    return kinds, pairs


def _read_header(path: PathLike) -> list[str]:
    with _readable(path, "table"), open(path, newline="", encoding="utf-8") as file:
        return next(csv.reader(file))


def _read_csv(path: PathLike, kinds: Mapping[str, Kind], columns: Sequence[str] = ()) -> pa.Table:
    """Columns of a table of a chunk, by default all of them, each of its kind; numbers with all of their digits."""
    with _readable(path, "table"):
        with open(path, "rb") as file:
            file.seek(-1, os.SEEK_END)
            if file.read() != b"\n":
                raise DataError(f"{path}: the table is damaged (it has no end): {REMEDY}.")
        return arrow_csv.read_csv(
            path,
            read_options=arrow_csv.ReadOptions(use_threads=False),
            parse_options=arrow_csv.ParseOptions(newlines_in_values=True),
            convert_options=arrow_csv.ConvertOptions(
                column_types={name: TYPES[kind] for name, kind in kinds.items()},
                include_columns=list(columns),
                null_values=[""],
                strings_can_be_null=True,
                true_values=["True"],
                false_values=["False"],
            ),
        )


def _join_chunks(
    parameters: Sequence[PathLike],
    scores: Sequence[PathLike],
    kinds: Mapping[str, Kind],
    names: Sequence[str],
    counts: _Counts,
) -> Iterator[pa.Table]:
    """Rows of each chunk with all columns."""
    for path, other in zip(parameters, scores, strict=True):
        table = _read_csv(path, {name: kinds[name] for name in _read_header(path)})
        keys = table.select([name for name in (*KEYS, "failure") if name in table.column_names]).to_pandas()
        values = _read_csv(other, {name: column_kind(name) for name in (*KEYS, *SCORE, "vaf", "low", "high")})
        table = _add_scores(table, keys, values.to_pandas(), other)
        counts.add(keys)
        for name in names:
            if name not in table.column_names:
                table = table.append_column(name, pa.nulls(len(table), TYPES[kinds[name]]))
        yield _order_rows(table.select(list(names)))


def _order_rows(table: pa.Table) -> pa.Table:
    """Rows of a chunk by condition and trial, so that all rows of a study have an order that no chunks change."""
    varied = table.column_names[2 : table.column_names.index("method")]  # behind study and point
    settings = [table[name].to_pylist() for name in varied if name in SimulationSettings.model_fields]
    rows = zip(*settings, strict=True) if settings else [()] * len(table)
    ranks: dict[tuple[Any, ...], int] = {}
    conditions = [ranks.setdefault(values, len(ranks)) for values in rows]
    return table.take(np.lexsort((table["trial"].to_numpy(), conditions)))


def _add_scores(table: pa.Table, keys: pd.DataFrame, scores: pd.DataFrame, path: PathLike) -> pa.Table:
    """A table of parameters with the scores of each estimate beside it."""
    check_scores(path, scores, keys)
    for pair, part in scores.groupby(SCORE, sort=False):
        if part.duplicated(KEYS).any():
            raise DataError(f"{path}: the table is damaged (a score is there twice): {REMEDY}.")
        joined = keys[KEYS].merge(part, how="left", on=KEYS)
        for name, column in zip(score_columns(*pair), ("vaf", "low", "high"), strict=True):
            table = table.append_column(name, pa.array(joined[column].to_numpy(float), from_pandas=True))
    return table


def _group_rows(tables: Iterator[pa.Table]) -> Iterator[pa.Table]:
    """The same rows in groups of equal size, which do not depend on the chunks."""
    waiting: list[pa.Table] = []
    for table in tables:
        waiting.append(table)
        if sum(map(len, waiting)) >= GROUP_ROWS:
            rows = pa.concat_tables(waiting)
            complete = len(rows) // GROUP_ROWS * GROUP_ROWS
            for start in range(0, complete, GROUP_ROWS):
                yield rows.slice(start, GROUP_ROWS)
            waiting = [rows.slice(complete)]
    if waiting and sum(map(len, waiting)):
        yield pa.concat_tables(waiting)


def _schema(kinds: Mapping[str, Kind], varied: Sequence[str]) -> pa.Schema:
    return pa.schema(
        [pa.field(name, STORED[kind], metadata=dict(describe_column(name, varied))) for name, kind in kinds.items()]
    )


def _write(path: PathLike, text: PathLike | None, tables: Iterator[pa.Table], schema: pa.Schema) -> None:
    with ExitStack() as stack:
        writer = stack.enter_context(parquet.ParquetWriter(path, schema, compression="zstd", write_page_checksum=True))
        rows = None
        if text is not None:
            file = stack.enter_context(open(text, "w", newline="", encoding="utf-8"))
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(schema.names)
        for table in tables:
            writer.write_table(table.combine_chunks().cast(schema))  # whole columns: the same bytes for any chunks
            if rows is not None:
                rows.writerows([_as_text(value) for value in row.values()] for row in table.to_pylist())


def _as_text(value: Any) -> str:
    return "" if value is None or value != value else str(value)


class _Counts:
    """Rows of each point and method, and how many of them are failures."""

    def __init__(self) -> None:
        self._rows: Counter[tuple[str, str]] = Counter()
        self._failures = 0
        self._reason = ""

    def add(self, keys: pd.DataFrame) -> None:
        """Count the rows of a chunk."""
        self._rows.update(zip(keys["point"], keys["method"], strict=True))
        if "failure" in keys:
            reasons = keys["failure"].dropna().tolist()
            self._failures += len(reasons)
            self._reason = self._reason or next(iter(reasons), "")

    def check(
        self, files: Sequence[PathLike], points: int | None, methods: Collection[str] | None, trials: int | None
    ) -> None:
        """Refuse tables in which a trial of a method has no row, or more than one, and those without any estimate."""
        place = " … ".join(dict.fromkeys([str(files[0]), str(files[-1])]))
        remedy = "delete these files, and run again: they are made anew"
        known = dict.fromkeys(point for point, _ in self._rows)
        if points is not None and len(known) != points:
            raise DataError(f"{place}: there are {len(known)} of {points} points: {remedy}.")
        expected = trials or max(self._rows.values(), default=0)
        for pair in itertools.product(known, methods or dict.fromkeys(method for _, method in self._rows)):
            count = self._rows[pair]
            if count != expected:
                point, method = pair
                raise DataError(f"{place}: point {point}, method {method} has {count} of {expected} trials: {remedy}.")
        if self._failures and self._failures == self._rows.total():
            raise DataError(f"no trial of the study could be identified by any method: {self._reason}")
