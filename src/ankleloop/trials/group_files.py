"""Files of groups of variables: NetCDF-4, where they are groups, and MATLAB v5, where they are structs."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.trials.files import UnreadableError, atomic_file, write_netcdf
from ankleloop.trials.reading_process import readable_file

SUFFIXES = (".nc", ".mat")


@dataclass(frozen=True)
class Fields:
    """Variables and attributes of a group by name, as they come from a file.

    They are read within `reading_process.name_errors`: a missing name or another shape makes a file unreadable.
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
        return float(self.array(name, 1)[0])

    def text(self, name: str) -> str:
        """A text."""
        return str(self.values[name])


def write_groups(
    groups: Mapping[str, xr.Dataset], path: str | os.PathLike[str], variable: str, *, overwrite: bool = False
) -> None:
    """Write groups of variables to one file; it appears when it is complete."""
    path = _check_suffix(path)
    if path.suffix == ".mat":
        import scipy.io  # here, because its import takes time and workflow jobs do not need it

        structs = {group: _as_struct(data) for group, data in groups.items()}
        struct = structs.pop("", {}) | {group: fields or np.empty((0, 0)) for group, fields in structs.items()}
        with atomic_file(path, overwrite=overwrite) as partial:
            scipy.io.savemat(partial, {variable: struct}, False, do_compression=True, long_field_names=True)
    else:
        write_netcdf({group: _split_complex(data) for group, data in groups.items()}, path, overwrite=overwrite)


def read_groups(path: str | os.PathLike[str], variable: str) -> dict[str, Fields]:
    """Read a file of groups."""
    path = _check_suffix(path)
    with readable_file(path, f"{path.suffix} file", "restore it from a copy, or write it again") as readable:
        contents = _read_mat(readable, variable) if path.suffix == ".mat" else _read_netcdf(readable)
    return {
        group: Fields(
            f"{path.name}, group {group}" if group else path.name,
            {name: _as_value(value) for name, value in fields.items()},
        )
        for group, fields in contents.items()
    }


def _check_suffix(path: str | os.PathLike[str]) -> Path:
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise DataError(f"{path.name}: the file ends in {path.suffix or 'no suffix'}: take {' or '.join(SUFFIXES)}.")
    return path


def _split_complex(data: xr.Dataset) -> xr.Dataset:
    """Complex variables, which NetCDF does not have, with a last dimension of real and imaginary part."""
    pairs = {
        name: xr.Variable((*variable.dims, "part"), np.stack([variable.values.real, variable.values.imag], axis=-1))
        for name, variable in data.data_vars.items()
        if variable.dtype.kind == "c"
    }
    return data.assign(pairs)


def _read_netcdf(path: Path) -> dict[str, dict[str, Any]]:
    import h5netcdf  # here, because its import takes time and workflow jobs do not need it

    with h5netcdf.File(path, phony_dims="access") as file:
        return {
            group: {**node.attrs, **{name: variable[...] for name, variable in node.variables.items()}}
            for group, node in {"": file, **file.groups}.items()
        }


def _as_struct(data: xr.Dataset) -> dict[str, Any]:
    fields = {str(name): float(value) if isinstance(value, int) else value for name, value in data.attrs.items()}
    for name, values in data.variables.items():
        array = values.values
        if array.dtype.kind in "OU":
            array = array.astype(object)
            fields[str(name)] = array.item() if array.ndim == 0 else array[:, None]
            continue
        if array.dtype.kind in "iu":  # MATLAB calculates with doubles, and integers would make integers of them
            array = array.astype(float)
        fields[str(name)] = array[:, None] if array.ndim == 1 else array
    return fields


def _read_mat(path: Path, variable: str) -> dict[str, dict[str, Any]]:
    import scipy.io

    struct = scipy.io.loadmat(path, simplify_cells=True)[variable]
    groups = {"": struct, **{name: value for name, value in struct.items() if isinstance(value, dict)}}
    return {
        group: {name: value for name, value in fields.items() if not isinstance(value, dict)}
        for group, fields in groups.items()
    }


def _as_value(value: Any) -> Any:
    """Plain text of a text, in whatever array it comes."""
    array = np.asarray(value)
    if array.dtype.kind == "U" and array.size == 0:
        return ""
    if array.dtype.kind not in "OSU" or array.size != 1:
        return value
    text = array.item()
    return text.decode() if isinstance(text, bytes) else text
