"""Files that appear under their name only when they are complete."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ankleloop.errors import DataError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["atomic_file", "parse_precision", "write_netcdf"]

PRECISIONS: dict[str, type[np.floating]] = {"double": np.float64, "single": np.float32}


def parse_precision(precision: str) -> type[np.floating]:
    """Type of the floating-point numbers on disk.

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

    Examples
    --------
    >>> parse_precision("single")
    <class 'numpy.float32'>
    """
    if precision not in PRECISIONS:
        raise ValueError(f"unknown precision {precision!r}; known: {', '.join(PRECISIONS)}.")
    return PRECISIONS[precision]


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Provide a temporary path, and move the file to its name if the block ends without an error.

    Parameters
    ----------
    path : path-like
        The file to write, in a folder that exists; a file of this name is replaced.

    Yields
    ------
    pathlib.Path
        Temporary path to write to, in the same folder.

    Raises
    ------
    DataError
        If the folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with atomic_file(f"{folder}/note.txt") as partial:
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


def write_netcdf(
    dataset: xr.Dataset, path: str | os.PathLike[str], encoding: dict[str, dict[str, Any]] | None = None
) -> None:
    """Write a data set as a NetCDF-4 file, which appears when it is complete.

    Parameters
    ----------
    dataset : xarray.Dataset
        The data set.
    path : path-like
        The file to write, in a folder that exists.
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
    with atomic_file(path) as partial:
        dataset.to_netcdf(partial, engine="h5netcdf", encoding=encoding)
