"""Tables that list the points of a study, a row each: CSV or Parquet."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ankleloop.options import Options, option
from ankleloop.studies.checking import ConfigError
from ankleloop.studies.point_parameters import Parameter
from ankleloop.studies.table_rows import NUMBER, check_columns, read_rows

FLAGS = {"true": True, "false": False}

Find = Callable[[list[str]], Mapping[str, Parameter]]


class PointTable(Options):
    """A table of points."""

    table: str = option(
        description="CSV or Parquet file (.parquet) with a row for each point and a column for each parameter",
        min_length=1,
    )


def read_points(path: Path, find: Find) -> Iterator[tuple[str, dict[str, Any]]]:
    """Read a table of points."""
    if not os.path.exists(path):
        raise ConfigError(f"there is no table {os.path.abspath(path)}.")
    rows = _parquet_rows(path, find) if path.suffix == ".parquet" else _csv_rows(path, find)
    empty = True
    for place, values in rows:
        empty = False
        yield place, values
    if empty:
        raise ConfigError(f"the table {path} has no rows.")


def _csv_rows(path: Path, find: Find) -> Iterator[tuple[str, dict[str, Any]]]:
    parameters: Mapping[str, Parameter] = {}
    readers: dict[str, Callable[[str], Any]] = {}
    for line, cells in read_rows(path, empty_cells=True):
        place = f"{path}, line {line}"
        if not parameters:
            parameters = _find(find, list(cells), str(path))
            readers = {name: _cell_reader(parameter) for name, parameter in parameters.items()}
        for name, text in cells.items():
            if not text:
                raise ConfigError(
                    f"{place}: the cell of the column {name!r} is empty: every point has a value of each parameter; "
                    "write null for the value null."
                )
        yield place, {name: readers[name](text) for name, text in cells.items()}


def _parquet_rows(path: Path, find: Find) -> Iterator[tuple[str, dict[str, Any]]]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise ConfigError(f"{path}: the file cannot be read as Parquet ({str(error).splitlines()[0]}).") from None
    names = [str(name) for name in table.column_names]
    check_columns(str(path), names)
    parameters = _find(find, names, str(path))
    columns = [table.column(name).to_pylist() for name in names]
    for number, row in enumerate(zip(*columns, strict=True), start=1):
        values = dict(zip(names, row, strict=True))
        place = f"{path}, row {number}"
        for name, value in values.items():
            if (value is None or value != value) and not parameters[name].allows_none:
                raise ConfigError(f"{place}, column {name}: there is no value, and it may not be null.")
        yield place, {name: None if value != value else value for name, value in values.items()}


def _find(find: Find, names: list[str], place: str) -> Mapping[str, Parameter]:
    try:
        return find(names)
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}", error.keys) from None


def _cell_reader(parameter: Parameter) -> Callable[[str], Any]:
    """Function from a cell to a value of the type of its column; what is none stays text, which the model refuses."""

    def read(text: str) -> Any:
        if text == "null" and parameter.allows_none:
            return None
        if bool in parameter.types and text.lower() in FLAGS:
            return FLAGS[text.lower()]
        if parameter.is_number and re.fullmatch(NUMBER, text):
            return int(text) if re.fullmatch(r"[+-]?[0-9]+", text) else float(text)
        return text

    return read
