"""Tables of text: their columns, how their cells are written, and what shows that a file was cut off or is no table."""

from __future__ import annotations

import csv
import gzip
import io
import re
from collections import deque
from collections.abc import Iterator, Sequence, Set
from functools import partial
from itertools import islice, takewhile, zip_longest
from pathlib import Path

import numpy as np
import pandas as pd

from ankleloop.errors import DataError
from ankleloop.signals.sampling import rate_of_interval
from ankleloop_lab.files.channels import channel_of
from ankleloop_lab.files.contents import Contents, Variable
from ankleloop_lab.files.units import parse_unit, seconds_of

LAST_LINES = 100  # whose digits are compared
FIRST_LINES = 1000  # in which the names and the first numbers are
FIRST_BYTES = 10_000  # in which a text of LabChart has its titles
IN_DEGREES = "inDegrees"  # in the lines above the names of a file of OpenSim
DELIMITERS = {";": "semicolons", "\t": "tabs", ",": "commas", " ": "blanks"}
ANY_DELIMITER = "semicolons, tabs, commas or blanks"
TITLES = "ChannelTitle="  # before the names of a text of LabChart
COMMENT = re.compile(rb"\t#\*[^\r\n]*")  # at the end of its lines
NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?|[-+]?inf|nan|n/?a|null", re.IGNORECASE)


