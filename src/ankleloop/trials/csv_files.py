"""Tables of text: their columns, and what shows that a file was cut off or is no table."""

from __future__ import annotations

import csv
import gzip
import re
import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pandas as pd

from ankleloop.errors import DataError
from ankleloop.trials.channels import check_size
from ankleloop.trials.containers import Contents, Variable

BLOCK = 1 << 20  # characters that are read at a time
LONGEST_LINE = 1 << 20  # characters
LAST = 101  # rows whose digits are compared
ENCODINGS = {b"\xff\xfe\x00\x00": "UTF-32", b"\x00\x00\xfe\xff": "UTF-32", b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16"}


class CsvContents(Contents):
    """Columns of a table with commas between its cells and names in its first line, compressed if it ends in .gz.

    A file is refused that is not UTF-8, has no header, a line with more cells than the header, or a last line with
    fewer.
    """

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path, case)
        self._columns: dict[str, np.ndarray] = {}
        self._header_line, self._header = self._read_header()
        self._rows, self._longest, self._is_ended = 0, 0, True
        self._shortest, self._shortest_line = len(self._header), 0
        self._last: deque[tuple[int, str]] = deque(maxlen=LAST)  # numbered lines
        self._measure()

    def find(self, name: str) -> Variable | None:
        """Column of a name; None if there is none."""
        columns = [number for number, other in enumerate(self._header, 1) if other == name]
        if len(columns) > 1:
            places = ", ".join(map(str, columns))
            raise DataError(
                f"{self.path.name}: {len(columns)} columns are called {name!r} (columns {places}): give each a name of "
                "its own."
            )
        return Variable(name, (self._rows,), lambda part: self._read(name)[part]) if columns else None

    def names(self) -> Iterator[str]:
        """Names of the columns."""
        yield from (name for name in self._header if name)

    def load(self, names: Sequence[str]) -> None:
        """Read columns in one pass: numbers, or objects where some are text."""
        columns = {name: self._header.index(name) for name in names}
        for name, column in columns.items():
            if self._rows and self._shortest <= column:
                raise DataError(
                    f"{self.path.name}: line {self._shortest_line} has {_count(self._shortest)} and the header "
                    f"{len(self._header)}: {name} is missing there; correct the line."
                )
        if not self._rows:
            self._columns |= {name: np.empty(0) for name in names}
            return
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pd.errors.DtypeWarning)  # text among numbers is refused by its line
            frame = pd.read_csv(
                self.path, header=None, skiprows=self._header_line, usecols=sorted(columns.values()),
                names=range(self._longest), index_col=False, skipinitialspace=True,
            )  # fmt: skip
        if len(frame) != self._rows:
            raise DataError(
                f"{self.path.name}: there are {self._rows} lines with samples, but {len(frame)} rows: a quotation "
                "mark is open; remove it."
            )
        for name, column in columns.items():
            self._check_last_cell(name, column)
            self._columns[name] = frame[column].to_numpy()

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file: by its line, the header's among them."""
        for number, line in self._lines():
            if number > self._header_line and line.strip():
                if sample == 0:
                    return f"in line {number}"
                sample -= 1
        return "behind the last line"

    def _read(self, name: str) -> np.ndarray:
        if name not in self._columns:
            self.load([name])
        return self._columns[name]

    def _open(self) -> TextIO:
        open_text: Any = gzip.open if self.path.name.lower().endswith(".gz") else open
        file: TextIO = open_text(self.path, "rt", encoding="utf-8-sig", errors="surrogateescape")
        return file

    def _blocks(self) -> Iterator[tuple[int, str]]:
        """Pieces of the text that end with a line, and the numbers of their first lines."""
        first = 1
        with self._open() as file:
            while text := file.read(BLOCK):
                rest = file.readline(LONGEST_LINE)
                text += rest
                self._is_ended = text.endswith("\n")
                if len(rest) == LONGEST_LINE:
                    number = first + text.count("\n")
                    raise DataError(f"{self.path.name}: line {number} is longer than {LONGEST_LINE} bytes: no table.")
                if "\0" in text:
                    raise DataError(
                        f"{self.path.name}: byte 0 in a table of text: it is no text, or UTF-16; save it as UTF-8."
                    )
                if not text.isascii():
                    self._check_encoding(first, text)
                yield first, text
                first += text.count("\n")

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Lines with their numbers."""
        for first, text in self._blocks():
            yield from enumerate(text.removesuffix("\n").split("\n"), first)

    def _check_encoding(self, first: int, text: str) -> None:
        wrong = re.search("[\udc80-\udcff]", text)
        if wrong:
            line, byte = first + text.count("\n", 0, wrong.start()), ord(wrong[0]) - 0xDC00
            raise DataError(f"{self.path.name}: line {line} is not UTF-8 (byte 0x{byte:02x}): save it as UTF-8.")

    def _read_header(self) -> tuple[int, list[str]]:
        with self._open() as file:
            start = file.buffer.read(4)
        for mark, encoding in ENCODINGS.items():
            if start.startswith(mark):
                raise DataError(f"{self.path.name}: the text is {encoding}: save it as CSV in UTF-8.")
        for number, line in self._lines():
            if line.strip():
                return number, _split(line)
        raise DataError(f"{self.path.name}: the table has no header: name its columns in the first line.")

    def _measure(self) -> None:
        """Count rows and cells; refuse a line that has too many, and a last one that has too few."""
        width = len(self._header)
        for first, text in self._blocks():
            lines = text.removesuffix("\n").split("\n")
            characters = np.frombuffer(text.encode(), np.uint8)
            starts = np.append(0, np.flatnonzero(characters == ord("\n")) + 1)[: len(lines)]
            counts = np.add.reduceat(characters == ord(","), starts, dtype=int) + 1
            unusual = (counts != width) | (counts == 1) | ('"' in text)
            for row in np.flatnonzero(unusual):
                counts[row] = self._count_cells(first + int(row), lines[row])
            counts[: max(0, self._header_line + 1 - first)] = 0
            samples = np.flatnonzero(counts)
            self._rows += samples.size
            check_size(self._rows, f"{self.path.name}: the table")
            self._longest = max(self._longest, int(counts.max()))
            self._last.extend((first + int(row), lines[row]) for row in samples[-LAST:])
        if self._last:
            number, line = self._last[-1]
            cells = len(_split(line))
            if cells < min(width - (self._header[-1] == ""), self._longest):
                raise DataError(
                    f"{self.path.name}: the last line ({number}) has {_count(cells)} and the header {width}: the file "
                    "is cut off; copy it again, or delete this line."
                )

    def _count_cells(self, number: int, line: str) -> int:
        """Cells of a row, 0 of a line without samples; a row may have more than the header if they are empty."""
        if number <= self._header_line or not line.strip():
            return 0
        cells, width = _split(line), len(self._header)
        if any(cells[width:]):
            raise DataError(
                f"{self.path.name}: line {number} has {_count(len(cells))} and the header {width}: correct the line; "
                "write decimal points, not commas."
            )
        if len(cells) < self._shortest:
            self._shortest, self._shortest_line = len(cells), number
        return len(cells)

    def _check_last_cell(self, name: str, column: int) -> None:
        """Refuse, or warn of, a file that ends within its last number, which therefore may have lost digits."""
        *before, (number, line) = self._last
        cells = _split(line)
        if self._is_ended or column != len(cells) - 1:
            return
        decimals = _decimals(cells[column])
        usual = {_decimals(_split(row)[column]) for _, row in before}
        if len(usual) == 1 and usual != {0} and decimals in usual:
            return  # as many decimals as in the rows before: it is whole
        fault = f"{self.path.name}: the file ends within line {number}, at the {name} {cells[column]!r}"
        if usual and decimals < min(usual):
            raise DataError(
                f"{fault}, which has fewer digits than those before: copy the file again, or delete the line."
            )
        warnings.warn(
            f"{fault}, without an end of the line: if the file was cut off there, this number has lost digits; copy "
            "the file again, or end the line.",
            UserWarning,
            stacklevel=2,
        )


def _split(line: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True), [])]


def _decimals(text: str) -> int:
    """Digits behind the point."""
    mantissa = text.lower().partition("e")[0]
    return len(mantissa.partition(".")[2])


def _count(cells: int) -> str:
    return f"{cells} cell" + ("s" if cells != 1 else "")
