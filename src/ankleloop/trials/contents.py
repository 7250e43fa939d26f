"""The contents of an open file: its variables, their attributes, and their samples as numbers.

There is one rule for all files. A container (CSV, MATLAB, HDF5, NetCDF, FLB) is a class of `Contents`, chosen by the
suffix in `trials.reading_process`. Damaged files can kill or halt the process that opens them, so the one that is
started there does, and no other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.units import normalise_unit

MAX_SAMPLES = 20_000_000  # 160 MB in double precision
LISTED_NAMES = 30  # that a message has


@dataclass(frozen=True)
class Variable:
    """A variable of a file, whose samples are read when they are asked for."""

    name: str  # its full name
    shape: tuple[int, ...]
    read: Callable[[], Any]  # gives all samples as an array of any type
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def unit(self) -> str:
        """Unit that the file states, numbers as text; texts that differ are joined, so that they are refused."""
        units: dict[str, str] = {}
        for name, value in self.attributes.items():
            if name.lower() in ("units", "unit"):
                is_number = np.asarray(value).dtype.kind in "iuf"
                text = str(value) if is_number else as_text(value)
                units[normalise_unit(text)] = text
        return " and ".join(filter(None, units.values()))


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

    separator = "/"  # joins the names of groups or structs
    kind = "variables"  # what a table or a sequence of cases calls them

    def __init__(self, path: Path) -> None:
        self.path = path
        self.variables: list[Variable] = []
        self.warnings: list[str] = []  # for who reads the file

    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""
        places = [
            place for place, variable in enumerate(self.variables, 1) if variable.name == name
        ]
        if len(places) > 1:
            raise DataError(
                f"{self.path.name}: {len(places)} {self.kind} are called {name!r} ({self.kind} "
                f"{', '.join(map(str, places))}): give each a name of its own."
            )
        return self.variables[places[0] - 1] if places else None

    def names(self) -> Iterable[str]:
        """Full names of the variables."""
        return [variable.name for variable in self.variables if variable.name]

    def paths(self) -> Iterable[str]:
        """Full names of the variables, and of what may stand beside them, as groups."""
        return self.names()

    def attributes(self, owner: str) -> Mapping[str, Any]:
        """Attributes of a variable, a group, or of the file, whose name is empty."""
        return {}

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file."""
        return f"at sample {sample}"

    def require(self, name: str) -> Variable:
        """Variable of a name; a leading slash, as HDF5 tools show it, does not matter."""
        variable = self.find(name) or self.find(name.lstrip("/"))
        if variable is None:
            raise DataError(
                f"{self.path.name}: there is no variable {name!r}; the file has: {list_names(self.names())}. Name one "
                "of these."
            )
        return variable

    def join(self, owner: str, name: str) -> str:
        """Full name of a variable of a group; that of the file is empty."""
        return f"{owner}{self.separator}{name}" if owner else name

    def find_number(self, owner: str, name: str) -> Variable | None:
        """Variable of a single value beside others, or else attribute; None if there is neither."""
        full_name = self.join(owner, name)
        variable = self.find(full_name)
        if variable is None:
            value = self.attributes(owner).get(name)
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
                float("nan" if cell is None else cell)
            except (TypeError, ValueError):
                raise DataError(
                    f"{place} is not a number {self.locate_sample(sample)} but {cell!r:.60}: correct the file, or "
                    "choose another variable."
                ) from None


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
    if "scale_factor" in attributes or "add_offset" in attributes:
        factor = np.asarray(attributes.get("scale_factor", 1.0)).item()
        offset = np.asarray(attributes.get("add_offset", 0.0)).item()
        values = values.astype(float) * factor + offset
    return np.where(missing, np.nan, values) if missing.any() else values
