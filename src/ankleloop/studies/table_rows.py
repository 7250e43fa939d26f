"""CSV tables that people write, row by row: text as it stands, or a message that names the line."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path

from ankleloop.studies.checking import ConfigError
from ankleloop.studies.config_files import read_text

NUMBER = r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"  # Python also takes 1_0, nan and digits of other scripts


def read_rows(path: Path, *, empty_cells: bool = False) -> Iterator[tuple[int, dict[str, str]]]:
    """Line and cells of each row, as text without spaces around it; empty rows are left out."""
    text = read_text(path)
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    keys: list[str] = []
    try:
        for row in reader:
            place = f"{path}, line {reader.line_num}"
            texts = [text.strip() for text in row]
            if not any(texts):
                continue
            if not keys:
                keys = _check_header(place, texts)
                continue
            spare = [text for key, text in zip_longest(keys, texts, fillvalue="") if text and not key]
            if spare:
                raise ConfigError(f"{place}: {spare[0]!r} is in no named column; put a text with a comma in quotes.")
            if len(texts) < len(keys):
                raise ConfigError(
                    f"{place}: the row has {len(texts)} cells of {len(keys)}; is the table cut off? Empty cells at the "
                    "end of a row need their commas, too."
                )
            cells = zip(keys, texts, strict=False)
            yield reader.line_num, {key: text for key, text in cells if text or (key and empty_cells)}
    except csv.Error as error:
        raise ConfigError(f"{path}, line {reader.line_num}: this is not CSV: {error}.") from None


def check_columns(place: str, keys: list[str]) -> None:
    """Refuse columns of one name."""
    for key, count in Counter(keys).items():
        if key and count > 1:
            raise ConfigError(f"{place}: {count} columns are called {key!r}.")


def _check_header(place: str, keys: list[str]) -> list[str]:
    """Names of the columns."""
    for name, sign in (("semicolons", ";"), ("tabulators", "\t")):
        if sign in "".join(keys):
            raise ConfigError(f"{place}: the columns are separated by {name}: save the table with commas between them.")
    check_columns(place, keys)
    return keys
