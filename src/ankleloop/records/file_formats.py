"""Variables and attributes of data files: CSV, MATLAB (v5 and v7.3), HDF5 and NetCDF."""

from __future__ import annotations

import csv
import gzip
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import scipy.io
import xarray as xr

from ankleloop.errors import DataError

__all__ = ["FileContents", "read_contents"]


@dataclass
class FileContents:
    """All variables and attributes of a file, without nesting.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    variables : dict of str to object
        Variables by full name, in which the separator joins the names of groups or structs.
    attributes : dict of str to object
        Attributes by full name, that is below the name of the variable or group that they belong to.
    separator : str
        What joins the names.

    Examples
    --------
    >>> contents = FileContents(Path("a.h5"), {"ankle/position": [0.0, 0.1]}, {"ankle/position/units": "rad"})
    >>> contents.find_variable("/ankle/position"), contents.find_unit("ankle/position")
    ('ankle/position', 'rad')
    """

    path: Path
    variables: dict[str, Any] = field(default_factory=dict)
    attributes: dict[str, Any] = field(default_factory=dict)
    separator: str = "/"

    @property
    def is_csv(self) -> bool:
        """Whether the file is a table of text."""
        return self.path.name.lower().endswith((".csv", ".csv.gz"))

    def find_variable(self, name: str) -> str:
        """Full name of a variable; a leading slash, as HDF5 tools show it, does not matter.

        Raises
        ------
        DataError
            If the file has no such variable.
        """
        for candidate in (name, name.lstrip("/")):
            if candidate in self.variables:
                return candidate
        raise DataError(
            f"{self.path.name}: there is no variable {name!r}; the file has: {', '.join(self.variables) or 'none'}. "
            "Name one of these."
        )

    def find_nearest(self, names: Sequence[str], variable: str, *, scalar: bool) -> str | None:
        """Full name of the first variable or attribute of these names: at a variable, beside it, or further up.

        Parameters
        ----------
        names : sequence of str
            Names without groups, the preferred one first.
        variable : str
            Variable where the search begins.
        scalar : bool
            Look for a single number, which may be an attribute; otherwise for a variable of more values.

        Returns
        -------
        str or None
        """
        candidates = self.attributes | self.variables if scalar else self.variables
        groups = self.find_variable(variable).split(self.separator)
        for depth in range(len(groups), -1, -1):
            for name in (self.separator.join([*groups[:depth], name]) for name in names):
                if name in candidates and (np.size(candidates[name]) == 1) == scalar:
                    return name
        return None

    def find_unit(self, variable: str) -> str:
        """Unit that the file states for a variable, in lower case, or the empty string."""
        stated = np.ravel(self.attributes.get(f"{self.find_variable(variable)}{self.separator}units", ""))
        text = stated[0] if stated.size else ""
        return (text.decode(errors="replace") if isinstance(text, bytes) else str(text)).strip().lower()

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file: by its line in a table of text, else by its number."""
        if not self.is_csv:
            return f"at sample {sample}"
        opener = gzip.open if self.path.name.lower().endswith(".gz") else open
        with opener(self.path, "rt", encoding="utf-8", newline="") as file:
            lines = csv.reader(file)
            numbers = [lines.line_num for cells in lines if cells]  # blank lines hold no sample
        return f"in line {numbers[sample + 1]}"  # the first one is the header


def read_contents(path: Path) -> FileContents:
    """Read all variables and attributes of a file, whose format follows from its suffix.

    Parameters
    ----------
    path : pathlib.Path
        The file.

    Returns
    -------
    FileContents

    Raises
    ------
    DataError
        If the file does not exist, has an unknown suffix or is damaged.

    Examples
    --------
    >>> read_contents(Path("nowhere.csv"))
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: nowhere.csv: there is no such file: check the path.
    """
    if not path.is_file():
        raise DataError(f"{path}: there is no such file: check the path.")
    suffix = next((suffix for suffix in _READERS if path.name.lower().endswith(suffix)), None)
    if suffix is None:
        raise DataError(f"{path.name}: unknown kind of file: convert it to one of {', '.join(_READERS)}.")
    try:
        return _READERS[suffix](path)
    except Exception as cause:  # the libraries raise almost anything on a damaged file
        reason = f"{type(cause).__name__}: {cause}".partition("\n")[0]
        raise DataError(
            f"{path.name}: cannot be read as {suffix} ({reason}): check that the file is whole and its suffix right."
        ) from cause


def _read_csv(path: Path) -> FileContents:
    with warnings.catch_warnings():
        # Pandas drops the last cells of a line that has more cells than the header, as decimal commas make it.
        warnings.simplefilter("error", pd.errors.ParserWarning)
        # index_col=False: a comma at the end of each line must not shift the columns.
        frame = pd.read_csv(path, index_col=False, skipinitialspace=True, low_memory=False)
    return FileContents(path, {name.strip(): frame[name].to_numpy() for name in frame.columns})


def _read_mat(path: Path) -> FileContents:
    if h5py.is_hdf5(path):
        return _read_hdf5(path, separator=".")
    workspace = scipy.io.loadmat(path, simplify_cells=True)
    variables = {name: value for name, value in workspace.items() if not name.startswith("__")}
    return FileContents(path, dict(_flatten_struct(variables)), separator=".")


def _flatten_struct(struct: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in struct.items():
        if isinstance(value, dict):
            yield from _flatten_struct(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _read_hdf5(path: Path, separator: str = "/") -> FileContents:
    contents = FileContents(path, separator=separator)

    def add_item(name: str, item: h5py.Group | h5py.Dataset) -> None:
        name = name.replace("/", separator)
        if name.startswith("#"):  # MATLAB keeps its internals in #refs# and #subsystem#
            return
        contents.attributes.update({f"{name}{separator}{key}": value for key, value in item.attrs.items()})
        if isinstance(item, h5py.Dataset):
            # For an empty array MATLAB stores its size instead, which would pass for samples.
            contents.variables[name] = np.empty(0) if item.attrs.get("MATLAB_empty", 0) else item[()]

    with h5py.File(path, "r") as file:
        contents.attributes.update(file.attrs.items())
        file.visititems(add_item)
    return contents


def _read_netcdf(path: Path) -> FileContents:
    if h5py.is_hdf5(path):
        groups = xr.open_groups(path, engine="h5netcdf", decode_times=False)
    else:  # classic NetCDF, which has no groups
        groups = {"/": xr.open_dataset(path, engine="scipy", decode_times=False)}
    contents = FileContents(path)
    for group, dataset in groups.items():
        prefix = f"{group.strip('/')}/".lstrip("/")
        with dataset:
            contents.attributes.update({f"{prefix}{key}": value for key, value in dataset.attrs.items()})
            for name, variable in dataset.variables.items():
                contents.variables[f"{prefix}{name}"] = variable.to_numpy()
                contents.attributes.update({f"{prefix}{name}/{key}": value for key, value in variable.attrs.items()})
    return contents


_READERS = {
    ".csv": _read_csv,
    ".csv.gz": _read_csv,
    ".mat": _read_mat,
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
    ".nc": _read_netcdf,
}
