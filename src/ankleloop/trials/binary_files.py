"""Variables and attributes of HDF5 files (NetCDF-4 and MATLAB v7.3 among them), MATLAB v5 and classic NetCDF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from ankleloop.errors import DataError
from ankleloop.trials.containers import Contents, Variable, as_text, raise_type, take_samples

MOST_OBJECTS = 5_000  # that are visited to list the variables
NO_VARIABLE = b"This is a netCDF dimension but not a netCDF variable"


class Hdf5Contents(Contents):
    """Variables of an HDF5 file.

    Soft links are followed within the file. Samples outside of it (external links, external storage, virtual data
    sets) are refused: HDF5 puts zeros where such a file is missing.
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
        if node.is_virtual or node.external:
            raise DataError(
                f"{self.path.name}: the samples of {name} are in other files: copy them into one file, for example by "
                "h5repack or with MATLAB."
            )
        attributes = node.attrs
        kind = as_text(attributes.get("MATLAB_class", ""))
        # For an empty array MATLAB stores its size instead, which would pass for samples.
        if node.shape is None or np.any(attributes.get("MATLAB_empty", 0)):
            return Variable(name, (0,), lambda _: np.empty(0), attributes)

        def read(part: slice) -> Any:
            if kind in ("char", "logical"):  # which MATLAB stores as numbers
                raise_type(self.path.name, name, kind)
            return take_samples(node, part)

        return Variable(name, node.shape, read, attributes)

    def names(self) -> Iterator[str]:
        """Full names of the variables; MATLAB's internals, #refs# and #subsystem#, are left out."""
        names: list[str] = []
        visited = iter(range(MOST_OBJECTS))

        def visit(name: str, node: Any) -> bool | None:
            if isinstance(node, h5py.Dataset) and not name.startswith("#") and not _is_only_dimension(node):
                names.append(name.replace("/", self.separator))
            return None if next(visited, None) is not None else True

        self._file.visititems(visit)
        yield from names

    def find_attribute(self, owner: str, name: str) -> Any:
        """Attribute of a variable, a group, or of the file, whose name is empty; None if there is none."""
        node = self._resolve(owner)
        return None if node is None else node.attrs.get(name)

    def _resolve(self, name: str) -> Any:
        """Object of a full name; None if there is none."""
        path = name.replace(self.separator, "/")
        if not path.strip("/"):
            return self._file
        link = self._file.get(path, getlink=True)
        if link is None:
            return None
        if isinstance(link, h5py.ExternalLink):
            raise DataError(
                f"{self.path.name}: {name} is a link to {link.path} in another file, {link.filename}: read that."
            )
        try:
            node = self._file[path]
        except KeyError:
            if not isinstance(link, h5py.SoftLink):
                raise
            raise DataError(
                f"{self.path.name}: {name} is a link to {link.path!r}, which is not in the file: copy the file again, "
                "or name another variable."
            ) from None
        if node.file.filename != self._file.filename:
            raise DataError(f"{self.path.name}: {name} is in another file, {node.file.filename}: read that.")
        return node


def _is_only_dimension(data: h5py.Dataset) -> bool:
    """Whether a data set stands for a dimension of NetCDF that has no variable: its zeros are no times."""
    label = data.attrs.get("NAME", b"")
    return isinstance(label, bytes) and label.startswith(NO_VARIABLE)


class MatContents(Contents):
    """Variables of a MATLAB file before v7.3, those of structs by their full names."""

    separator = "."

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path, case)
        _check_elements(path)
        self._top = {name: (tuple(map(int, shape)), kind) for name, shape, kind in scipy.io.whosmat(path, False)}
        self._loaded: dict[str, Any] = {}

    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""
        top = name.split(self.separator, 1)[0]
        shape, kind = self._top.get(top, ((), ""))
        if kind == "struct":
            value = self._fields(top).get(name)
            return None if value is None else Variable(name, np.shape(value), lambda _: value)
        if name not in self._top:
            return None
        if kind in ("logical", "sparse"):  # which become numbers, or an object, once they are loaded
            return Variable(name, shape, lambda _: raise_type(self.path.name, name, kind))
        return Variable(name, shape, lambda _: self._value(name))

    def names(self) -> Iterator[str]:
        """Full names of the variables."""
        for name, (_, kind) in self._top.items():
            yield from self._fields(name) if kind == "struct" else (name,)

    def load(self, names: Sequence[str]) -> None:
        """Load several variables in one pass over the file."""
        tops = {name.split(self.separator, 1)[0] for name in names} - {*self._loaded}
        if tops:
            self._loaded |= scipy.io.loadmat(self.path, None, False, variable_names=sorted(tops), simplify_cells=True)

    def _value(self, top: str) -> Any:
        self.load([top])
        return self._loaded[top]

    def _fields(self, top: str) -> dict[str, Any]:
        return dict(_flatten_struct({top: self._value(top)}))


def _check_elements(path: Path) -> None:
    """Refuse a MATLAB v5 file that ends within a variable: its library leaves out those behind and says nothing."""
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

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path, case)
        with open(path, "rb") as file:
            if file.read(4) == b"CDF\x05":
                raise DataError(f"{path.name}: classic NetCDF with 64-bit data: convert it by nccopy -k nc4.")
        self._file = scipy.io.netcdf_file(path, "r", mmap=True, maskandscale=False)
        if self._file._recs < 0:
            raise DataError(f"{path.name}: the number of records is not known: it is still written, or damaged.")

    def find(self, name: str) -> Variable | None:
        """Variable of a name; None if there is none."""
        found = self._file.variables.get(name)
        if found is None:
            return None
        return Variable(name, found.data.shape, lambda part: take_samples(found.data, part), found._attributes)

    def names(self) -> Iterator[str]:
        """Names of the variables."""
        yield from self._file.variables

    def find_attribute(self, owner: str, name: str) -> Any:
        """Attribute of a variable, or of the file, whose name is empty; None if there is none."""
        holder = self._file.variables.get(owner) if owner else self._file
        return None if holder is None else holder._attributes.get(name)
