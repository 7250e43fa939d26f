"""Tables of text: their columns, and what shows that a file was cut off or is no table."""

from __future__ import annotations

import csv
import gzip
import re
from collections import deque
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.errors import DataError
from ankleloop.trials.contents import Contents, Variable, check_size

LAST_ROWS = 101  # whose digits are compared


class CsvContents(Contents):
    """Columns of a table with commas between its cells and names in its first line, compressed if it ends in .gz.

    A file is refused that is not UTF-8, has no header, a line with more cells than the header, or a last line with
    fewer.
    """

    kind = "columns"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._header: list[str] = []
        self._header_line = 0
        self._rows = 0
        self._longest_row = 0  # cells
        self._last: deque[tuple[int, str]] = deque(maxlen=LAST_ROWS)  # numbered lines
        self._measure()
        for column, name in enumerate(self._header):
            self.variables.append(Variable(name, (self._rows,), partial(self._read, column)))

    def _read(self, column: int) -> np.ndarray:
        """Numbers of a column, or objects where some are text."""
        frame = pd.read_csv(
            self.path, header=None, skiprows=self._header_line, usecols=[column], names=range(self._longest_row),
            index_col=False, skipinitialspace=True,
        )  # fmt: skip
        self._check_last_cell(column)
        return frame[column].to_numpy()

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file: by its line, the header's among them."""
        rows = (
            number for number, line in self._lines() if number > self._header_line and line.strip()
        )
        return f"in line {next(islice(rows, sample, None))}"

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Lines with their numbers."""
        open_text: Any = gzip.open if self.path.name.lower().endswith(".gz") else open
        with open_text(self.path, "rt", encoding="utf-8-sig", errors="surrogateescape") as file:
            yield from enumerate(file, 1)

    def _measure(self) -> None:
        """Count rows and cells; refuse a line that has too many, and a last one that has too few."""
        for number, line in self._lines():
            if wrong := re.search("[\0\udc80-\udcff]", line):
                raise DataError(
                    f"{self.path.name}: line {number} is no text in UTF-8 (byte 0x{ord(wrong[0]) & 0xFF:02x}): save "
                    "it as CSV in UTF-8."
                )
            cells = line.count(",") + 1
            if cells == 1 and not line.strip():
                continue
            if not self._header:
                self._header = _split(line)
                self._header_line = number
                continue
            if cells > len(self._header):
                self._check_cells_beyond(number, line)
            self._longest_row = max(self._longest_row, cells)
            self._rows += 1
            self._last.append((number, line))
        check_size(self._rows, f"{self.path.name}: the table")
        if not self._rows:
            raise DataError(
                f"{self.path.name}: the table has no header in its first line, or no samples below it."
            )
        lengths = [len(_split(line)) for _, line in list(self._last)[-2:]]
        if lengths[-1] < lengths[0]:
            number = self._last[-1][0]
            raise DataError(
                f"{self.path.name}: the last line ({number}) has fewer cells than the one before: the file is cut off; "
                "copy it again, or delete this line."
            )

    def _check_cells_beyond(self, number: int, line: str) -> None:
        """Refuse a line with more cells than the header; empty ones do not count."""
        cells = _split(line)
        width = len(self._header)
        if any(cells[width:]):
            raise DataError(
                f"{self.path.name}: line {number} has {len(cells)} cells and the header {width}: correct the line; "
                "write decimal points, not commas."
            )

    def _check_last_cell(self, column: int) -> None:
        """Refuse, or warn of, a file that ends within its last number, which therefore may have lost digits."""
        number, line = self._last[-1]
        if line.endswith("\n") or column != len(_split(line)) - 1:
            return
        *cells, last_cell = [
            _split(row)[column] for _, row in self._last if row.count(",") >= column
        ]
        usual_decimals = {_count_decimals(cell) for cell in cells}
        decimals = _count_decimals(last_cell)
        if decimals and usual_decimals == {decimals}:
            return  # it is whole
        name = self._header[column]
        fault = f"{self.path.name}: the file ends within line {number}, at the {name} {last_cell!r}"
        if usual_decimals and decimals < min(usual_decimals):
            raise DataError(
                f"{fault}, which has fewer digits than those before: copy the file again, or delete the line."
            )
        self.warnings.append(
            f"{fault}, without an end of the line: if the file was cut off there, this number has lost digits; copy "
            "the file again, or end the line."
        )


def _split(line: str) -> list[str]:
    """Cells of a line."""
    return [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True), [])]


def _count_decimals(text: str) -> int:
    """Digits behind the point."""
    return len(text.lower().partition("e")[0].partition(".")[2])
