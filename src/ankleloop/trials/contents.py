"""Variables and attributes of an open file, whatever its format."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ankleloop.errors import DataError

LISTED = 100  # names of variables that an error message lists


@dataclass(frozen=True)
class Variable:
    """A variable of a file, whose samples are read when they are asked for."""

    name: str  # its full name
    shape: tuple[int, ...]  # its shape in the file
    read: Callable[[slice], Any]  # gives the samples of a slice as an array of any type
    attributes: Mapping[str, Any] = field(default_factory=dict)  # its attributes

    @property
    def size(self) -> int:
        """Number of its samples, by its shape."""
        return math.prod(self.shape)


class Contents(ABC):
    """Variables and attributes of an open file."""

    separator = "/"  # joins the names of groups or structs

    def __init__(self, path: Path) -> None:
        self.path = path

    @abstractmethod
    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""

    @abstractmethod
    def names(self) -> Iterator[str]:
        """Full names of the variables, for messages."""

    def find_attribute(self, owner: str, name: str) -> Any:
        """Attribute of a variable, a group, or of the file, whose name is empty; None if there is none."""
        return None

    def load(self, names: Sequence[str]) -> None:  # noqa: B027 # most formats have nothing to prepare
        """Prepare to read variables, where a pass over the file reads several."""

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file."""
        return f"at sample {sample}"

    def close(self) -> None:  # noqa: B027
        """Close the file."""

    def require(self, name: str) -> Variable:
        """Variable of a name; a leading slash, as HDF5 tools show it, does not matter."""
        variable = self.find(name) or self.find(name.lstrip("/"))
        if variable is not None:
            return variable
        known = [name if name.isprintable() else repr(name) for name in islice(self.names(), LISTED + 1)]
        listed = ", ".join(known[:LISTED]) + (" and more" if len(known) > LISTED else "")
        raise DataError(
            f"{self.path.name}: there is no variable {name!r}; the file has: {listed or 'none'}. Name one of these."
        )

    def find_nearest(self, names: Sequence[str], variable: str, *, scalar: bool) -> Variable | None:
        """First variable or attribute of these names: at a variable, beside it, or further up."""
        groups = variable.split(self.separator)
        for depth in range(len(groups), -1, -1):
            owner = self.separator.join(groups[:depth])
            for name in names:
                full = self.separator.join([*groups[:depth], name])
                candidate = self.find_number(owner, name, full) if scalar else self.find(full)
                if candidate is not None and (scalar or candidate.size != 1):
                    return candidate
        return None

    def find_number(self, owner: str, name: str, full: str) -> Variable | None:
        """Variable of a single value, or else attribute; None if there is neither."""
        variable = self.find(full)
        if variable is None and (value := self.find_attribute(owner, name)) is not None:
            variable = Variable(full, np.shape(value), lambda _: value)
        return variable if variable is not None and variable.size == 1 else None


def take_samples(samples: Any, part: slice) -> Any:
    """Samples of a slice along the only axis that has several; all of what has no such axis."""
    if part == slice(None):
        return samples[...]
    return samples[0, part] if len(samples.shape) == 2 and samples.shape[0] == 1 else samples[part]


def raise_type(source: str, name: str, kind: object) -> NoReturn:
    """Refuse a variable that is not of real numbers."""
    raise DataError(f"{source}: {name} is of type {kind}, not real numbers: convert it, or choose another variable.")
