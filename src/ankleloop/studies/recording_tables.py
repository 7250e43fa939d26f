"""Tables that list recordings of a laboratory, a row each."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from ankleloop.options import option
from ankleloop.studies.checking import ConfigError, check
from ankleloop.studies.config import RECORDING_NAME, Recording

__all__ = ["read_recordings"]


class _Row(Recording):
    """A row of the table: a recording, or one of the trials that are merged into one."""

    name: str | None = option(None, "name of the recording; without one, subject, condition and trial make it")
    batch: str | None = option(None, "name that rows share whose trials are merged")

    @property
    def recording_name(self) -> str:
        """Name of the recording to which the row belongs."""
        parts = [part for part in (self.subject, self.condition, self.trial) if part]
        return self.batch or self.name or "-".join(parts) or Path(self.file).name


def read_recordings(table: str, defaults: Mapping[str, Any]) -> dict[str, list[Recording]]:
    """Read a table of recordings.

    Parameters
    ----------
    table : str
        CSV file; ${NAME} in its path stands for an environment variable.
    defaults : mapping
        Values for every recording that does not give its own.

    Returns
    -------
    dict of str to list of Recording
        Files of each recording by its name: one, or those of the trials that are merged.

    Raises
    ------
    ConfigError
        If there is no table, or a row has a mistake; the message names the table and the line.
    """
    import pandas as pd  # here: most configurations have no table

    path = Path(os.path.expandvars(table))
    if not path.exists():
        raise ConfigError(f"there is no table {path}.")
    rows = pd.read_csv(
        path, dtype=str, keep_default_na=False, index_col=False, skip_blank_lines=False, encoding="utf-8-sig"
    )
    recordings: dict[str, list[Recording]] = {}
    for line, row in enumerate(rows.to_dict("records"), start=2):
        cells = {str(key).strip(): str(text).strip() for key, text in row.items()}
        cells = {key: text for key, text in cells.items() if key and text}
        if cells:
            place = f"{path}, line {line}"
            _add(recordings, check(_Row, {**defaults, **{key: _cast(key, cells[key]) for key in cells}}, place), place)
    if not recordings:
        raise ConfigError(f"the table {path} has no rows.")
    return recordings


def _add(recordings: dict[str, list[Recording]], row: _Row, place: str) -> None:
    name = row.recording_name
    if not re.match(RECORDING_NAME, name):
        raise ConfigError(f"{place}: the name {name!r} does not match {RECORDING_NAME}.")
    if name in recordings and not row.batch:
        raise ConfigError(f"{place}: the name {name!r} is taken; give each row a name of its own.")
    values = row.model_dump(exclude={"name", "batch"})
    recordings.setdefault(name, []).append(Recording(**values))


def _cast(key: str, text: str) -> Any:
    """A cell as the type of its column; what is no number stays text, which the model refuses."""
    field = _Row.model_fields.get(key)
    if field is None or str in {type(kind) if isinstance(kind, str) else kind for kind in _kinds(field.annotation)}:
        return text
    for number in (int, float):
        try:
            return number(text)
        except ValueError:
            continue
    return text


def _kinds(annotation: Any) -> tuple[Any, ...]:
    """Types, or literal values, that a field accepts."""
    return get_args(annotation) or (annotation,)
