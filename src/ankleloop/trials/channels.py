"""Channels of a recording as they come from a file, and how many samples of one are read at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ankleloop.errors import DataError

MAX_SAMPLES = 20_000_000  # 160 MB in double precision


@dataclass(frozen=True)
class Channel:
    """A variable of a file that serves as a channel of a trial."""

    name: str  # full name of the variable or attribute in the file
    unit: str  # unit that the file states, or the empty string
    shape: tuple[int, ...]  # its shape in the file
    values: np.ndarray | None = None  # its samples; None where they were not read


def check_size(samples: int, name: str) -> None:
    """Refuse more samples than are read at once."""
    if samples > MAX_SAMPLES:
        raise DataError(
            f"{name} has {samples:,} samples by its size in the file; at most {MAX_SAMPLES:,} are read as a trial "
            f"({MAX_SAMPLES / 3.6e6:.1f} h at 1 kHz): read a long record by ankleloop.LongRecord from HDF5 or NetCDF; "
            "if the record is short, the file is damaged."
        )
