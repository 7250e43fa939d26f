"""Where the samples of a subject come from while he moves: a stream, a table of text that grows, standard input.

Channels, units and rates follow from names and descriptions by the rules of files.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.errors import DataError
from ankleloop.trials.channels import TIME, read_channels
from ankleloop.trials.contents import Contents, Variable
from ankleloop.trials.csv_files import CsvContents
from ankleloop.trials.readers import choose_rate, find_factors, settle_position_unit
from ankleloop.trials.reading_options import ReadingOptions
from ankleloop.trials.units import time_factor

STANDARD_INPUT = Path("-")
WAIT = 0.1  # s for new samples
SEARCHES = 60  # of a second, until there is a stream
FIRST_LINES = 100  # of a table, which tell its rate
MOST_SAMPLES = 10_000  # of a stream at a time
# Of stamps: jitter [s] of a stream that begins, by how many times of it a gap is beyond, and how fast [s] times follow.
JITTER, BEYOND, FOLLOWING = 0.002, 3.0, 5.0

# Position [rad], torque [N·m], reference [rad] and, where the source has any, times [s] by name, each of shape (N,).
Samples = dict[str, np.ndarray]


class Source(Iterable[Samples]):
    """What sends samples: iterating over it gives them as they come, none after a wait in which none came."""

    name: str
    rate: float  # Hz
    variables: dict[str, Variable]  # by channel, as the source has them
    options: ReadingOptions  # with the unit that the source states
    silence = 0.0  # s without samples

    def find_channels(self, contents: Contents, options: ReadingOptions) -> None:
        """Find the columns of the channels, and their units, from what the source says of itself."""
        self.name = contents.path.name
        rate = options.sampling_rate
        time_name = None if rate else options.time
        self.variables = {
            role: replace(variable, shape=samples.shape, read=samples.copy)
            for role, variable, samples in read_channels(contents, options.names, rate, time_name)
        }
        if "reference" not in self.variables:
            raise DataError(
                f"{self.name}: no channel is called reference or command: name the command of the servo, without which "
                "no estimate in closed loop is right.",
                remedy={"reference": None},
            )
        self.options = settle_position_unit(self.variables, options)
        self.rate = choose_rate(self.variables, source=self.name)
        self._factors = find_factors(self.variables, self.options, source=self.name)
        if TIME in self.variables:
            times = self.variables[TIME]
            self._factors[TIME] = time_factor(times.name, times.unit, source=self.name) or 1.0
        columns = [variable.name for variable in contents.variables]
        self._places = {role: columns.index(self.variables[role].name) for role in self._factors}

    def take(self, rows: np.ndarray) -> Samples:
        """Channels of rows, shape (N, columns)."""
        self.silence = 0.0 if len(rows) else self.silence + WAIT
        return {role: rows[:, place] * self._factors[role] for role, place in self._places.items()}


class StreamSource(Source):
    """A stream of the Lab Streaming Layer, found by its name; its library corrects the stamps for the clocks."""

    def __init__(self, name: str, options: ReadingOptions) -> None:
        lsl = import_lsl()
        for _ in range(SEARCHES):
            found = lsl.resolve_byprop("name", name, minimum=2, timeout=1.0)
            if found:
                break
        if len(found) != 1:
            others = ", ".join(info.name() for info in lsl.resolve_streams())
            raise DataError(
                f"{len(found)} streams are called {name!r}, and one has to be; there are: {others or 'none'}."
            )
        # Not `proc_dejitter`, which smooths gaps away, too.
        flags = lsl.proc_clocksync | lsl.proc_monotonize
        self._inlet = lsl.StreamInlet(found[0], processing_flags=flags, as_numpy=True)
        self._inlet.open_stream(timeout=SEARCHES)
        self._end = lsl.util.LostError
        self._silence = lsl.util.TimeoutError
        contents = StreamContents(self._inlet.info(timeout=10.0), lsl)
        # A channel of times is not read: samples have stamps.
        self.find_channels(contents, options.model_copy(update={"time": None}))

    def __iter__(self) -> Iterator[Samples]:
        """Samples; a stream that ends is waited for, unless it has no identity by which it would be known again."""
        clock = SteadyClock(self.rate)
        while True:
            try:
                rows, stamps = self._inlet.pull_chunk(WAIT, MOST_SAMPLES, min_samples=1)
            except self._silence:
                continue
            except self._end:
                return
            yield {**self.take(rows), TIME: clock.smooth(stamps)}


class SteadyClock:
    """Times that are a sample apart, and follow the stamps slowly; a gap between the stamps stays one.

    Programs send samples in pieces, and stamp them when they send them, which a busy computer does late.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._jitter = JITTER
        self._next = -np.inf  # time of the next sample [s]

    def smooth(self, stamps: np.ndarray) -> np.ndarray:
        """Times of samples by their stamps, both of shape (N,)."""
        times = np.empty(stamps.size)
        slow = 1.0 / (FOLLOWING * self._rate)
        for number, stamp in enumerate(stamps.tolist()):
            late = stamp - self._next
            if abs(late) > max(0.5 / self._rate, BEYOND * self._jitter):
                self._next = stamp
                self._jitter += JITTER
            else:
                self._next += slow * late
                self._jitter = max(abs(late), (1.0 - slow) * self._jitter)
            times[number] = self._next
            self._next += 1.0 / self._rate
        return times


