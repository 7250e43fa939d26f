"""FLB files ("filelb"): a sequence of cases (trials), each of named channels of equal length.

A case begins with its version (2, 3 or 4), the numbers of its dimensions and realizations (not in version 2), and
number, length and format of its channels; names, sampling interval, comment and ranges follow, then the samples,
channel by channel. All is little endian.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.containers import Contents, Variable, shorten

TYPES = {4: "<f4", 2: "<i2", -2: "<u2"}
LEVELS = 65535  # of format -2, from the lower end of the range to the upper one
LISTED = 30  # cases in a message


@dataclass(frozen=True)
class _Case:
    """What stands before the samples of a case, and where they begin."""

    names: list[str]  # of the channels, of each realization
    length: int  # samples of a channel
    type: np.dtype[Any]
    interval: float  # s
    comment: str
    ranges: np.ndarray  # lowest and highest value of each channel, shape (2, channels)
    start: int  # byte at which the samples begin

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]; the interval is rounded to single precision in the file."""
        rate = 1.0 / self.interval
        return float(round(rate)) if abs(rate - round(rate)) <= 1e-5 * rate else rate

    def describe(self) -> str:
        """Channels, duration and comment."""
        comment = f", {shorten(self.comment)!r}" if self.comment else ""
        return f"{', '.join(self.names)}, {self.length / self.rate:.4g} s at {self.rate:g} Hz{comment}"


class FlbContents(Contents):
    """Channels of one case; those of several realizations have its number behind a slash."""

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path)
        with open(path, "rb") as file:
            cases = list(_read_cases(file, path))
        if case is None and len(cases) > 1:
            listed = "; ".join(f"case {k}: {other.describe()}" for k, other in enumerate(cases[:LISTED], 1))
            raise DataError(f"{path.name}: there are {len(cases)} cases: choose one by the option case. {listed}.")
        if (case or 1) > len(cases):
            raise DataError(f"{path.name}: there is no case {case}: the file has {len(cases)}, counted from 1.")
        self._case = cases[(case or 1) - 1]

    def find(self, name: str) -> Variable | None:
        """Channel of a name; None if there is none."""
        case = self._case
        if name not in case.names:
            return None
        if case.names.count(name) > 1:
            raise DataError(f"{self.path.name}: there are several channels {name!r}: give each a name of its own.")
        channel = case.names.index(name)

        def read(part: slice) -> np.ndarray:
            start, stop, _ = part.indices(case.length)
            first = case.start + (channel * case.length + start) * case.type.itemsize
            samples = np.fromfile(self.path, case.type, stop - start, offset=first)
            if case.type.str != TYPES[-2]:
                return samples
            low, high = case.ranges[:, channel % case.ranges.shape[1]]
            return low + samples * ((high - low) / LEVELS)

        return Variable(name, (case.length,), read)

    def names(self) -> Iterator[str]:
        """Names of the channels."""
        yield from self._case.names

    def find_attribute(self, owner: str, name: str) -> Any:
        """The sampling rate, which belongs to the file."""
        return self._case.rate if (owner, name) == ("", "sampling_rate") else None


def _read_cases(file: BinaryIO, path: Path) -> Iterator[_Case]:
    size = path.stat().st_size
    number = 0
    while size - file.tell() >= 4:
        number += 1
        case = _read_case(file, size, f"{path.name}: cannot be read as .flb (case {number}")
        yield case
    if not number:
        raise DataError(f"{path.name}: cannot be read as .flb (it has no case): check that the file is whole.")


def _read_case(file: BinaryIO, size: int, fault: str) -> _Case:
    """Read what describes the next case, and go to its end."""

    def read(kind: str, count: int = 1) -> np.ndarray:
        length = np.dtype(kind).itemsize * count
        if not 0 <= length <= size - file.tell():
            raise DataError(f"{fault} is cut off): check that the file is whole.")
        return np.frombuffer(file.read(length), kind)

    def read_text() -> str:
        return read("u1", int(read("<i4")[0])).tobytes().decode("latin-1").strip("\0 ")

    version = int(read("<i4")[0])
    if version not in (2, 3, 4):
        raise DataError(f"{fault} is of version {version}, and there are 2, 3 and 4): check that its suffix is right.")
    realizations = 1 if version == 2 else int(read("<i4", 2)[1])
    channels, length, kind = read("<i4", 3).tolist()
    if kind not in TYPES:
        raise DataError(f"{fault} has samples of format {kind}, and 4, 2 and -2 are read): convert it.")
    read_text()  # the domain, time
    interval = float(read("<f4", 2)[0])
    comment = read_text()
    names = [read_text() or f"channel {channel + 1}" for channel in range(channels)]
    ranges = read("<f8", 2 * channels).reshape(2, channels)
    if not (channels > 0 and length > 0 and realizations > 0 and 0.0 < interval < np.inf):
        raise DataError(f"{fault} has no samples, or no sampling interval): check that the file is whole.")
    if realizations > 1:
        names = [f"{name}/{k}" for k in range(1, realizations + 1) for name in names]
    start = file.tell()
    count = length * len(names) * np.dtype(TYPES[kind]).itemsize
    if count > size - start:
        raise DataError(f"{fault} is cut off): check that the file is whole.")
    file.seek(count, io.SEEK_CUR)
    return _Case(names, length, np.dtype(TYPES[kind]), interval, comment, ranges, start)
