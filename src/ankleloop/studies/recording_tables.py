"""Tables that people write: rows of points, CSV or Parquet, and recordings; a message names the line."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any, get_args

from ankleloop.options import option, show_value
from ankleloop.studies.checking import NUMBER, ConfigError, check, check_cases
from ankleloop.studies.config_files import read_text
from ankleloop.studies.recording_settings import Recording

MAX_NAME = 100  # characters: names are parts of the names of files, which have at most 255 bytes
RECORDING_NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"


class _Row(Recording):
    """A row of a table of recordings: a recording, or one of the trials that are merged into one."""

    name: str | None = option(None, "name of the recording; without one, subject, condition and trial make it")
    batch: str | None = option(None, "name that rows share whose trials are merged")

    @property
    def recording_name(self) -> str:
        """Name of the recording to which the row belongs."""
        parts = [part for part in (self.subject, self.condition, self.trial) if part]
        return self.batch or self.name or "-".join(parts) or Path(self.file).name


def read_recordings(path: str | os.PathLike[str], defaults: Mapping[str, Any]) -> dict[str, list[Recording]]:
    """Read a table of recordings."""
    recordings: dict[str, list[Recording]] = {}
    batches: set[str | None] = set()
    for place, cells in read_rows(Path(path)):
        values = {key: _cast_recording(key, text) for key, text in cells.items() if text}
        row = check(_Row, {**defaults, **values}, place)
        name = row.recording_name
        if not re.fullmatch(RECORDING_NAME, name) or len(name) > MAX_NAME:
            raise ConfigError(
                f"{place}: the name {show_value(name)} must consist of at most {MAX_NAME} letters A-Z a-z, digits and "
                "_ - ., and begin with a letter or digit: write another one into the column name."
            )
        if name in recordings and not (row.batch and name in batches):
            raise ConfigError(f"{place}: the name {name!r} is taken; give each row, and each batch, a name of its own.")
        batches.add(row.batch)
        parts = recordings.setdefault(name, [])
        if (row.file, row.start, row.stop) in [(part.file, part.start, part.stop) for part in parts]:
            raise ConfigError(f"{place}: the same part of {row.file} is in the batch {name!r} already.")
        parts.append(Recording(**row.model_dump(exclude={"name", "batch"})))
    try:
        check_cases("names", recordings)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}.") from None
    return recordings


def _cast_recording(key: str, text: str) -> Any:
    """A cell as the type of its column; what is no number stays text, which the model refuses."""
    field = _Row.model_fields.get(key)
    kinds = (get_args(field.annotation) or (field.annotation,)) if field else (str,)
    return text if any(kind is str or isinstance(kind, str) for kind in kinds) else cast_number(text)


def cast_number(text: str) -> Any:
    """The number that a text is; any other text as it is."""
    if not NUMBER.fullmatch(text):
        return text
    return int(text) if re.fullmatch(r"[+-]?[0-9]+", text) else float(text)


def read_points(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Place and cells of each row of a table of points: text of CSV, values of Parquet."""
    if path.suffix != ".parquet":
        yield from read_rows(path)
        return
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        rows = pq.read_table(path).to_pylist()
    except (OSError, pa.ArrowException) as error:
        raise ConfigError(f"{path}: the file cannot be read as Parquet ({str(error).splitlines()[0]}).") from None
    for number, row in enumerate(rows, start=1):
        yield f"{path}, row {number}", {name: None if value != value else value for name, value in row.items()}


def read_rows(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Place and cells of each row of a CSV table, as text without spaces around it; empty rows are left out."""
    if not os.path.exists(path):
        raise ConfigError(f"there is no table {os.path.abspath(path)}.")
    reader = csv.reader(io.StringIO(read_text(path), newline=""), strict=True)
    keys: list[str] = []
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
            yield place, {key: text for key, text in zip(keys, texts, strict=False) if key}
    except csv.Error as error:
        raise ConfigError(f"{path}, line {reader.line_num}: this is not CSV: {error}.") from None


def _check_columns(place: str, keys: Sequence[str]) -> None:
    """Refuse columns of one name, and other signs than commas between them."""
    for name, sign in (("semicolons", ";"), ("tabulators", "\t")):
        if sign in "".join(keys):
            raise ConfigError(f"{place}: the columns are separated by {name}: save the table with commas between them.")
    for key in filter(None, keys):
        if keys.count(key) > 1:
            raise ConfigError(f"{place}: {keys.count(key)} columns are called {key!r}.")
