"""Files that appear whole or not at all."""

import os
import uuid
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ankleloop.errors import DataError

__all__ = ["number_type", "whole_file", "write_netcdf"]

PRECISIONS = {"double": np.float64, "single": np.float32}


def number_type(precision):
    """Type of floating-point numbers on disk.

    Parameters
    ----------
    precision : {"double", "single"}
        Single takes half the space and rounds to 6e-8 of a value, where a 16-bit converter rounds to 1.5e-5 of its
        range.

    Returns
    -------
    type

    Raises
    ------
    ValueError
        For an unknown precision.
    """
    if precision not in PRECISIONS:
        raise ValueError(f"unknown precision {precision!r}; known: {', '.join(PRECISIONS)}.")
    return PRECISIONS[precision]


@contextmanager
def whole_file(path):
    """Give a temporary path, and move it to its name once the block has ended without an error.

    Parameters
    ----------
    path : path-like
        The file to write, in a folder that exists; a file of this name is replaced.

    Yields
    ------
    pathlib.Path
        Where to write, in the same folder.

    Raises
    ------
    DataError
        If the folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with whole_file(f"{folder}/note.txt") as partial:
    ...         _ = partial.write_text("complete")
    ...     Path(f"{folder}/note.txt").read_text()
    'complete'
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise DataError(f"{path}: there is no folder {path.parent}: make it first.")
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}.part")
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def write_netcdf(dataset, path, encoding=None):
    """Write a data set as NetCDF-4, whole or not at all.

    Parameters
    ----------
    dataset : xarray.Dataset
        What to write.
    path : path-like
        Where.
    encoding : dict, optional
        Encoding by variable, as `xarray.Dataset.to_netcdf` takes it.

    Raises
    ------
    DataError
        If the folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> import xarray as xr
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_netcdf(xr.Dataset(attrs={"subject": "S1"}), f"{folder}/empty.nc")
    ...     [file.name for file in Path(folder).iterdir()]
    ['empty.nc']
    """
    with whole_file(path) as partial:
        dataset.to_netcdf(partial, engine="h5netcdf", encoding=encoding)
