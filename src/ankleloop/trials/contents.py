"""The contents of an open file: its variables, their parts and attributes, and their samples as numbers.

There is one rule for all files. A container (CSV, MATLAB, HDF5, NetCDF, FLB) is a class of `Contents`, chosen by the
suffix in `trials.reading_process`. Damaged files can kill or halt the process that opens them, so the one that is
started there does, and no other.

A part of a variable has a name of its own: `data[:, 2]` is a column of a matrix, `trial[2].pos` a field of an element
of a struct array, `table.angle` a column of a table. Numbers count from 0; `trial[*].pos` stands for all trials.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count, islice, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.units import normalise_unit

MAX_SAMPLES = 20_000_000  # 160 MB in double precision
LISTED_NAMES = 30  # that a message has
LISTED_SAMPLES = 8  # of a matrix
# What turns samples into numbers with a unit, where no convention says how, and its neutral value.
SCALES = {"conversion": 1.0, "gain": 1.0, "scale": 1.0, "sensitivity": 1.0, "offset": 0.0}
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
        units: dict[str, str] = {}
        for name, value in self.attributes.items():
            word = name.lower()
            is_number = np.asarray(value).dtype.kind in "iuf"
            if word in ("units", "unit"):
                text = str(value) if is_number else as_text(value)
                units[normalise_unit(text)] = text
            elif word in SCALES and is_number and not is_nwb(self.attributes):
                is_neutral = np.all(value == SCALES[word])
                units["" if is_neutral else name] = f"{name} = {value}"
        return " and ".join(text for unit, text in units.items() if unit)


def number_trial(name: str, number: int) -> str:
    """Name of a variable of one trial, where it has a * for all of them."""
    return STAR.sub(rf"\g<1>{number}", name, count=1)


def fold_numbers(names: Iterable[str]) -> list[str]:
    """Names with a * in place of the number of an element, each once."""
    return list(dict.fromkeys(re.sub(r"\[\d+\]", "[*]", name, count=1) for name in names))


def as_text(value: Any) -> str:
    """Text of an attribute, which libraries give as text, bytes or an array of one of them; "" for what is no text."""
    array = np.asarray(value)
    item = array.item() if array.size == 1 else None
    text = item.decode(errors="replace") if isinstance(item, bytes) else item
    return text.strip("\x00 \t\r\n") if isinstance(text, str) else ""


def check_size(samples: int, name: str) -> None:
    """Refuse more samples than are read at once."""
    if samples > MAX_SAMPLES:
        raise DataError(
            f"{name} has {samples:,} samples by its size in the file; at most {MAX_SAMPLES:,} are read as a trial "
            f"({MAX_SAMPLES / 3.6e6:.1f} h at 1 kHz): cut the record; if it is short, the file is damaged."
        )


def list_names(names: Iterable[str]) -> str:
    """The first names of variables, for a message."""
    shown = [name if name.isprintable() else repr(name) for name in islice(names, LISTED_NAMES + 1)]
    text = ", ".join(shown[:LISTED_NAMES])
    if len(shown) > LISTED_NAMES:
        return f"{text} and more"
    return text or "none"


class Contents:
    """Variables and attributes of an open file."""

    kind = "variables"  # what a table or a sequence of cases calls them

    def __init__(self, path: Path) -> None:
        self.path = path
        self.variables: list[Variable] = []
        self.file_attributes: Mapping[str, Any] = {}
        self.warnings: list[str] = []  # for who reads the file

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
        """The first of the variables for which a name has a *, and how many there are; None if there is none."""
        first = self.find(number_trial(name, 0))
        if first is None:
            return None
        numbers = takewhile(lambda number: self.find(number_trial(name, number)), count(1))
        return replace(first, name=name, count=1 + len(list(numbers)))

    def open(self, name: str) -> Variable | None:
        """Variable of a full name, parts of a matrix aside; None if there is none."""
        variables = self._by_name.get(name, [])
        if len(variables) > 1:
            raise DataError(
                f"{self.path.name}: {len(variables)} {self.kind} are called {name!r}: give each a name of its own."
            )
        return variables[0] if variables else None

    def names(self) -> list[str]:
        """Full names of the variables, with a * for the numbers of all trials of MATLAB."""
        names = [name for name in self._by_name if name]
        return fold_numbers(names) if self.path.name.lower().endswith(".mat") else names

    def prefixes(self, name: str) -> list[str]:
        """Starts of names of what a variable may belong to, the nearest first: itself, structs or groups, the file."""
        ends = [match.end() for match in re.finditer(r"[/.\[]", name)]
        return [f"{name}/", *(name[:end] for end in reversed(ends)), ""]

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
        variable = self.find(name) or self.find(name.lstrip("/"))
        if variable is not None:
            return variable
        raise DataError(
            f"{self.path.name}: there is no variable {name!r}; the file has: {self.describe(self.names())}. Name one "
            "of these."
        )

    def describe(self, names: Iterable[str]) -> str:
        """Names of variables for a message, with the shapes and the first samples of those that are no vectors."""
        return list_names(map(self._describe_variable, names))

    def _describe_variable(self, name: str) -> str:
        """Name of a variable with its shape and its first samples, where it is no vector."""
        with suppress(DataError):
            variable = self.find(name)
            if variable is None:
                return name
            if variable.count is not None:
                return f"{name} ({variable.count} of {variable.shape})"
            if variable.is_matrix:
                longest = int(np.argmax(variable.shape))
                first = np.take(self.read_numbers(variable), 0, axis=longest).ravel()
                samples = ", ".join(f"{sample:.3g}" for sample in first[:LISTED_SAMPLES])
                return f"{name} {variable.shape} (first samples {samples})"
        return name

    def find_number(self, prefix: str, name: str) -> Variable | None:
        """Variable of a single value beside others, or else attribute; None if there is neither."""
        full_name = f"{prefix}{name}"
        variable = self.find(full_name)
        if variable is None:
            value = self.attributes(prefix[:-1]).get(name)
            if value is None:
                return None
            variable = Variable(full_name, np.shape(value), lambda: value)
        return variable if math.prod(variable.shape) == 1 else None

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
        check_size(values.size, place)
        numbers = np.array(decode(values, variable.attributes), dtype="<f8", order="C")
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


def is_nwb(attributes: Mapping[str, Any]) -> bool:
    """Whether a scale follows the convention of NWB: in its unit a sample is `stored · conversion + offset`."""
    return "conversion" in attributes and "unit" in attributes


def decode(values: np.ndarray, attributes: Mapping[str, Any]) -> np.ndarray:
    """Apply scale, offset and missing values that the attributes of a variable state, by the conventions of NetCDF.

    A sample is `stored · scale_factor + add_offset`; one that equals `_FillValue` or `missing_value` as stored becomes
    nan. `_Unsigned` turns integers into those without a sign.
    """
    missing = np.zeros(values.shape, dtype=bool)
    for key in ("_FillValue", "missing_value"):
        if key in attributes:
            # Libraries round the markers to the type of the samples.
            missing |= np.isin(values, np.asarray(attributes[key]).astype(values.dtype))
    if as_text(attributes.get("_Unsigned", "")).lower() == "true" and values.dtype.kind == "i":
        # Behind the comparison: the markers have the signed type as stored.
        values = values.view(values.dtype.str.replace("i", "u"))
    names = ("conversion", "offset") if is_nwb(attributes) else ("scale_factor", "add_offset")
    if attributes.keys() & names:
        factor = np.asarray(attributes.get(names[0], 1.0)).item()
        offset = np.asarray(attributes.get(names[1], 0.0)).item()
        values = values.astype(float) * factor + offset
    return np.where(missing, np.nan, values) if missing.any() else values