class CsvContents(Contents):
    """Columns of a table with names above them, in UTF-8, UTF-16 or cp1252, compressed if it ends in .gz.

    A file is refused that has no names, a line with more cells than there are names, or a last line that is cut off.
    """

    def __init__(self, path: Path, content: bytes | None = None) -> None:
        super().__init__(path)
        if content is None:
            content = path.read_bytes()
        is_compressed = path.name.lower().endswith(".gz")
        self._content = gzip.decompress(content) if is_compressed else content
        if TITLES.encode() in self._content[:FIRST_BYTES]:
            self._content = COMMENT.sub(b"", self._content)
        self._encoding = "utf-16" if b"\0" in self._content[:4] else "utf-8-sig"
        try:
            self._content.decode(self._encoding)
        except UnicodeError:
            self._encoding = "cp1252"  # of spreadsheets
        first_lines = list(islice(self._lines(), FIRST_LINES))
        units = self._find_names(first_lines)
        self._check_end()
        widths = [len(_split(line, self._delimiter)) for _, line in first_lines]
        table = self._read(max(widths))
        for column, (name, unit) in enumerate(zip_longest(self._names, units, fillvalue="")):
            cells = table[column].to_numpy()
            read = partial(np.asarray, cells)
            self.variables.append(Variable(name, cells.shape, read, {"units": unit}))

    def _text(self) -> io.TextIOWrapper:
        """The text of the file; what is none in it is no number either."""
        return io.TextIOWrapper(io.BytesIO(self._content), self._encoding, "replace")

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Lines that are not empty, with their numbers."""
        return ((number, line) for number, line in enumerate(self._text(), 1) if line.strip())

    def _find_names(self, lines: Sequence[tuple[int, str]]) -> list[str]:
        """Find delimiter and names of the table, by its first lines; the units of its columns, if a row has them.

        The delimiter is the one that gives most numbers in a line far down. The numbers begin with the first line that
        has two or more of them, and no text where that line has numbers. The names are in the line above, or in the one
        before it where the line above has units; of two rows of names in the one that says more channels.
        """
        model = lines[-2 if len(lines) > 2 else -1][1] if lines else ""
        numbers = {sign: _find_numbers(_split(model, sign)) for sign in DELIMITERS}
        self._delimiter = max(numbers, key=lambda sign: len(numbers[sign]))
        columns = numbers[self._delimiter]
        above = list(takewhile(lambda line: not self._has_numbers(line[1], columns), lines))
        if not above or len(above) == len(lines):
            signs = DELIMITERS[self._delimiter] if columns else ANY_DELIMITER
            raise DataError(
                f"{self.path.name}: there are no names above numbers with {signs} between them: write names into the "
                "line above the numbers, as time_s, angle_rad, torque_nm."
            )
        # Between commas they may be those of thousands.
        self._decimal = "," if "," in model and self._delimiter != "," else "."
        self._last_line = above[-1][0]  # above the numbers
        if any(line.startswith(TITLES) for _, line in above):
            return self._read_labchart(above, len(_split(model, self._delimiter)))
        self._names_line, line = above.pop()
        self._names = self._split_names(line)
        units: list[str] = []
        if above and _are_units(self._names):
            units = self._names
            self._names_line, line = above.pop()
            self._names = self._split_names(line)
        if above:  # there may be a second row of names
            number, line = above[-1]
            names = self._split_names(line)
            is_row = len(names) == len(self._names)
            if is_row and self._count_channels(names) > self._count_channels(self._names):
                self._names_line, self._names = number, names
        if self._delimiter == " " and len(self._names) != len(_split(model, " ")):
            raise DataError(
                f"{self.path.name}: there are blanks between the numbers, and more or fewer names in line "
                f"{self._names_line}: write semicolons, tabs or commas between both, or names without blanks."
            )
        settings = dict(line.strip().partition("=")[::2] for _, line in above)
        if IN_DEGREES in settings:  # of coordinates of OpenSim: those that are called an angle
            unit = "deg" if settings[IN_DEGREES] == "yes" else "rad"
            positions = [channel_of(self, name) == "position" for name in self._names]
            units = [unit if is_position else "" for is_position in positions]
        return units

    def _count_channels(self, names: Sequence[str]) -> int:
        """How many channels some names say."""
        return len({channel_of(self, name) for name in names} - {None})

    def _split_names(self, line: str) -> list[str]:
        """Names in a line, which may begin with the sign of a comment."""
        return _split(line.strip("\r\n").lstrip("#% "), self._delimiter)

    def _read_labchart(self, above: Sequence[tuple[int, str]], width: int) -> list[str]:
        """Names, units and interval of a text of LabChart, whose first column, the times, may be left out."""
        rows = {}
        for number, line in above:
            title, *cells = _split(line, "\t")
            rows[title] = cells
            if title == TITLES:
                self._names_line = number
        names, units = rows[TITLES], rows.get("UnitName=", [])
        interval = rows.get("Interval=", [""])[0].split()
        if len(interval) == 2 and NUMBER.fullmatch(interval[0]):
            step = float(interval[0].replace(",", ".")) * (seconds_of(interval[1]) or 0.0)
            self.file_attributes = {"sampling_rate": rate_of_interval(step)} if step > 0.0 else {}
        has_times = width > len(names)
        self._names = ["time", *names] if has_times else names
        return ["s", *units] if has_times else units

    def _has_numbers(self, line: str, columns: Set[int]) -> bool:
        """Whether a line has two or more numbers, and no text in some columns."""
        cells = _split(line, self._delimiter)
        numbers = _find_numbers(cells)
        return len(numbers) > 1 and not any(
            cells[place] for place in columns - numbers if place < len(cells)
        )

    def _check_end(self) -> None:
        """Refuse a last line that has fewer cells than the one before, or ends within a number, with fewer digits."""
        last_lines = deque(self._lines(), LAST_LINES)
        # The first one is above the numbers, or one of many.
        lines = [line for number, line in last_lines if number >= self._last_line]
        *rows, last = [_split(line, self._delimiter) for line in lines]
        decimals = [_count_decimals(row[-1]) for row in rows[1:] if len(row) == len(last)]
        has_lost_digits = _count_decimals(last[-1]) < min(decimals, default=0)
        is_ended = lines[-1].endswith("\n")
        if len(last) < len(rows[-1]) or (has_lost_digits and not is_ended):
            raise DataError(
                f"{self.path.name}: the last line has fewer cells or digits than those before: the file is cut off; "
                "copy it again, or delete this line."
            )

    def _read(self, width: int) -> pd.DataFrame:
        """The cells below the names: numbers of a column, or objects where some are text."""
        names = range(max(width, len(self._names)))
        text = self._text()
        for _ in range(self._last_line):  # pandas would count what stands between quotes as one
            next(text)
        table = pd.read_csv(
            text,
            header=None,
            names=names,
            index_col=False,
            skipinitialspace=True,
            sep=r"\s+" if self._delimiter == " " else self._delimiter,
            decimal=self._decimal,
        )
        beyond = table.iloc[:, len(self._names) :].notna().any(axis=1)
        if beyond.any():
            raise DataError(
                f"{self.path.name}: there are more cells than names {self.locate_sample(int(beyond.argmax()))}; the "
                f"names are taken to be in line {self._names_line}, with {DELIMITERS[self._delimiter]} between the "
                "cells: correct the line that is wrong; write decimal points, not commas."
            )
        return table

    def prefixes(self, name: str) -> list[str]:
        """Columns are in no groups, whatever their names have."""
        return [f"{name}/", ""]

    def split_groups(self, name: str) -> list[str]:
        """Columns are in no groups, whatever their names have."""
        return [name]

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file: by its line, those above the numbers among them."""
        rows = (number for number, _ in self._lines() if number > self._last_line)
        return f"in line {next(islice(rows, sample, None))}"


def _find_numbers(cells: Sequence[str]) -> set[int]:
    """Places of the cells that are numbers."""
    return {place for place, cell in enumerate(cells) if NUMBER.fullmatch(cell)}


def _split(line: str, delimiter: str) -> list[str]:
    """Cells of a line."""
    if delimiter == " ":
        line = line.strip()
    cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    return [cell.strip() for cell in cells]


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a row has units: most of its cells that are not empty."""
    filled = [cell for cell in cells if cell]
    return 2 * sum(parse_unit(cell) is not None for cell in filled) > len(filled)


def _count_decimals(text: str) -> int:
    """Digits behind the point or comma."""
    mantissa = text.lower().partition("e")[0]
    return len(mantissa.replace(",", ".").partition(".")[2])
