"""The samples of a source in files that `read_trial` reads."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import numpy as np

from ankleloop.live.sources import Samples
from ankleloop.live.stream import LARGEST_STEP
from ankleloop.trials.channels import CHANNELS, TIME


def find_free(path: Path) -> Path:
    """A path, with a number where there is such a file: nothing is replaced."""
    free = path
    number = 1
    while free.exists():
        number += 1
        free = path.with_stem(f"{path.stem}-{number}")
    return free


class Record(ExitStack):
    """Writes samples as they come; behind a gap, which no trial has, another file begins."""

    def __init__(self, path: Path, rate: float) -> None:
        super().__init__()
        self.paths: list[Path] = []
        self._path = path
        self._rate = rate
        self._last = -np.inf  # time of the last sample [s]

    def add(self, samples: Samples) -> None:
        """Write samples; without times none is missing."""
        rows = np.column_stack([samples[name] for name in CHANNELS])
        times = samples.get(TIME, np.zeros(len(rows)))
        for time, row in zip(times, rows, strict=True):
            if (time - self._last) * self._rate > LARGEST_STEP:
                self.paths.append(find_free(self._path))
                file = open(self.paths[-1], "w", encoding="utf-8")  # noqa: SIM115 # closed by `close`
                self._file = self.enter_context(file)
                print("time_s,position_rad,torque_nm,reference_rad", file=self._file)
                self._count = 0  # rows of the file
            print(self._count / self._rate, *row, sep=",", file=self._file)
            self._count += 1
            self._last = time
