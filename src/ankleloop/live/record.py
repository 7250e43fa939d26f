"""The samples of a source in files that `read_trial` reads."""

from __future__ import annotations

from itertools import chain, count
from pathlib import Path

import numpy as np

from ankleloop.live.sources import Samples
from ankleloop.trials.channels import CHANNELS, TIME

HEADER = "time_s,position_rad,torque_nm,reference_rad\n"


def find_free(path: Path) -> Path:
    """A path, with a number where there is such a file: nothing is replaced."""
    numbered = (path.with_stem(f"{path.stem}-{number}") for number in count(2))
    return next(other for other in chain([path], numbered) if not other.exists())


class Record:
    """Writes samples as they come; behind a gap, which no trial has, another file begins."""

    def __init__(self, path: Path, rate: float) -> None:
        self.paths: list[Path] = []
        self._path = path
        self._rate = rate
        self._begin()

    def _begin(self) -> None:
        """Begin the next file."""
        self.paths.append(find_free(self._path))
        self._file = open(self.paths[-1], "w", encoding="utf-8")  # noqa: SIM115 # closed by `close`
        self._file.write(HEADER)
        self._rows = 0  # of the file
        self._last = np.nan  # time of the last sample [s]

    def add(self, samples: Samples) -> None:
        """Write samples; without times none is missing."""
        rows = np.column_stack([samples[name] for name in CHANNELS])
        for time, row in zip(samples.get(TIME, np.full(len(rows), np.nan)), rows, strict=True):
            if self._rate * (time - self._last) > 1.5:
                self.close()
                self._begin()
            numbers = (self._rows / self._rate, *row)
            self._file.write(",".join(f"{number:.9g}" for number in numbers) + "\n")
            self._rows += 1
            self._last = time

    def close(self) -> None:
        """Close the file."""
        self._file.close()
