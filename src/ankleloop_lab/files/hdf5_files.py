"""HDF5 files: those of NetCDF-4 are among them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ankleloop.options import as_text
from ankleloop.trials.readable_files import check_place
from ankleloop_lab.files.contents import Contents, Variable

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"


class Hdf5Contents(Contents):
    """Variables of an HDF5 file, of which links are followed within the file."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._file = h5py.File(path, "r")
        self._file.visititems(self._add)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _add(self, name: str, node: Any) -> None:
        """Add a variable."""
        self.variables += self._list_variables(name, node)

    def _list_variables(self, name: str, node: Any) -> list[Variable]:
        """The variable of a data set, or one for each field of records; none for a dimension of NetCDF."""
        is_data = isinstance(node, h5py.Dataset)
        if not is_data or as_text(node.attrs.get("NAME")).startswith(NO_VARIABLE):
            return []
        shape = (0,) if node.shape is None else node.shape

        def read(key: Any) -> np.ndarray:
            check_place(self.path, name, node, self._file)
            samples: np.ndarray = node[key]
            return samples

        if node.dtype.names:
            return [
                Variable(f"{name}.{field}", shape + node.dtype[field].shape, partial(read, field))
                for field in node.dtype.names
            ]
        return [Variable(name, shape, partial(read, ...), node.attrs)]

    def open(self, name: str) -> Variable | None:
        """Variable of a full name, also behind a link; None if there is none."""
        variable = super().open(name)
        if variable is not None:
            return variable
        linked = self._list_variables(name, self._file.get(name))
        return next((variable for variable in linked if variable.name == name), None)

    def attributes(self, owner: str) -> Mapping[str, Any]:
        """Attributes of a variable, a group, or of the file, whose name is empty."""
        return getattr(self._file.get(owner or "/"), "attrs", {})
