"""The samples of a recording in files that `read_trial` reads."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path


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

    def add(self, channels: Sequence[float], *, is_first: bool) -> None:
        """Write a sample: position [rad], torque [N·m] and reference [rad]."""
        if is_first:
            self.paths.append(find_free(self._path))
            file = open(self.paths[-1], "w", encoding="utf-8")  # noqa: SIM115 # closed by `close`
            self._file = self.enter_context(file)
            print("time_s,position_rad,torque_nm,reference_rad", file=self._file)
            self._count = 0  # samples of the file
        print(self._count / self._rate, *channels, sep=",", file=self._file)
        self._count += 1
