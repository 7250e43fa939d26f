"""Tables that list recordings of a laboratory, a row each."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from ankleloop.options import option, show_value
from ankleloop.studies.checking import ConfigError, check
from ankleloop.studies.config import MAX_NAME, RECORDING_NAME, check_recording_names
from ankleloop.studies.recording_settings import Recording
from ankleloop.studies.tables import cast_number, read_rows


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
    path = Path(path)
    recordings: dict[str, list[Recording]] = {}
    batches: set[str | None] = set()
    for place, cells in read_rows(path):
        values = {key: _cast_recording(key, text) for key, text in cells.items() if text}
        row = check(_Row, {**defaults, **values}, place)
        name = row.recording_name
        if not re.fullmatch(RECORDING_NAME.strip("^$"), name) or len(name) > MAX_NAME:
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
        check_recording_names("names", recordings)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}.") from None
    return recordings


def _cast_recording(key: str, text: str) -> Any:
    """A cell as the type of its column; what is no number stays text, which the model refuses."""
    field = _Row.model_fields.get(key)
    kinds = (get_args(field.annotation) or (field.annotation,)) if field else (str,)
    takes_text = any(kind is str or isinstance(kind, str) for kind in kinds)
    return text if takes_text else cast_number(text)
