"""Where the samples of a subject come from while he moves: a stream, a table of text that grows, standard input.

Channels, units and rates follow from names and descriptions by the rules of files.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.errors import DataError
from ankleloop_lab.files.channels import TIME, read_channels
from ankleloop_lab.files.contents import Contents, Variable
from ankleloop_lab.files.csv_files import CsvContents
from ankleloop_lab.files.reading import find_factors, read_clock
from ankleloop_lab.files.reading_options import ReadingOptions

STANDARD_INPUT = Path("-")
WAIT = 0.1  # s for new samples
SEARCH = 60.0  # s, until there is a stream
JITTER_DEVIATIONS = 5.0  # standard deviations of the first stamps, within which others jitter
FIRST_LINES = 100  # of a table, which tell its rate

# Position [rad], torque [N·m], reference [rad] and, where the source has any, times [s] by name, each of shape (N,).
Samples = dict[str, np.ndarray]


class Source(Contents, Iterable[Samples]):
    """What sends samples, and has named columns as a file has.

    Iterating over it gives samples as they come, none after a wait in which none came.
    """

    rate: float  # Hz
    jitter = 0.0  # of times [s]
    silence = 0.0  # s without samples

    def find_channels(self, options: ReadingOptions) -> None:
        """Find the columns of the channels, and their units, from what the source says of itself."""
        source = self.path.name
        channels = read_channels(self, options.names, options.sampling_rate, options.time)
        variables = {
            role: replace(variable, read=samples.copy) for role, variable, samples in channels
        }
        if "reference" not in variables:
            raise DataError(
                f"{source}: no channel is called reference or command: name the command of the servo, without which no "
                "estimate in closed loop is right.",
                remedy={"reference": None},
            )
        units = options.find_units(variables, source=source)
        clock = read_clock(variables, source=source)
        self.rate = clock.rate
        self.jitter = max(self.jitter, JITTER_DEVIATIONS * clock.jitter / clock.rate)
        self._factors = find_factors(variables, units, options, source=source)
        columns = list(self._by_name)
        self._places = {role: columns.index(variables[role].name) for role in self._factors}
        names = [f"{role} {variable.name}" for role, variable in variables.items()]
        self.summary = (
            f"{source}, {self.rate:g} Hz, position in {units['position'].name}: {', '.join(names)}"
        )

    def take(self, rows: np.ndarray) -> Samples:
        """Channels of rows, shape (N, columns)."""
        self.silence = 0.0 if len(rows) else self.silence + WAIT
        return {role: rows[:, place] * self._factors[role] for role, place in self._places.items()}


class StreamSource(Source):
    """A stream of the Lab Streaming Layer, found by its name; its library corrects the stamps for the clocks.

    Its description has the labels of the channels, which are numbers, from 0, where there are none.
    """

    # Programs send samples in pieces, and stamp them when they send them, which a busy computer does late.
    jitter = 0.05

    def __init__(self, name: str, options: ReadingOptions) -> None:
        super().__init__(Path(name))
        self._lsl = import_lsl()
        self._lsl.resolve_byprop("name", name, timeout=SEARCH)
        streams = self._lsl.resolve_streams()
        names = [stream.name() for stream in streams]
        if names.count(name) != 1:
            raise DataError(
                f"{names.count(name)} streams are called {name!r}, and one has to be; there are: {names}."
            )
        self._inlet = self._lsl.StreamInlet(
            streams[names.index(name)],
            processing_flags=self._lsl.proc_clocksync,  # `proc_dejitter` smooths gaps away, too
            as_numpy=True,
        )
        info = self._inlet.info(SEARCH)
        count = info.channel_count()
        labels = info.get_channel_labels() or map(str, range(count))
        units = info.get_channel_units() or [""] * count
        for label, unit in zip(labels, units, strict=True):
            # Whatever comes is more than a single number.
            self.variables.append(Variable(label, (2,), partial(np.zeros, 2), {"units": unit}))
        self.file_attributes = {"sampling_rate": info.nominal_srate() or None}
        # A channel of times is not read: samples have stamps.
        self.find_channels(options.model_copy(update={"time": None}))

    def require(self, name: str) -> Variable:
        """Channel of a label or a number; one of another stream is refused."""
        if name.isdecimal() and not self.find(name):
            name = dict(enumerate(self._by_name)).get(int(name), name)
        return super().require(name)

    def __iter__(self) -> Iterator[Samples]:
        """Samples; a stream that ends is waited for, unless it has no identity by which it would be known again."""
        while True:
            try:
                rows, stamps = self._inlet.pull_chunk(WAIT, min_samples=1)
            except self._lsl.util.TimeoutError:
                continue
            except self._lsl.util.LostError:
                return
            yield {**self.take(rows), TIME: stamps}


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


class TableSource(Source, CsvContents):
    """A CSV file to which another program adds lines, or the same over standard input, which has an end.

    Its first lines say how all others are written.
    """

    def __init__(self, path: Path, options: ReadingOptions) -> None:
        lines = iter(sys.stdin) if path == STANDARD_INPUT else follow(path)
        first = list(islice(filter(None, lines), FIRST_LINES))
        super().__init__(path, "".join(first).encode())
        self._new_lines = chain(first[self._last_line :], lines)
        self.find_channels(options)

    def __iter__(self) -> Iterator[Samples]:
        """Samples, each alone; a cell that is no number is nan, and a line without all cells is left out."""
        columns = len(self.variables)
        for line in self._new_lines:
            cells = line.replace(self._decimal, ".").split(self._delimiter.strip(" ") or None)
            rows = np.empty((0, columns))
            if len(cells) >= columns:
                rows = pd.to_numeric(cells[:columns], errors="coerce")[np.newaxis]
            yield self.take(rows)


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
