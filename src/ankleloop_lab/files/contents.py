"""The contents of an open file: its variables, their parts and attributes, and their samples as numbers.

There is one rule for all files. A container, of a format, is a class of `Contents`, chosen by the suffix in
`reading_process`. Damaged files can kill or halt the process that opens them, so the one that is
started there does, and no other.

A part of a variable has a name of its own: `data[:, 2]` is a column of a matrix, `trial[2].pos` a field of an element
of a struct array, `table.angle` a column of a table. Numbers count from 0; `trial[*].pos` stands for all trials.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.units import find_stated_unit, is_nwb
from ankleloop_lab.files.units import normalise

MOST_CHARACTERS = 600  # of the names that a message has
PART = re.compile(r"(.+)\[([\d:, ]+)\]")  # of a matrix
STAR = re.compile(r"(\[[^\[\]]*)\*")


@dataclass(frozen=True)
class Variable:
    """A variable of a file, whose samples are read when they are asked for."""

    name: str  # its full name
    shape: tuple[int, ...]
    read: Callable[[], Any]  # gives all samples as an array of any type
    attributes: Mapping[str, Any] = field(default_factory=dict)
    count: int | None = (
        None  # of the trials for which its name has a *; shape and samples are those of the first
    )

    def __str__(self) -> str:
        """Name for a message, with its shape where it is no vector."""
        name = self.name if self.name.isprintable() else repr(self.name)
        if self.count is not None:
            return f"{name} ({self.count} of {self.shape})"
        return f"{name} {self.shape}" if self.is_matrix else name

    def part(self, text: str) -> Variable:
        """A row, a column or an element, as `:, 2`, with this behind its name."""
        places = [place.strip() for place in text.split(",")]
        index = tuple(slice(None) if place == ":" else int(place) for place in places)
        return replace(
            self,
            name=f"{self.name}[{', '.join(places)}]",
            shape=np.broadcast_to(0, self.shape)[index].shape,
            read=lambda: np.asarray(self.read())[index],
        )

    @property
    def is_matrix(self) -> bool:
        """Whether it has more samples than one for each time."""
        return math.prod(self.shape) > max(self.shape, default=1)

    def name_channel(self) -> str:
        """Name of the first channel of a matrix, along its longest axis, or of the first one of several trials."""
        if self.count is not None:
            return number_trial(self.name, 0)
        places = ["0"] * len(self.shape)
        places[int(np.argmax(self.shape))] = ":"
        return f"{self.name}[{', '.join(places)}]"

    @property
    def unit(self) -> str:
        """Unit that the file states, and a scale without a convention; texts that differ are joined, to be refused."""
        return find_stated_unit(self.attributes, normalise)


def number_trial(name: str, number: int) -> str:
    """Name of a variable of one trial, where it has a * for all of them."""
    return STAR.sub(rf"\g<1>{number}", name, count=1)


class Contents:
    """Variables and attributes of an open file.

    A container fills `variables` when it opens a file, each with the attribute "units" where the file states one, and
    gives the sampling rate [Hz], where it has one for all, as "sampling_rate" of `file_attributes`. It raises
    `UnreadableError` for a file that is damaged, and `DataError`, with advice, for what a user can mend.
    `tdms_files.TdmsContents` is a short example.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.variables: list[Variable] = []
        self.file_attributes: Mapping[str, Any] = {}

    def close(self) -> None:
        """Close the file, where it is open."""

    @cached_property
    def _by_name(self) -> dict[str, list[Variable]]:
        """Variables by full name; damaged and careless files have several of one."""
        variables: dict[str, list[Variable]] = {}
        for variable in self.variables:
            variables.setdefault(variable.name, []).append(variable)
        return variables

    def find(self, name: str) -> Variable | None:
        """Variable, or part of one, of a full name; None if there is none."""
        variable = self.open(name)
        if variable is not None:
            return variable
        if STAR.search(name):
            return self._find_trials(name)
        part = PART.fullmatch(name)
        matrix = self.find(part[1]) if part else None
        if part is None or matrix is None:
            return None
        with suppress(IndexError, ValueError):
            return matrix.part(part[2])
        return None

    def _find_trials(self, name: str) -> Variable | None:
        """The first of the variables for which a name has a *, and how many trials there are; None if there is none.

        Those that lack it are counted: an empty cell hides none behind it, and is refused by its name.
        """
        start = name.partition("*")[0]
        matches = [re.match(rf"{re.escape(start)}(\d+)", other) for other in self._by_name]
        named = 1 + max((int(match[1]) for match in matches if match), default=-1)
        # Rows of a matrix have no names of their own.
        rows = takewhile(lambda number: self.find(number_trial(name, number)), count(named))
        trials = named + len(list(rows))
        variables = (self.find(number_trial(name, number)) for number in range(trials))
        first = next(filter(None, variables), None)
        return first and replace(first, name=name, count=trials)

    def open(self, name: str) -> Variable | None:
        """Variable of a full name, the first one of several, parts of a matrix aside; None if there is none."""
        return self._by_name.get(name, [None])[0]

    def names(self) -> list[str]:
        """Full names of the variables, with a * for the numbers of all trials of MATLAB."""
        names = [name for name in self._by_name if name]
        if self.path.name.lower().endswith(".mat"):
            names = [re.sub(r"\[\d+\]", "[*]", name, count=1) for name in names]
        return list(dict.fromkeys(names))

    def prefixes(self, name: str) -> list[str]:
        """Starts of names of what a variable may belong to, the nearest first: itself, structs or groups, the file."""
        ends = [match.end() for match in re.finditer(r"[/.\[]", name)]
        return [f"{name}/", *(name[:end] for end in reversed(ends)), ""]

    def split_groups(self, name: str) -> list[str]:
        """Names of the groups or structs of a variable, and its own; signs in brackets, and in N.m, are of units."""
        return re.split(r"[/.](?![^(\[]*[)\]]|m\b)", name.rstrip("/."))

    def group_of(self, name: str) -> str:
        """Start of the name of a variable: its struct or group with the sign behind it; empty for the file."""
        return self.prefixes(name)[1]

    def attributes(self, owner: str) -> Mapping[str, Any]:
        """Attributes of a variable, a group, or of the file, whose name is empty."""
        variable = self.open(owner)
        if variable is None:
            return {} if owner else self.file_attributes
        return variable.attributes

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file."""
        return f"at sample {sample}"

    def require(self, name: str) -> Variable:
        """Variable of a name; a leading slash, as HDF5 tools show it, does not matter."""
        same = len(self._by_name.get(name, []))
        if same > 1:
            raise DataError(
                f"{self.path.name}: {same} variables are called {name!r}: give each a name of its own."
            )
        variable = self.find(name) or self.find(name.lstrip("/"))
        if variable is not None:
            return variable
        remark = "; parts are counted from 0, and not from the end" if "[" in name else ""
        raise DataError(
            f"{self.path.name}: there is no variable {name!r}; the file has: {self.describe(self.names())}. Name one "
            f"of these{remark}."
        )

    def describe(self, names: Iterable[str]) -> str:
        """The first variables of some names, for a message."""
        text = ", ".join(str(self.find(name)) for name in names)
        return textwrap.shorten(text, MOST_CHARACTERS, placeholder=" and more") or "none"

    def find_number(self, prefix: str, name: str) -> Variable | None:
        """Variable of a number beside others, in each of its samples or some, or else attribute; None without any."""
        full_name = f"{prefix}{name}"
        variable = self.find(full_name)
        if variable is None:
            value = self.attributes(prefix[:-1]).get(name)
            variable = Variable(full_name, (), lambda: value)
        samples = np.ravel(variable.read()).tolist()
        different = {sample for sample in samples if sample == sample and sample is not None}
        if len(different) != 1:
            return None
        number = different.pop()
        return replace(variable, shape=(), read=lambda: number)

    def read_numbers(self, variable: Variable) -> np.ndarray:
        """Samples of a variable as floating-point numbers, scaled, nan where they are missing."""
        place = f"{self.path.name}: {variable.name}"
        values = np.asarray(variable.read())
        if values.dtype.kind in "OSU":
            self._check_cells(values, place)
        elif values.dtype.kind not in "iuf":
            raise DataError(
                f"{place} is of type {values.dtype}, not real numbers: convert it, or choose another variable."
            )
        numbers = decode(values, variable.attributes)
        # Damaged files have nan that signal an error wherever they are used.
        numbers[np.isnan(numbers)] = np.nan
        return numbers

    def _check_cells(self, cells: np.ndarray, place: str) -> None:
        """Refuse text that is no number."""
        for sample, cell in enumerate(cells.ravel().tolist()):
            try:
                # Python takes 1_0 for 10, as no other program does.
                float("nan" if cell is None else str(cell).replace("_", " "))
            except (TypeError, ValueError):
                raise DataError(
                    f"{place} is not a number {self.locate_sample(sample)} but {cell!r:.60}: correct the file, or "
                    "choose another variable."
                ) from None


def decode(values: np.ndarray, attributes: Mapping[str, Any]) -> np.ndarray:
    """Apply scale, offset and missing values that the attributes of a variable state, by the conventions of NetCDF.

    A sample is `stored · scale_factor + add_offset`; one that equals `_FillValue` or `missing_value` as stored becomes
    nan.
    """
    numbers = np.array(values, dtype="<f8", order="C")
    names = ("conversion", "offset") if is_nwb(attributes) else ("scale_factor", "add_offset")
    if attributes.keys() & names:
        factor, offset = (
            np.asarray(attributes.get(name, usual)).item()
            for name, usual in zip(names, (1.0, 0.0), strict=True)
        )
        numbers = numbers * factor + offset
    for key in ("_FillValue", "missing_value"):
        if key in attributes:
            # Libraries round the markers to the type of the samples.
            marker = np.asarray(attributes[key]).astype(values.dtype)
            numbers[np.isin(values, marker)] = np.nan
    return numbers
