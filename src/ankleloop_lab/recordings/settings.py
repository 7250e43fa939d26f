"""A recording of the configuration and of the command line: its file, how it is read, and which part of it is used.

Recordings are listed in the configuration, or in a CSV table with a row for each of their files.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from pydantic import field_validator, model_validator

from ankleloop.errors import DataError
from ankleloop.options import option, show_value
from ankleloop.trials.files import PathLike
from ankleloop_lab.checking import ConfigError, cast_number, check, find_kind, read_rows
from ankleloop_lab.files.reading_options import ReadingOptions, list_trials
from ankleloop_lab.files.reading_process import CONTAINERS
from ankleloop_lab.recordings.labels import GROUPS

MAX_NAME = 100  # characters: names are parts of the names of files, which have at most 255 bytes
RECORDING_NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"


class Recording(ReadingOptions):
    """A recording: its file, how it is read, and which part of it is used."""

    file: str = option(
        description=f"file below the folder of the study ({', '.join(CONTAINERS)})",
        min_length=1,
    )
    subject: str = option("", "subject; groups the figures")
    condition: str = option("", "condition; groups the figures")
    trial: str = option("", "repetition")
    session: str = option(
        "", "session in which it was recorded; without one each trial is a session"
    )
    start: float | None = option(
        None, "start of the segment that is used; null for the beginning", unit="s", ge=0
    )
    stop: float | None = option(
        None, "end of the segment that is used; null for the end", unit="s", gt=0
    )
    drift: int = option(
        0, "degree of the polynomial that is taken out of the torque; 0 takes the mean", ge=0, le=10
    )

    cycle_onsets: tuple[float, ...] | str | None = option(
        None,
        "start of every cycle, in a table with spaces between; or the variable with its phase, 0 to 1",
        unit="s",
    )
    schedule: str | None = option(
        None,
        "variable with which the parameters change, for methods whose parameters may",
        min_length=1,
    )

    @field_validator("cycle_onsets", mode="before")
    @classmethod
    def _as_times(cls, value: Any) -> Any:
        """Tables have times as a text."""
        if isinstance(value, str):
            with suppress(ValueError):
                return tuple(map(float, re.split(r"[\s;,]+", value.strip())))
        return tuple(value) if isinstance(value, list) else value

    @model_validator(mode="after")
    def _check_parts(self) -> Self:
        if self.cycle_onsets is not None and self.schedule is not None:
            raise ValueError(
                "cycle_onsets and schedule exclude each other: parameters are functions of one of them"
            )
        if self.stop is not None and self.stop <= (self.start or 0.0):
            raise ValueError(
                f"stop ({self.stop:g} s) must be after start ({self.start or 0.0:g} s)"
            )
        return self

    @property
    def changes(self) -> bool:
        """Whether it says what the parameters of its joint follow."""
        return self.cycle_onsets is not None or self.schedule is not None


class _Row(Recording):
    """A row of a table of recordings: a recording, or one of the trials that are merged into one."""

    name: str | None = option(None, "name of the recording; without one, its labels make it")
    batch: str | None = option(None, "name that rows share whose trials are merged")

    @property
    def recording_name(self) -> str:
        """Name of the recording to which the row belongs."""
        labels = "-".join(filter(None, (getattr(self, name) for name in GROUPS)))
        return self.batch or self.name or labels or Path(self.file).name


def name_trials(name: str, trials: Sequence[Recording]) -> dict[str, Recording]:
    """Trials of a file by the names of their recordings, which are numbered where there are several."""
    if len(trials) == 1:
        return {name: trials[0]}
    return {f"{name}-{number}": trial for number, trial in enumerate(trials)}


def split_recording(recording: Recording, folder: Path) -> list[Recording]:
    """The trials of its file, where names of variables have a * for their number; a job refuses what cannot be read."""
    with suppress(DataError):
        return list_trials(folder / recording.file, recording)
    return [recording]


def describe_parts(parts: Sequence[Recording], folder: Path) -> dict[str, Any]:
    """What is analysed of a recording: how its first file is read, and paths and mappings of all that are merged."""
    return {
        **parts[0].model_dump(),
        "paths": [str(folder / part.file) for part in parts],
        "parts": [part.model_dump() for part in parts],
    }


def read_recordings(
    path: PathLike, defaults: Mapping[str, Any], folder: Path = Path()
) -> dict[str, list[Recording]]:
    """Read a table of recordings: the files of each by its name, of which there are several where they are merged.

    `folder` has the files. Trials of one file are recordings of their own, or merged in a row with a batch.
    """
    recordings: dict[str, list[Recording]] = {}
    batches: set[str | None] = set()  # names of merged recordings
    numbers = {
        name for name, field in _Row.model_fields.items() if find_kind(field.annotation) != "text"
    }
    for place, cells in read_rows(path):
        # What is no number stays text, which the model refuses.
        values = {
            key: cast_number(text) if key in numbers else text
            for key, text in cells.items()
            if text
        }
        row = check(_Row, {**defaults, **values}, place)
        name = row.recording_name
        part = Recording(**row.model_dump(exclude={"name", "batch"}))
        if not re.fullmatch(RECORDING_NAME, name) or len(name) > MAX_NAME:
            raise ConfigError(
                f"{place}: the name {show_value(name)} must consist of at most {MAX_NAME} letters A-Z a-z, digits and "
                "_ - ., and begin with a letter or digit: write another one into the column name."
            )
        trials = split_recording(part, folder)
        named = {name: trials}
        if not row.batch:
            named = {key: [trial] for key, trial in name_trials(name, trials).items()}
        for key, parts in named.items():
            others = recordings.setdefault(key, [])
            is_merged = row.batch and key in batches
            if any(trial in others for trial in parts) or (others and not is_merged):
                raise ConfigError(
                    f"{place}: the name {key!r} is taken; give each row, and each batch, a name of its own."
                )
            others += parts
        batches.add(row.batch)
    return recordings
