"""Tables of text: their columns, and what shows that a file was cut off or is no table."""

from __future__ import annotations

import csv
import gzip
import io
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.channels import check_size

BLOCK = 1 << 20  # bytes that are read at a time
LONGEST_LINE = 1 << 20  # bytes
COMMA, LINE_FEED, QUOTE = b",", b"\n", b'"'
ENCODINGS = {b"\xff\xfe\x00\x00": "UTF-32", b"\x00\x00\xfe\xff": "UTF-32", b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16"}
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class _Extent:
    """What the lines of a table have in common, and its last one."""

    rows: int
    shortest: int  # cells in the row that has fewest
    longest: int
    shortest_line: int
    last_line: int
    last_cells: list[str]
    is_ended: bool  # by the end of a line


class Table:
    """A table of text with commas between its cells and names in its first line.

    Parameters
    ----------
    path : pathlib.Path
        The file, compressed by gzip if it ends in .gz.

    Raises
    ------
    DataError
        If the file is not UTF-8, has no header, a line with more cells than the header, or a last line with fewer.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.header_line, self.names = self._read_header()
        self._extent = self._measure()

    @property
    def rows(self) -> int:
        """Number of rows below the header."""
        return self._extent.rows

    def find_column(self, name: str) -> int | None:
        """Number of a column; None if there is none of this name."""
        columns = [number for number, other in enumerate(self.names) if other == name]
        if len(columns) > 1:
            places = ", ".join(str(column + 1) for column in columns)
            raise DataError(
                f"{self.path.name}: {len(columns)} columns are called {name!r} (columns {places}): give each a name of "
                "its own."
            )
        return columns[0] if columns else None

    def read_columns(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Cells of columns by name: numbers, or objects where some are text."""
        import pandas as pd  # here, because only tables need it

        columns = {name: self._reach_column(name) for name in names}
        extent = self._extent
        if not extent.rows:
            return {name: np.empty(0) for name in names}
        with self._open() as file, warnings.catch_warnings():
            warnings.simplefilter("ignore", pd.errors.DtypeWarning)  # text among numbers is refused by its line
            frame = pd.read_csv(
                file, header=None, skiprows=self.header_line, usecols=sorted(columns.values()),
                names=range(extent.longest), index_col=False, skipinitialspace=True,
            )  # fmt: skip
        if len(frame) != extent.rows:
            raise DataError(
                f"{self.path.name}: there are {extent.rows} lines with samples, but {len(frame)} rows: a quotation "
                "mark is open; remove it."
            )
        for name, column in columns.items():
            self._check_last_cell(name, column)
        return {name: frame[column].to_numpy() for name, column in columns.items()}

    def _reach_column(self, name: str) -> int:
        column, extent = self.find_column(name), self._extent
        if column is None:
            raise DataError(f"{self.path.name}: there is no column {name!r}.")
        if extent.rows and extent.shortest <= column:
            raise DataError(
                f"{self.path.name}: line {extent.shortest_line} has {_count(extent.shortest)} and the header "
                f"{len(self.names)}: {name} is missing there; correct the line."
            )
        return column

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file: by its line, the header's among them."""
        for number, line in self._lines():
            if number > self.header_line and line.strip():
                if sample == 0:
                    return f"in line {number}"
                sample -= 1
        return "behind the last line"

    def _open(self) -> IO[bytes]:
        if self.path.name.lower().endswith(".gz"):
            return io.BufferedReader(gzip.open(self.path, "rb"), BLOCK)
        return open(self.path, "rb")

    def _blocks(self) -> Iterator[tuple[int, bytes]]:
        """Number of the first line, and whole lines ending in line feeds; the last one as it is in the file."""
        number, rest, is_return = 1, b"", False
        with self._open() as file:
            while block := file.read(BLOCK):
                if is_return:  # the other half of \r\n may follow
                    block = b"\r" + block
                is_return = block.endswith(b"\r")
                block = block[:-1] if is_return else block
                if b"\x00" in block:
                    raise DataError(
                        f"{self.path.name}: byte 0 in a table of text: it is no text, or UTF-16; save it as UTF-8."
                    )
                if b"\r" in block:
                    block = block.replace(b"\r\n", LINE_FEED).replace(b"\r", LINE_FEED)
                lines, separator, rest = (rest + block).rpartition(LINE_FEED)
                if len(rest) > LONGEST_LINE:
                    raise DataError(f"{self.path.name}: line {number} is longer than {LONGEST_LINE} bytes: no table.")
                if separator:
                    yield number, lines + separator
                    number += lines.count(LINE_FEED) + 1
        rest += LINE_FEED if is_return else b""
        if rest:
            yield number, rest

    def _lines(self) -> Iterator[tuple[int, bytes]]:
        for first, block in self._blocks():
            lines = block.split(LINE_FEED)
            yield from enumerate(lines[:-1] if block.endswith(LINE_FEED) else lines, start=first)

    def _read_header(self) -> tuple[int, list[str]]:
        with self._open() as file:
            start = file.read(4)
        for mark, encoding in ENCODINGS.items():
            if start.startswith(mark):
                raise DataError(f"{self.path.name}: the text is {encoding}: save it as CSV in UTF-8.")
        for number, line in self._lines():
            text = line.removeprefix(BYTE_ORDER_MARK) if number == 1 else line
            if text.strip():
                return number, self._split(text, number)
        raise DataError(f"{self.path.name}: the table has no header: name its columns in the first line.")

    def _split(self, line: bytes, number: int) -> list[str]:
        self._check_encoding(number, line)
        text = line.decode("utf-8")
        return [cell.strip() for cell in next(csv.reader([text], skipinitialspace=True), [])]

    def _check_encoding(self, first: int, block: bytes) -> None:
        try:
            block.decode("utf-8")
        except UnicodeDecodeError as error:
            line = first + block.count(LINE_FEED, 0, error.start)
            raise DataError(
                f"{self.path.name}: line {line} is not UTF-8 (byte 0x{block[error.start]:02x}): save it as UTF-8."
            ) from None

    def _measure(self) -> _Extent:
        rows, last, last_line = 0, b"", 0
        shortest, shortest_line, longest = len(self.names), 0, 0
        is_ended = True
        for first, block in self._blocks():
            self._check_encoding(first, block)
            numbers, counts, starts = self._count_cells(first, block)
            is_ended = block.endswith(LINE_FEED)
            if not numbers.size:
                continue
            self._check_longest(numbers, counts, starts, block)
            fewest = int(np.argmin(counts))
            if counts[fewest] < shortest:
                shortest, shortest_line = int(counts[fewest]), int(numbers[fewest])
            longest = max(longest, int(counts.max()))
            rows += numbers.size
            check_size(rows, f"{self.path.name}: the table")
            last_line, last = int(numbers[-1]), _line_at(block, starts[-1])
        extent = _Extent(rows, shortest, longest, shortest_line, last_line, self._split(last, last_line), is_ended)
        self._check_last_line(extent)
        return extent

    def _check_last_line(self, extent: _Extent) -> None:
        """Refuse a file that ends within a line before its last cell."""
        expected = min(len(self.names) - (self.names[-1] == ""), extent.longest)
        if len(extent.last_cells) < expected:
            raise DataError(
                f"{self.path.name}: the last line ({extent.last_line}) has {_count(len(extent.last_cells))} and the "
                f"header {len(self.names)}: the file is cut off; copy it again, or delete this line."
            )

    def _count_cells(self, first: int, block: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Number, count of cells and start in the block of each line that has a sample."""
        text = np.frombuffer(block, dtype=np.uint8)
        ends = np.flatnonzero(text == LINE_FEED[0])
        starts = np.concatenate([[0], ends + 1])
        starts = starts[starts < text.size]
        commas = np.searchsorted(np.flatnonzero(text == COMMA[0]), np.append(starts, text.size))
        counts = np.diff(commas) + 1
        blanks = np.searchsorted(np.flatnonzero(text > ord(" ")), np.append(starts, text.size))
        numbers = first + np.arange(starts.size)
        holds_sample = (np.diff(blanks) > 0) & (numbers > self.header_line)
        if QUOTE in block:
            for row in np.flatnonzero(holds_sample):
                line = _line_at(block, starts[row])
                if QUOTE in line:
                    counts[row] = len(self._split(line, int(numbers[row])))
        return numbers[holds_sample], counts[holds_sample], starts[holds_sample]

    def _check_longest(self, numbers: np.ndarray, counts: np.ndarray, starts: np.ndarray, block: bytes) -> None:
        """Refuse a line with more cells than the header, unless they are empty, as commas at its end make them."""
        for row in np.flatnonzero(counts > len(self.names)):
            cells = self._split(_line_at(block, starts[row]), int(numbers[row]))
            if any(cells[len(self.names) :]):
                raise DataError(
                    f"{self.path.name}: line {numbers[row]} has {_count(len(cells))} and the header {len(self.names)}: "
                    "correct the line; write decimal points, not commas."
                )

    def _check_last_cell(self, name: str, column: int) -> None:
        """Refuse, or warn of, a file that ends within its last number, which therefore may have lost digits."""
        extent = self._extent
        if extent.is_ended or column != len(extent.last_cells) - 1:
            return
        text = extent.last_cells[column]
        usual = {_decimals(row[column]) for row in self._last_rows(100)}
        if len(usual) == 1 and usual != {0} and _decimals(text) in usual:
            return  # as many decimals as in the rows before: it is whole
        fault = f"{self.path.name}: the file ends within line {extent.last_line}, at the {name} {text!r}"
        if usual and _decimals(text) < min(usual):
            raise DataError(
                f"{fault}, which has fewer digits than those before: copy the file again, or delete the line."
            )
        warnings.warn(
            f"{fault}, without an end of the line: if the file was cut off there, this number has lost digits; copy "
            "the file again, or end the line.",
            UserWarning,
            stacklevel=2,
        )

    def _last_rows(self, count: int) -> list[list[str]]:
        """Cells of the last rows before the last one."""
        lines: list[tuple[int, bytes]] = []
        for first, block in self._blocks():
            numbers, _, starts = self._count_cells(first, block)
            texts = [_line_at(block, start) for start in starts[-count - 1 :]]
            lines = [*lines, *zip(numbers[-count - 1 :].tolist(), texts, strict=True)][-count - 1 :]
        return [self._split(line, number) for number, line in lines[:-1]]


def _line_at(block: bytes, start: int) -> bytes:
    end = block.find(LINE_FEED, start)
    return block[start:] if end < 0 else block[start:end]


def _decimals(text: str) -> int:
    """Digits behind the point."""
    mantissa = text.lower().partition("e")[0]
    return len(mantissa.partition(".")[2])


def _count(cells: int) -> str:
    return f"{cells} cell" + ("s" if cells != 1 else "")
