"""Tables that people write, CSV or Parquet, row by row: values as they stand, or a message that names the line."""

from __future__ import annotations

import csv
import io
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import zip_longest
from pathlib import Path
from typing import Any

from ankleloop.studies.checking import NUMBER, ConfigError
from ankleloop.studies.config_files import read_text

FLAGS = {"true": True, "false": False}


def cast_number(text: str) -> Any:
    """The number that a text is; any other text as it is."""
    if not NUMBER.fullmatch(text):
        return text
    return int(text) if re.fullmatch(r"[+-]?[0-9]+", text) else float(text)


def read_points(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Place and cells of each row of a table of points: text of CSV, values of Parquet."""
    return _read_parquet(path) if path.suffix == ".parquet" else read_rows(path)


def _read_parquet(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    _check_existence(path)
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise ConfigError(f"{path}: the file cannot be read as Parquet ({str(error).splitlines()[0]}).") from None
    names = [str(name) for name in table.column_names]
    _check_columns(str(path), names)
    columns = [table.column(name).to_pylist() for name in names]
    for number, row in enumerate(zip(*columns, strict=True), start=1):
        yield f"{path}, row {number}", {name: None if v != v else v for name, v in zip(names, row, strict=True)}
    _check_rows(path, len(table))


def read_rows(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Place and cells of each row of a CSV table, as text without spaces around it; empty rows are left out."""
    _check_existence(path)
    reader = csv.reader(io.StringIO(read_text(path), newline=""), strict=True)
    keys: list[str] = []
    rows = 0
    try:
        for row in reader:
            place = f"{path}, line {reader.line_num}"
            texts = [text.strip() for text in row]
            if not any(texts):
                continue
            if not keys:
                keys = texts
                _check_columns(place, keys)
                continue
            spare = [text for key, text in zip_longest(keys, texts, fillvalue="") if text and not key]
            if spare:
                raise ConfigError(f"{place}: {spare[0]!r} is in no named column; put a text with a comma in quotes.")
            if len(texts) < len(keys):
                raise ConfigError(
                    f"{place}: the row has {len(texts)} cells of {len(keys)}; is the table cut off? Empty cells at the "
                    "end of a row need their commas, too."
                )
            rows += 1
            yield place, {key: text for key, text in zip(keys, texts, strict=False) if key}
    except csv.Error as error:
        raise ConfigError(f"{path}, line {reader.line_num}: this is not CSV: {error}.") from None
    _check_rows(path, rows)


def _check_existence(path: Path) -> None:
    if not os.path.exists(path):
        raise ConfigError(f"there is no table {os.path.abspath(path)}.")


def _check_rows(path: Path, rows: int) -> None:
    if not rows:
        raise ConfigError(f"the table {path} has no rows.")


def _check_columns(place: str, keys: Iterable[str]) -> None:
    """Refuse columns of one name, and other signs than commas between them."""
    for name, sign in (("semicolons", ";"), ("tabulators", "\t")):
        if sign in "".join(keys):
            raise ConfigError(f"{place}: the columns are separated by {name}: save the table with commas between them.")
    for key, count in Counter(keys).items():
        if key and count > 1:
            raise ConfigError(f"{place}: {count} columns are called {key!r}.")
