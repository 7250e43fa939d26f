"""FLB files ("filelb"): a sequence of cases (trials), each of named channels of equal length.

A case begins with its version (2, 3 or 4), the numbers of its dimensions and realizations (not in version 2), and
number, length and format of its channels; names, sampling interval, comment and ranges follow, then the samples,
channel by channel. All is little endian.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.channels import LISTED
from ankleloop.trials.containers import Contents, Variable
from ankleloop.trials.files import UnreadableError

TYPES = {4: "<f4", 2: "<i2", -2: "<u2"}
LEVELS = 65535  # of format -2, from the lower end of the range to the upper one


@dataclass(frozen=True)
class _Case:
    """What stands before the samples of a case, and where they begin."""

    names: list[str]  # of the channels, of each realization
    length: int  # samples of a channel
    type: str  # of the samples, a key of numpy
    rate: float  # Hz
    comment: str
    ranges: np.ndarray  # lowest and highest value of each channel, shape (2, channels)
    start: int  # byte at which the samples begin

    def describe(self) -> str:
        """Channels, duration and comment."""
        comment = f", {self.comment[:60]!r}" if self.comment else ""
        return f"{', '.join(self.names)}, {self.length / self.rate:.4g} s at {self.rate:g} Hz{comment}"


class FlbContents(Contents):
    """Channels of one case; those of several realizations have its number behind a slash."""

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path)
        size = path.stat().st_size
        with open(path, "rb") as file:
            cases = [_read_case(file, size, 1)]
            while size - file.tell() >= 4:
                cases.append(_read_case(file, size, len(cases) + 1))
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
        samples = np.memmap(self.path, case.type, "r", case.start, (len(case.names), case.length))
        channel, scale = case.names.index(name), {}
        if case.type == TYPES[-2]:
            low, high = case.ranges[:, channel % case.ranges.shape[1]]
            scale = {"scale_factor": (high - low) / LEVELS, "add_offset": low}
        return Variable(name, (case.length,), lambda part: samples[channel, part], scale)

    def names(self) -> Iterable[str]:
        """Names of the channels."""
        return self._case.names

    def find_attribute(self, owner: str, name: str) -> Any:
        """The sampling rate, which belongs to the file."""
        return self._case.rate if (owner, name) == ("", "sampling_rate") else None


def _read_case(file: BinaryIO, size: int, number: int) -> _Case:
    """Read what describes the next case, and go to its end."""

    def read(kind: str, count: int = 1) -> np.ndarray:
        length = np.dtype(kind).itemsize * count
        if not 0 <= length <= size - file.tell():
            raise UnreadableError(f"case {number} is cut off")
        return np.frombuffer(file.read(length), kind)

    def read_text() -> str:
        return read("u1", int(read("<i4")[0])).tobytes().decode("latin-1").strip("\0 ")

    version = int(read("<i4")[0])
    if version not in (2, 3, 4):
        raise UnreadableError(f"case {number} is of version {version}, and there are 2, 3 and 4")
    realizations = 1 if version == 2 else int(read("<i4", 2)[1])
    channels, length, kind = read("<i4", 3).tolist()
    if kind not in TYPES:
        raise UnreadableError(f"case {number} has samples of format {kind}, and 4, 2 and -2 are read: convert it")
    read_text()  # the domain, time
    interval = float(read("<f4", 2)[0])
    comment = read_text()
    names = [read_text() or f"channel {channel + 1}" for channel in range(channels)]
    ranges = read("<f8", 2 * channels).reshape(2, channels)
    if not (channels > 0 and length > 0 and realizations > 0 and 0.0 < interval < np.inf):
        raise UnreadableError(f"case {number} has no samples, or no sampling interval")
    if realizations > 1:
        names = [f"{name}/{k}" for k in range(1, realizations + 1) for name in names]
    start, count = file.tell(), length * len(names) * np.dtype(TYPES[kind]).itemsize
    if count > size - start:
        raise UnreadableError(f"case {number} is cut off")
    file.seek(count, io.SEEK_CUR)
    rate = 1.0 / interval
    rate = round(rate) if abs(rate - round(rate)) <= 1e-5 * rate else rate  # the interval is in single precision
    return _Case(names, length, TYPES[kind], float(rate), comment, ranges, start)
