"""A recording of the configuration and of the command line: its file, how it is read, and which part of it is used."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from ankleloop.options import option
from ankleloop.records.reading_options import ReadingOptions

__all__ = ["Recording"]


class Recording(ReadingOptions):
    """A recording: its file, how it is read, and which part of it is used."""

    file: str = option(
        description="path of the file below the folder of the study (.csv, .csv.gz, .mat, .h5, .nc)", min_length=1
    )
    subject: str = option("", "subject; groups the figures")
    condition: str = option("", "condition; groups the figures")
    trial: str = option("", "repetition")
    start: float | None = option(None, "start of the segment that is used; null for the beginning", unit="s", ge=0)
    stop: float | None = option(None, "end of the segment that is used; null for the end", unit="s", gt=0)
    drift: int = option(0, "degree of the polynomial that is taken out of the torque; 0 takes the mean", ge=0, le=10)

    @model_validator(mode="after")
    def _check_segment(self) -> Self:
        if self.stop is not None and self.stop <= (self.start or 0.0):
            raise ValueError(f"stop ({self.stop:g} s) must be after start ({self.start or 0.0:g} s)")
        return self
