"""A recording of the configuration and of the command line: its file, how it is read, and which part of it is used."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import Any, Self

from pydantic import field_validator, model_validator

from ankleloop.options import option
from ankleloop.trials.reading_options import ReadingOptions


class Recording(ReadingOptions):
    """A recording: its file, how it is read, and which part of it is used."""

    file: str = option(
        description="file below the folder of the study (.csv, .csv.gz, .mat, .h5, .nc, .flb)", min_length=1
    )
    subject: str = option("", "subject; groups the figures")
    condition: str = option("", "condition; groups the figures")
    trial: str = option("", "repetition")
    start: float | None = option(None, "start of the segment that is used; null for the beginning", unit="s", ge=0)
    stop: float | None = option(None, "end of the segment that is used; null for the end", unit="s", gt=0)
    drift: int = option(0, "degree of the polynomial that is taken out of the torque; 0 takes the mean", ge=0, le=10)

    cycle_onsets: tuple[float, ...] | str | None = option(
        None, "start of every cycle, in a table with spaces between; or the variable with its phase, 0 to 1", unit="s"
    )
    schedule: str | None = option(
        None, "variable with which the parameters change, for methods whose parameters may", min_length=1
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
            raise ValueError("cycle_onsets and schedule exclude each other: parameters are functions of one of them")
        if self.stop is not None and self.stop <= (self.start or 0.0):
            raise ValueError(f"stop ({self.stop:g} s) must be after start ({self.start or 0.0:g} s)")
        return self

    @property
    def changes(self) -> bool:
        """Whether it says what the parameters of its joint follow."""
        return self.cycle_onsets is not None or self.schedule is not None
