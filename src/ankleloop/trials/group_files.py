"""Files of groups of variables: NetCDF-4, where they are groups, and MATLAB v5, where they are structs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.options import as_text
from ankleloop.trials.files import PathLike, UnreadableError, atomic_file, write_netcdf
from ankleloop.trials.readable_files import readable_file

GROUP_SUFFIXES = (".nc", ".mat")


@dataclass(frozen=True)
class Fields:
    """Variables and attributes of a group by name, as they come from a file.

    They are read within `readable_files.name_errors`: a missing name or another shape makes a file unreadable.
    """

    source: str  # the file and the group, for messages
    values: Mapping[str, Any]  # arrays, numbers and texts

    def array(self, name: str, *shape: int, finite: bool = True) -> np.ndarray:
        """Numbers of a shape, in the order of C; without a shape a vector."""
        numbers = np.array(self.values[name], dtype=float, order="C").reshape(shape or -1)
        if finite and not np.isfinite(numbers).all():
            raise UnreadableError(f"{name!r} is not finite")
        return numbers

    def number(self, name: str) -> float:
        """A single number."""
        return self.array(name, 1).item()

    def text(self, name: str) -> str:
        """A text."""
        return as_text(self.values[name])


def write_groups(
    groups: Mapping[str, xr.Dataset], path: PathLike, variable: str, *, overwrite: bool = False
) -> None:
    """Write groups of variables to one file; it appears when it is complete."""
    path = _check_suffix(path)
    if path.suffix == ".nc":
        write_netcdf(groups, path, overwrite=overwrite)
        return
    # Here, because its import takes time and workflow jobs do not need it.
    from scipy.io import savemat

    structs = {group: _as_struct(data) for group, data in groups.items()}
    struct = structs.pop("", {})
    struct |= {group: fields or np.empty((0, 0)) for group, fields in structs.items()}
    with atomic_file(path, overwrite=overwrite) as partial:
        savemat(
            partial,
            {variable: struct},
            appendmat=False,
            do_compression=True,
            long_field_names=True,
            oned_as="column",
        )


def read_groups(path: PathLike, variable: str) -> dict[str, Fields]:
    """Read a file of groups."""
    path = _check_suffix(path)
    with readable_file(
        path, f"{path.suffix} file", "restore it from a copy, or write it again"
    ) as readable:
        is_mat = path.suffix == ".mat"
        groups = _read_mat(readable, variable) if is_mat else _read_netcdf(readable)
    return {
        group: Fields(f"{path.name}, group {group}" if group else path.name, values)
        for group, values in groups.items()
    }


def _check_suffix(path: PathLike) -> Path:
    """Refuse a file of another format."""
    path = Path(path)
    if path.suffix not in GROUP_SUFFIXES:
        raise DataError(
            f"{path.name}: the file ends in {path.suffix or 'no suffix'}: take {' or '.join(GROUP_SUFFIXES)}."
        )
    return path


def _read_netcdf(path: Path) -> dict[str, dict[str, Any]]:
    """Attributes and variables of the groups of a NetCDF-4 file."""
    # Here, because its import takes time and workflow jobs do not need it.
    import h5netcdf

    with h5netcdf.File(path, phony_dims="access") as file:
        groups = {}
        for group, node in {"": file, **file.groups}.items():
            variables = {name: variable[...] for name, variable in node.variables.items()}
            groups[group] = {**node.attrs, **variables}
        return groups


def _as_struct(data: xr.Dataset) -> dict[str, Any]:
    """Fields of a struct: MATLAB calculates with doubles, and integers would make integers of them."""
    fields = {}
    for name, value in data.attrs.items():
        fields[str(name)] = float(value) if isinstance(value, int) else value
    for name, variable in data.variables.items():
        is_text = variable.dtype.kind in "OU"
        array = variable.values.astype(object if is_text else float)
        fields[str(name)] = array if array.ndim else array.item()
    return fields


def _read_mat(path: Path, variable: str) -> dict[str, dict[str, Any]]:
    """A struct of a MATLAB file, and the structs within it by name."""
    import scipy.io

    struct = scipy.io.loadmat(path, simplify_cells=True)[variable]
    structs = {name: fields for name, fields in struct.items() if isinstance(fields, dict)}
    return {"": struct, **structs}
