"""Tables that list recordings of a laboratory, a row each."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from ankleloop.options import option, show_value
from ankleloop.studies.checking import ConfigError, check
from ankleloop.studies.config import MAX_NAME, RECORDING_NAME, Recording, check_recording_names
from ankleloop.studies.table_rows import NUMBER, read_rows


class _Row(Recording):
    """A row of the table: a recording, or one of the trials that are merged into one."""

    name: str | None = option(None, "name of the recording; without one, subject, condition and trial make it")
    batch: str | None = option(None, "name that rows share whose trials are merged")

    @property
    def recording_name(self) -> str:
        """Name of the recording to which the row belongs."""
        parts = [part for part in (self.subject, self.condition, self.trial) if part]
        return self.batch or self.name or "-".join(parts) or Path(self.file).name


def read_recordings(path: str | os.PathLike[str], defaults: Mapping[str, Any]) -> dict[str, list[Recording]]:
    """Read a table of recordings."""
    path = Path(path)
    if not os.path.exists(path):
        raise ConfigError(f"there is no table {os.path.abspath(path)}.")
    recordings: dict[str, list[Recording]] = {}
    batches: set[str] = set()
    for line, cells in read_rows(path):
        place = f"{path}, line {line}"
        row = check(_Row, {**defaults, **{key: _cast(key, text) for key, text in cells.items()}}, place)
        _add(recordings, batches, row, place)
    if not recordings:
        raise ConfigError(f"the table {path} has no rows.")
    _check_names(path, recordings)
    return recordings


def _add(recordings: dict[str, list[Recording]], batches: set[str], row: _Row, place: str) -> None:
    name = row.recording_name
    if not re.fullmatch(RECORDING_NAME.strip("^$"), name) or len(name) > MAX_NAME:
        raise ConfigError(
            f"{place}: the name {show_value(name)} must consist of at most {MAX_NAME} letters A-Z a-z, digits and "
            "_ - ., and begin with a letter or digit: write another one into the column name."
        )
    if name in recordings and not (row.batch and name in batches):
        raise ConfigError(f"{place}: the name {name!r} is taken; give each row, and each batch, a name of its own.")
    if row.batch:
        batches.add(name)
    recording = Recording(**row.model_dump(exclude={"name", "batch"}))
    parts = recordings.setdefault(name, [])
    if any((part.file, part.start, part.stop) == (recording.file, recording.start, recording.stop) for part in parts):
        raise ConfigError(f"{place}: the same part of {recording.file} is in the batch {name!r} already.")
    parts.append(recording)


def _check_names(path: Path, recordings: Mapping[str, object]) -> None:
    try:
        check_recording_names("names", recordings)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}.") from None


def _cast(key: str, text: str) -> Any:
    """A cell as the type of its column; what is no number stays text, which the model refuses."""
    field = _Row.model_fields.get(key)
    if field is None or str in {type(kind) if isinstance(kind, str) else kind for kind in _kinds(field.annotation)}:
        return text
    if not re.fullmatch(NUMBER, text):
        return text
    return int(text) if re.fullmatch(r"[+-]?[0-9]+", text) else float(text)


def _kinds(annotation: Any) -> tuple[Any, ...]:
    """Types, or literal values, that a field accepts."""
    return get_args(annotation) or (annotation,)
