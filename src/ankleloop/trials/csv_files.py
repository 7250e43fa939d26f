"""Tables of text: their columns, how their cells are written, and what shows that a file was cut off or is no table."""

from __future__ import annotations

import codecs
import csv
import gzip
import re
from collections import deque
from collections.abc import Iterator, Sequence, Set
from functools import partial
from itertools import islice, takewhile, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.errors import DataError
from ankleloop.trials.contents import Contents, Variable, check_size
from ankleloop.trials.units import is_unit

LAST_ROWS = 101  # whose digits are compared
FIRST_LINES = 1000  # in which the names and the first numbers are
DELIMITERS = {";": "semicolons", "\t": "tabs", ",": "commas"}
NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?|[-+]?inf|nan|n/?a|null", re.IGNORECASE)


class CsvContents(Contents):
    """Columns of a table with names above them, in UTF-8 or UTF-16, compressed if it ends in .gz.

    A file is refused that is no text, has no names, a line with more cells than there are names, or a last line with
    fewer.
    """

    kind = "columns"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with self._open("rb") as file:
            is_utf_16 = file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
        self._encoding = "utf-16" if is_utf_16 else "utf-8-sig"
        self._rows = 0
        self._longest_row = 0  # cells
        self._last: deque[tuple[int, str]] = deque(maxlen=LAST_ROWS)  # numbered lines
        units = self._find_names(list(islice(self._lines(), FIRST_LINES)))
        self._measure()
        for column, (name, unit) in enumerate(zip_longest(self._names, units, fillvalue="")):
            read = partial(self._read, column)
            self.variables.append(Variable(name, (self._rows,), read, {"units": unit}))

    def _find_names(self, lines: Sequence[tuple[int, str]]) -> list[str]:
        """Find delimiter and names of the table, by its first lines; the units of its columns, if a row has them.

        The delimiter is the one that gives most numbers in a line far down. The numbers begin with the first line that
        has two or more of them, and no text where that line has numbers. The names are in the line above, or in the one
        before it where the line above has units.
        """
        model = lines[-2 if len(lines) > 2 else -1][1] if lines else ""
        numbers = {sign: _find_numbers(_split(model, sign)) for sign in DELIMITERS}
        self._delimiter = max(numbers, key=lambda sign: len(numbers[sign]))
        columns = numbers[self._delimiter]
        above = list(takewhile(lambda line: not self._has_numbers(line[1], columns), lines))
        if not above or len(above) == len(lines):
            raise DataError(
                f"{self.path.name}: there are no names above numbers with {DELIMITERS[self._delimiter]} between them: "
                "write names into the line above the numbers, as time_s, angle_rad, torque_nm."
            )
        # Between commas they may be those of thousands.
        self._decimal = "," if "," in model and self._delimiter != "," else "."
        self._last_line = above[-1][0]  # above the numbers
        self._names_line, line = above.pop()
        names = _split(line, self._delimiter)
        units: list[str] = []
        if above and any(map(is_unit, names)):
            units = names
            self._names_line, line = above.pop()
            names = _split(line, self._delimiter)
        self._names = [names[0].lstrip("#% "), *names[1:]]
        return units

    def _has_numbers(self, line: str, columns: Set[int]) -> bool:
        """Whether a line has two or more numbers, and no text in some columns."""
        cells = _split(line, self._delimiter)
        numbers = _find_numbers(cells)
        return len(numbers) > 1 and not any(
            cells[place] for place in columns - numbers if place < len(cells)
        )

    def prefixes(self, name: str) -> list[str]:
        """Columns are in no groups, whatever their names have."""
        return [f"{name}/", ""]

    def find_number(self, prefix: str, name: str) -> Variable | None:
        """A column that has one number in all of its rows, or in some."""
        variable = self.find(name)
        cells = np.empty(0) if variable is None else variable.read()
        different = pd.unique(cells[~pd.isna(cells)])
        return Variable(name, (1,), lambda: different) if different.size == 1 else None

    def _read(self, column: int) -> np.ndarray:
        """Numbers of a column, or objects where some are text."""
        frame = pd.read_csv(
            self.path, header=None, skiprows=self._last_line, usecols=[column], names=range(self._longest_row),
            index_col=False, skipinitialspace=True, sep=self._delimiter, decimal=self._decimal,
            encoding=self._encoding,
        )  # fmt: skip
        self._check_last_cell(column)
        return frame[column].to_numpy()

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file: by its line, those above the numbers among them."""
        rows = (number for number, _ in self._lines() if number > self._last_line)
        return f"in line {next(islice(rows, sample, None))}"

    def _open(self, mode: str, **options: Any) -> Any:
        """The file, of which gzip takes off the compression."""
        open_file: Any = gzip.open if self.path.name.lower().endswith(".gz") else open
        return open_file(self.path, mode, **options)

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Lines that are not empty, with their numbers."""
        with self._open("rt", encoding=self._encoding, errors="surrogateescape") as file:
            for number, line in enumerate(file, 1):
                if wrong := re.search("[\0\udc80-\udcff]", line):
                    raise DataError(
                        f"{self.path.name}: line {number} is no text in UTF-8 (byte 0x{ord(wrong[0]) & 0xFF:02x}): "
                        "save it as CSV in UTF-8."
                    )
                if line.strip():
                    yield number, line

    def _measure(self) -> None:
        """Count rows and cells; refuse a line that has too many, and a last one that has too few."""
        for number, line in self._lines():
            if number <= self._last_line:
                continue
            cells = line.count(self._delimiter) + 1
            if '"' in line:
                cells = len(_split(line, self._delimiter))
            if cells > len(self._names):
                self._check_cells_beyond(number, line)
            self._longest_row = max(self._longest_row, cells)
            self._rows += 1
            self._last.append((number, line))
        check_size(self._rows, f"{self.path.name}: the table")
        lengths = [len(_split(line, self._delimiter)) for _, line in list(self._last)[-2:]]
        if lengths[-1] < lengths[0]:
            number = self._last[-1][0]
            raise DataError(
                f"{self.path.name}: the last line ({number}) has fewer cells than the one before: the file is cut off; "
                "copy it again, or delete this line."
            )

    def _check_cells_beyond(self, number: int, line: str) -> None:
        """Refuse a line with more cells than the names; empty ones do not count."""
        cells = _split(line, self._delimiter)
        width = len(self._names)
        if any(cells[width:]):
            raise DataError(
                f"{self.path.name}: line {number} has {len(cells)} cells and the header {width}, which is taken to be "
                f"line {self._names_line}, with {DELIMITERS[self._delimiter]} between the cells: correct the line "
                "that is wrong; write decimal points, not commas."
            )

    def _check_last_cell(self, column: int) -> None:
        """Refuse, or warn of, a file that ends within its last number, which therefore may have lost digits."""
        number, line = self._last[-1]
        if line.endswith("\n") or column != len(_split(line, self._delimiter)) - 1:
            return
        rows = [_split(row, self._delimiter) for _, row in self._last]
        *cells, last_cell = [row[column] for row in rows if len(row) > column]
        usual_decimals = {_count_decimals(cell) for cell in cells}
        decimals = _count_decimals(last_cell)
        if decimals and usual_decimals == {decimals}:
            return  # it is whole
        name = self._names[column]
        fault = f"{self.path.name}: the file ends within line {number}, at the {name} {last_cell!r}"
        if usual_decimals and decimals < min(usual_decimals):
            raise DataError(
                f"{fault}, which has fewer digits than those before: copy the file again, or delete the line."
            )
        self.warnings.append(
            f"{fault}, without an end of the line: if the file was cut off there, this number has lost digits; copy "
            "the file again, or end the line."
        )


def _find_numbers(cells: Sequence[str]) -> set[int]:
    """Places of the cells that are numbers."""
    return {place for place, cell in enumerate(cells) if NUMBER.fullmatch(cell)}


def _split(line: str, delimiter: str) -> list[str]:
    """Cells of a line."""
    cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    return [cell.strip() for cell in cells]


def _count_decimals(text: str) -> int:
    """Digits behind the point or comma."""
    mantissa = text.lower().partition("e")[0]
    return len(mantissa.replace(",", ".").partition(".")[2])
