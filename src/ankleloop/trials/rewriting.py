"""Contents of a file written anew, so that what is damaged or unusual in it stays behind.

Damaged files can kill or halt the process that opens them, so these functions run in the process of
`ankleloop.trials.reading_server`, and in no other.
"""

from __future__ import annotations

from pathlib import Path

import h5netcdf
import h5py
import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.files import FULL
from ankleloop.trials.sink import Sink


def rewrite(path: Path, copy: Path) -> None:
    """Read a NetCDF-4 file or a MATLAB file, and write its contents to another file."""
    try:
        if path.suffix == ".mat":
            _rewrite_matlab(path, copy)
        else:
            _rewrite_netcdf(path, copy)
    except OSError as cause:
        if cause.errno not in FULL:
            raise
        raise DataError(
            f"{path}: the file is read by way of a copy, for which the disk of {copy.parent} is too small: free space "
            "there, or choose another folder by the environment variable TMPDIR."
        ) from cause


def _rewrite_matlab(path: Path, copy: Path) -> None:
    import scipy.io

    contents = scipy.io.loadmat(path, appendmat=False)
    variables = {name: value for name, value in contents.items() if not name.startswith("__")}
    scipy.io.savemat(copy, variables, appendmat=False, long_field_names=True)


def _rewrite_netcdf(path: Path, copy: Path) -> None:
    with (
        h5netcdf.File(path, "r", phony_dims="access") as source,
        Sink(copy) as sink,
        h5netcdf.File(sink, "w", invalid_netcdf=True) as target,
    ):
        _copy_group(source, target)


def _copy_group(source: h5netcdf.Group, target: h5netcdf.Group) -> None:
    """Write attributes, dimensions, variables and groups of a group into an empty one, one variable after the other."""
    target.attrs.update(dict(source.attrs))
    dimensions = {name: variable.dimensions for name, variable in source.variables.items()}  # which names those without
    for name, dimension in source.dimensions.items():
        if name not in target.dimensions:  # as those of the groups around it are
            target.dimensions[name] = dimension.size
    for name, variable in source.variables.items():
        _copy_variable(variable, target, name, dimensions[name])
    for name, group in source.groups.items():
        _copy_group(group, target.create_group(name))


def _copy_variable(variable: h5netcdf.Variable, target: h5netcdf.Group, name: str, dimensions: tuple[str, ...]) -> None:
    data = variable._h5ds
    if data.is_virtual or data.external:  # HDF5 puts zeros where such a file is missing
        raise ValueError(f"the samples of {name} are in other files")
    values, attributes = np.asarray(variable[...]), dict(variable.attrs)
    fill_value = attributes.pop("_FillValue", None)
    kind = h5py.string_dtype() if values.dtype.kind == "O" else values.dtype
    copy = target.create_variable(name, dimensions, kind, data=values, fillvalue=fill_value)
    copy.attrs.update(attributes)
