"""FLB files ("filelb")."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ankleloop.errors import DataError
from ankleloop.signals.sampling import rate_of_interval
from ankleloop.trials.files import UnreadableError
from ankleloop_lab.files.contents import Contents, Variable

TYPES = {4: "<f4", 2: "<i2", -2: "<u2"}  # of samples, by the format of a case
LEVELS = 65535  # of format -2, from the lower end of the range to the upper one


@dataclass(frozen=True)
class FlbCase:
    """A trial of an FLB file."""

    variables: list[Variable]
    rate: float  # Hz
    comment: str


class FlbContents(Contents):
    """Channels of one case of an FLB file, a sequence of cases (trials) of named channels of equal length.

    A case begins with its version (2, 3 or 4), the numbers of its dimensions and realizations (not in version 2), and
    number, length and format of its channels; names, sampling interval, comment and ranges follow, then the samples,
    channel by channel. All is little endian. Channels of several realizations have its number behind a slash.
    """

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path)
        size = path.stat().st_size
        with open(path, "rb") as file:
            cases = [_read_case(file)]
            while size - file.tell() >= 4:
                cases.append(_read_case(file))
        number = case or 1
        if number > len(cases) or (case is None and len(cases) > 1):
            comments = [f"case {k}, {each.comment!r}" for k, each in enumerate(cases, 1)]
            raise DataError(
                f"{path.name}: there are {len(cases)} cases: choose one by the option case: {'; '.join(comments)}.",
                remedy={"case": None},
            )
        chosen = cases[number - 1]
        self.variables = chosen.variables
        self.file_attributes = {"sampling_rate": chosen.rate}


def _read_case(file: BinaryIO) -> FlbCase:
    """Read the next case."""
    version = int(_read(file, "<i4")[0])
    if version not in (2, 3, 4):
        raise UnreadableError(f"a case is of version {version}, and there are 2, 3 and 4")
    realizations = 1 if version == 2 else int(_read(file, "<i4", 2)[1])
    channels, length, kind = _read(file, "<i4", 3).tolist()
    if kind not in TYPES:
        raise UnreadableError(
            f"a case has samples of format {kind}, and 4, 2 and -2 are read: convert it"
        )
    _read_text(file)  # the domain, time
    interval = float(_read(file, "<f4", 2)[0])
    comment = _read_text(file)
    names = [_read_text(file) or f"channel {channel + 1}" for channel in range(channels)]
    low, high = _read(file, "<f8", 2 * channels).reshape(2, channels, 1)
    samples = _read(file, TYPES[kind], length * channels * realizations)
    samples = samples.reshape(realizations, channels, length)
    if kind == -2:
        samples = samples * ((high - low) / LEVELS) + low
    if realizations > 1:
        names = [f"{name}/{k}" for k in range(1, realizations + 1) for name in names]
    rows = zip(names, samples.reshape(-1, length), strict=True)
    variables = [Variable(name, row.shape, row.view) for name, row in rows]
    return FlbCase(variables, rate_of_interval(interval), comment)


def _read_text(file: BinaryIO) -> str:
    """Read a text behind its length."""
    length = int(_read(file, "<i4")[0])
    return _read(file, "u1", length).tobytes().decode("latin-1").strip("\0 ")


def _read(file: BinaryIO, kind: str, count: int = 1) -> np.ndarray:
    """Read so many numbers."""
    numbers = np.fromfile(file, kind, count)
    if numbers.size != count:
        raise UnreadableError("a case is cut off")
    return numbers
