"""Variables and attributes of HDF5 files, those of NetCDF-4 and MATLAB v7.3 among them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.channel_files import Contents, Variable, as_text, raise_type, take_samples

MOST_LINKS = 20  # soft links on the way to a variable
MOST_OBJECTS = 5_000  # that are visited to list the variables
MOST_LEVELS = 50
NO_VARIABLE = b"This is a netCDF dimension but not a netCDF variable"


class Hdf5Contents(Contents):
    """Variables of an HDF5 file.

    Soft links are followed within the file. Samples outside of it (external links, external storage, virtual data
    sets) are refused: HDF5 puts zeros where such a file is missing.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.separator = "." if path.name.lower().endswith(".mat") else "/"
        self._file = h5py.File(path, "r")

    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""
        node = self._resolve(name)
        if not isinstance(node, h5py.Dataset) or _is_only_dimension(node):
            return None
        attributes = node.attrs
        kind = as_text(attributes.get("MATLAB_class", ""))
        if kind in ("char", "logical"):  # which MATLAB stores as numbers
            return Variable(name, node.shape, lambda _: raise_type(self.path.name, name, kind), attributes)
        # For an empty array MATLAB stores its size instead, which would pass for samples.
        if node.shape is None or np.any(attributes.get("MATLAB_empty", 0)):
            return Variable(name, (0,), lambda _: np.empty(0), attributes)
        return Variable(name, node.shape, lambda part: take_samples(self._inside(node, name), part), attributes)

    def names(self) -> Iterator[str]:
        """Full names of the variables; MATLAB's internals, #refs# and #subsystem#, are left out."""
        yield from self._walk(self._file, "", set(), 0)

    def _walk(self, group: h5py.Group, prefix: str, visited: set[int], depth: int) -> Iterator[str]:
        for part in group:
            # External links and dangling ones are no objects of this file.
            if part.startswith("#") or isinstance(group.get(part, getlink=True), h5py.ExternalLink):
                continue
            item = group.get(part)
            address = 0 if item is None else h5py.h5o.get_info(item.id).addr
            if item is None or address in visited or len(visited) > MOST_OBJECTS:
                continue
            visited.add(address)
            if isinstance(item, h5py.Dataset) and not _is_only_dimension(item):
                yield f"{prefix}{part}"
            elif isinstance(item, h5py.Group) and depth < MOST_LEVELS:
                yield from self._walk(item, f"{prefix}{part}{self.separator}", visited, depth + 1)

    def find_attribute(self, owner: str, name: str) -> Any:
        """Attribute of a variable, a group, or of the file, whose name is empty; None if there is none."""
        node = self._resolve(owner)
        return None if node is None else node.attrs.get(name)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _resolve(self, name: str) -> Any:
        """Object of a full name; None if there is none."""
        parts = name.split(self.separator)[::-1]
        node: Any = self._file
        links, last_link, behind = 0, "", 0  # soft links, the path of the last one, and parts behind that path
        while parts:
            part = parts.pop()
            if part in ("", "."):
                continue
            link = node.get(part, getlink=True) if isinstance(node, h5py.Group) else None
            if isinstance(link, h5py.ExternalLink):
                raise DataError(
                    f"{self.path.name}: {name} is a link to {link.path} in another file, {link.filename}: read that."
                )
            if isinstance(link, h5py.SoftLink):
                links, last_link, behind = links + 1, link.path, len(parts)
                if links > MOST_LINKS:
                    raise DataError(f"{self.path.name}: {name} is a link that leads to itself: name another variable.")
                node = self._file if link.path.startswith("/") else node
                parts += link.path.split("/")[::-1]
            elif link is None:
                if last_link and len(parts) >= behind:
                    raise DataError(
                        f"{self.path.name}: {name} is a link to {last_link!r}, which is not in the file: copy the file "
                        "again, or name another variable."
                    )
                return None
            else:
                node = node[part]
        return node

    def _inside(self, data: h5py.Dataset, name: str) -> h5py.Dataset:
        if data.is_virtual or data.external:
            raise DataError(
                f"{self.path.name}: the samples of {name} are in other files: copy them into one file, for example by "
                "h5repack or with MATLAB."
            )
        return data


def _is_only_dimension(data: h5py.Dataset) -> bool:
    """Whether a data set stands for a dimension of NetCDF that has no variable: its zeros are no times."""
    label = data.attrs.get("NAME", b"")
    return isinstance(label, bytes) and label.startswith(NO_VARIABLE)
