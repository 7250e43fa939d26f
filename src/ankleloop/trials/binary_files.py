"""Variables and attributes of HDF5 files (NetCDF-4 and MATLAB v7.3 among them), MATLAB v5 and classic NetCDF."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from ankleloop.errors import DataError
from ankleloop.trials.containers import Contents, Variable, take_samples
from ankleloop.trials.files import UnreadableError

NO_VARIABLE = b"This is a netCDF dimension but not a netCDF variable"


class Hdf5Contents(Contents):
    """Variables of an HDF5 file.

    Links are followed within the file. Samples outside of it (external links, external storage, virtual data sets) are
    refused: HDF5 puts zeros where such a file is missing.
    """

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path, case)
        self.separator = "." if path.name.lower().endswith(".mat") else "/"
        self._file = h5py.File(path, "r")

    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""
        node = self._resolve(name)
        if not isinstance(node, h5py.Dataset) or _is_only_dimension(node):
            return None
        if node.is_virtual or node.external or node.file.filename != self._file.filename:
            raise DataError(
                f"{self.path.name}: the samples of {name} are in other files: copy them into one file, for example by "
                "h5repack or with MATLAB."
            )
        return Variable(
            name, (0,) if node.shape is None else node.shape, lambda part: take_samples(node, part), node.attrs
        )

    def names(self) -> Iterable[str]:
        """Full names of the variables; MATLAB's internals, #refs# and #subsystem#, are left out."""
        names: list[str] = []

        def visit(name: str, node: Any) -> None:
            if isinstance(node, h5py.Dataset) and not name.startswith("#") and not _is_only_dimension(node):
                names.append(name.replace("/", self.separator))

        self._file.visititems(visit)
        return names

    def find_attribute(self, owner: str, name: str) -> Any:
        """Attribute of a variable, a group, or of the file, whose name is empty; None if there is none."""
        node = self._resolve(owner)
        return None if node is None else node.attrs.get(name)

    def _resolve(self, name: str) -> Any:
        """Object of a full name; None if there is none."""
        return self._file.get(name.replace(self.separator, "/") or "/")


def _is_only_dimension(data: h5py.Dataset) -> bool:
    """Whether a data set stands for a dimension of NetCDF that has no variable: its zeros are no times."""
    label = data.attrs.get("NAME", b"")
    return isinstance(label, bytes) and label.startswith(NO_VARIABLE)


class MatContents(Contents):
    """Variables of a MATLAB file before v7.3, those of structs by their full names."""

    separator = "."

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path, case)
        _check_end(path)
        self._top = {name: (tuple(map(int, shape)), kind) for name, shape, kind in scipy.io.whosmat(path, False)}
        self._loaded: dict[str, Any] = {}

    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""
        top = name.split(self.separator, 1)[0]
        shape, kind = self._top.get(top, ((), ""))
        if kind == "struct":
            value = self._fields(top).get(name)
            return None if value is None else Variable(name, np.shape(value), lambda _: value)
        return Variable(name, shape, lambda _: self._load(name)) if name in self._top else None

    def names(self) -> Iterator[str]:
        """Full names of the variables."""
        for name, (_, kind) in self._top.items():
            yield from self._fields(name) if kind == "struct" else (name,)

    def _load(self, top: str) -> Any:
        if top not in self._loaded:
            self._loaded |= scipy.io.loadmat(self.path, None, False, variable_names=[top], simplify_cells=True)
        return self._loaded[top]

    def _fields(self, top: str) -> dict[str, Any]:
        return dict(_flatten_struct({top: self._load(top)}))


def _check_end(path: Path) -> None:
    """Refuse a MATLAB v5 file that ends within a variable: its library leaves out those behind and says nothing."""
    with open(path, "rb") as file:
        order = {b"IM": "little", b"MI": "big"}.get(file.read(128)[126:])
        while order and (tag := file.read(8)):  # the others are v4
            position = file.seek(int.from_bytes(tag[4:], order), 1)  # type: ignore[arg-type]
            if position > path.stat().st_size:
                raise UnreadableError("it ends within a variable")


def _flatten_struct(struct: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in struct.items():
        if isinstance(value, dict):
            yield from _flatten_struct(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


class ClassicNetcdfContents(Contents):
    """Variables of a classic NetCDF file, which has no groups."""

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path, case)
        self._file = scipy.io.netcdf_file(path, "r", mmap=True, maskandscale=False)

    def find(self, name: str) -> Variable | None:
        """Variable of a name; None if there is none."""
        found = self._file.variables.get(name)
        if found is None:
            return None
        return Variable(name, found.data.shape, lambda part: take_samples(found.data, part), found._attributes)

    def names(self) -> Iterable[str]:
        """Names of the variables."""
        return self._file.variables

    def find_attribute(self, owner: str, name: str) -> Any:
        """Attribute of a variable, or of the file, whose name is empty; None if there is none."""
        holder = self._file.variables.get(owner) if owner else self._file
        return None if holder is None else holder._attributes.get(name)
