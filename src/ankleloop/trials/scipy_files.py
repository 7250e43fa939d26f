"""Variables and attributes of the files that scipy reads: MATLAB before v7.3, and classic NetCDF."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from ankleloop.errors import DataError
from ankleloop.trials.channel_files import Contents, Variable, raise_type, take_samples


class MatContents(Contents):
    """Variables of a MATLAB file before v7.3, those of structs by their full names; each is loaded alone."""

    separator = "."

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        _check_elements(path)
        variables = scipy.io.whosmat(path, appendmat=False)
        self._counts = Counter(name for name, _, _ in variables)
        self._top = {name: (tuple(map(int, shape)), kind) for name, shape, kind in variables}
        self._loaded: dict[str, Any] = {}

    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""
        top = name.split(self.separator, 1)[0]
        if top not in self._top:
            return None
        if self._counts[top] > 1:
            raise DataError(f"{self.path.name}: there are several variables {top!r}: save the file again with one.")
        shape, kind = self._top[top]
        if kind == "struct":
            value = self._fields(top).get(name)
            return None if value is None else Variable(name, np.shape(value), lambda _: value)
        if name != top:
            return None
        if kind in ("logical", "sparse"):  # which become numbers, or an object, once they are loaded
            return Variable(name, shape, lambda _: raise_type(self.path.name, name, kind))
        return Variable(name, shape, lambda _: self._value(top))

    def names(self) -> Iterator[str]:
        """Full names of the variables."""
        for name, (_, kind) in self._top.items():
            yield from self._fields(name) if kind == "struct" else (name,)

    def load(self, names: Sequence[str]) -> None:
        """Load several variables in one pass over the file."""
        tops = {name.split(self.separator, 1)[0] for name in names} - {*self._loaded}
        if tops:
            loaded = scipy.io.loadmat(self.path, appendmat=False, variable_names=sorted(tops), simplify_cells=True)
            self._loaded |= loaded

    def _value(self, top: str) -> Any:
        self.load([top])
        return self._loaded[top]

    def _fields(self, top: str) -> dict[str, Any]:
        return dict(_flatten_struct({top: self._value(top)}))


def _check_elements(path: Path) -> None:
    """Refuse a MATLAB v5 file that ends within a variable: its library leaves out the variables behind, in silence."""
    size = path.stat().st_size
    with open(path, "rb") as file:
        order = {b"IM": "little", b"MI": "big"}.get(file.read(128)[126:128])
        if order is None:  # of v4
            return
        position = 128
        while position < size:
            tag = file.read(8)
            count = int.from_bytes(tag[4:8], order)  # type: ignore[arg-type]
            if len(tag) < 8 or position + 8 + count > size:
                raise DataError(
                    f"{path.name}: cannot be read as .mat (it ends within the variable at byte {position}): "
                    "check that the file is whole."
                )
            position = file.seek(position + 8 + count)


def _flatten_struct(struct: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in struct.items():
        if isinstance(value, dict):
            yield from _flatten_struct(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


class ClassicNetcdfContents(Contents):
    """Variables of a classic NetCDF file, which has no groups."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with open(path, "rb") as file:
            if file.read(4) == b"CDF\x05":
                raise DataError(f"{path.name}: classic NetCDF with 64-bit data: convert it by nccopy -k nc4.")
        self._file = scipy.io.netcdf_file(path, "r", mmap=True, maskandscale=False)
        if self._file._recs < 0:
            raise DataError(f"{path.name}: the number of records is not known: it is still written, or damaged.")

    def find(self, name: str) -> Variable | None:
        """Variable of a name; None if there is none."""
        variable = self._file.variables.get(name)
        if variable is None:
            return None
        # A copy, because arrays on the file do not outlive it.
        return Variable(
            name, variable.data.shape, lambda part: np.array(take_samples(variable.data, part)), variable._attributes
        )

    def names(self) -> Iterator[str]:
        """Names of the variables."""
        yield from self._file.variables

    def find_attribute(self, owner: str, name: str) -> Any:
        """Attribute of a variable, or of the file, whose name is empty; None if there is none."""
        holder = self._file.variables.get(owner) if owner else self._file
        return None if holder is None else holder._attributes.get(name)