def import_lsl() -> Any:
    """The library of the Lab Streaming Layer, which is optional."""
    try:
        import pylsl
    except (ImportError, OSError, RuntimeError):  # it loads a C library
        raise DataError(
            "streams of the Lab Streaming Layer are read by the package pylsl: install it by: pip install pylsl. On "
            "Linux it needs glibc 2.35 (Ubuntu 22.04, Debian 12), elsewhere a liblsl of your own: PYLSL_LIB names it."
        ) from None
    return pylsl


class StreamContents(Contents):
    """Channels of a stream as its description has them: by label, or by number, from 0."""

    kind = "channels"

    def __init__(self, info: Any, lsl: Any) -> None:
        super().__init__(Path(info.name()))
        self._lsl = lsl
        count = info.channel_count()
        labels = info.get_channel_labels() or map(str, range(count))
        units = info.get_channel_units() or [""] * count
        for label, unit in zip(labels, units, strict=True):
            # Whatever comes is more than a single number.
            self.variables.append(Variable(label, (2,), lambda: np.zeros(2), {"units": unit}))
        self.file_attributes = {"sampling_rate": info.nominal_srate() or None}

    def require(self, name: str) -> Variable:
        """Channel of a label or a number; one that another stream has is refused."""
        variable = self.find(name)
        if variable is not None:
            return variable
        if name.isdecimal() and int(name) < len(self.variables):
            return self.variables[int(name)]
        fault = f"{self.path.name}: there is no channel {name!r}"
        for info in self._lsl.resolve_byprop("desc/channels/channel/label", name, timeout=1.0):
            raise DataError(
                f"{fault}, but the stream {info.name()!r} has one: let one program send all channels in one stream, "
                "where their samples are of the same times."
            )
        raise DataError(
            f"{fault}; the stream has: {self.describe(self.names())}. Name one of these, or its number, from 0."
        )


class TableSource(Source):
    """A CSV file to which another program adds lines, or the same over standard input, which has an end."""

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        lines = iter(sys.stdin) if path == STANDARD_INPUT else follow(path)
        first = list(islice(filter(None, lines), FIRST_LINES))
        self._table = GrowingTable(path, "".join(first).encode())
        self._lines = chain(first[self._table.lines_above :], lines)
        self.find_channels(self._table, options)

    def __iter__(self) -> Iterator[Samples]:
        """Samples, each alone; a cell that is no number is nan."""
        for line in self._lines:
            yield self.take(self._table.parse(line))


def follow(path: Path) -> Iterator[str]:
    """Whole lines of a file that grows; an empty text after a wait in which nothing has come."""
    with open(path, encoding="utf-8-sig") as file:
        line = ""
        while True:
            line += file.readline()
            if line.endswith("\n"):
                yield line
                line = ""
            else:
                time.sleep(WAIT)
                yield ""


class GrowingTable(CsvContents):
    """A table of which the first lines are there, which say how all others are written."""

    @property
    def lines_above(self) -> int:
        """Number of lines above the numbers."""
        return self._last_line

    def parse(self, line: str) -> np.ndarray:
        """Numbers of a line, nan for what is none; shape (1, columns), or (0, columns) where it is empty."""
        columns = len(self.variables)
        cells = line.replace(self._decimal, ".").split(self._delimiter) + [""] * columns
        numbers = pd.to_numeric(cells[:columns], errors="coerce")
        return numbers[np.newaxis] if line.strip() else np.empty((0, columns))
