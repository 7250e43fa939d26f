"""Tables of text: their columns, and what shows that a file was cut off or is no table."""

from __future__ import annotations

import csv
import gzip
import re
from collections import deque
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.errors import DataError
from ankleloop.trials.channels import Contents, Variable, check_size

LAST = 101  # rows whose digits are compared


class CsvContents(Contents):
    """Columns of a table with commas between its cells and names in its first line, compressed if it ends in .gz.

    A file is refused that is not UTF-8, has no header, a line with more cells than the header, or a last line with
    fewer.
    """

    kind = "columns"

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path, case)
        self._header: list[str] = []
        self._header_line, self._rows, self._longest = 0, 0, 0
        self._last: deque[tuple[int, str]] = deque(maxlen=LAST)  # numbered lines
        self._measure()
        columns = enumerate(self._header)
        self.variables = [
            Variable(name, (self._rows,), partial(self._read, column)) for column, name in columns
        ]

    def _read(self, column: int, part: slice) -> np.ndarray:
        """Numbers of a column, or objects where some are text."""
        frame = pd.read_csv(
            self.path, header=None, skiprows=self._header_line, usecols=[column], names=range(self._longest),
            index_col=False, skipinitialspace=True, skip_blank_lines=True,
        )  # fmt: skip
        self._check_last_cell(column)
        return frame[column].to_numpy()[part]

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file: by its line, the header's among them."""
        samples = (
            number for number, line in self._lines() if number > self._header_line and line.strip()
        )
        return f"in line {next(number for row, number in enumerate(samples) if row == sample)}"

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Lines with their numbers."""
        open_text: Any = gzip.open if self.path.name.lower().endswith(".gz") else open
        with open_text(self.path, "rt", encoding="utf-8-sig", errors="surrogateescape") as file:
            yield from enumerate(file, 1)

    def _measure(self) -> None:
        """Count rows and cells; refuse a line that has too many, and a last one that has too few."""
        for number, line in self._lines():
            if wrong := re.search("[\0\udc80-\udcff]", line):
                fault = f"line {number} is no text in UTF-8 (byte 0x{ord(wrong[0]) & 0xFF:02x})"
                raise DataError(f"{self.path.name}: {fault}: save it as CSV in UTF-8.")
            cells = line.count(",") + 1
            if cells == 1 and not line.strip():
                continue
            if not self._header:
                self._header, self._header_line = _split(line), number
                continue
            width = len(self._header)
            if cells > width and any(_split(line)[width:]):
                raise DataError(
                    f"{self.path.name}: line {number} has {len(_split(line))} cells and the header {width}: correct "
                    "the line; write decimal points, not commas."
                )
            self._longest = max(self._longest, cells)
            self._rows += 1
            self._last.append((number, line))
        check_size(self._rows, f"{self.path.name}: the table")
        if not self._rows:
            raise DataError(
                f"{self.path.name}: the table has no header in its first line, or no samples below it."
            )
        *before, (number, line) = self._last
        if before and len(_split(line)) < len(_split(before[-1][1])):
            raise DataError(
                f"{self.path.name}: the last line ({number}) has fewer cells than the one before: the file is cut off; "
                "copy it again, or delete this line."
            )

    def _check_last_cell(self, column: int) -> None:
        """Refuse, or warn of, a file that ends within its last number, which therefore may have lost digits."""
        number, line = self._last[-1]
        if line.endswith("\n") or column != len(_split(line)) - 1:
            return
        *usual, last = (_split(row)[column] for _, row in self._last if row.count(",") >= column)
        digits, decimals = {_decimals(cell) for cell in usual}, _decimals(last)
        if digits == {decimals} and decimals:
            return  # as many decimals as in the rows before: it is whole
        fault = f"{self.path.name}: the file ends within line {number}, at the {self._header[column]} {last!r}"
        if digits and decimals < min(digits):
            raise DataError(
                f"{fault}, which has fewer digits than those before: copy the file again, or delete the line."
            )
        self.warnings.append(
            f"{fault}, without an end of the line: if the file was cut off there, this number has lost digits; copy "
            "the file again, or end the line."
        )


def _split(line: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True), [])]


def _decimals(text: str) -> int:
    """Digits behind the point."""
    return len(text.lower().partition("e")[0].partition(".")[2])
