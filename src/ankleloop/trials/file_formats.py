"""Variables and attributes of data files: CSV, MATLAB (v5 and v7.3), HDF5 and NetCDF.

Damaged files can kill or halt the process that opens them, so these functions run in the process of
`ankleloop.trials.reading_server`, and in no other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.csv_tables import Table
from ankleloop.trials.file_contents import Contents, Variable, raise_type, take_samples

SUFFIXES = (".csv", ".csv.gz", ".mat", ".h5", ".hdf5", ".nc")
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


class CsvContents(Contents):
    """Columns of a table of text."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.table = Table(path)
        self._columns: dict[str, np.ndarray] = {}

    def find(self, name: str) -> Variable | None:
        """Column of a name; None if there is none."""
        if self.table.find_column(name) is None:
            return None
        return Variable(name, (self.table.rows,), lambda part: self._read(name)[part or slice(None)])

    def names(self) -> Iterator[str]:
        """Names of the columns."""
        yield from (name for name in self.table.names if name)

    def load(self, names: Sequence[str]) -> None:
        """Read several columns in one pass."""
        self._columns |= self.table.read_columns(names)

    def locate_sample(self, sample: int) -> str:
        """Line of a sample."""
        return self.table.locate_sample(sample)

    def _read(self, name: str) -> np.ndarray:
        if name not in self._columns:
            self.load([name])
        return self._columns[name]


class MatContents(Contents):
    """Variables of a MATLAB file before v7.3, those of structs by their full names; each is loaded alone."""

    separator = "."

    def __init__(self, path: Path) -> None:
        import scipy.io

        super().__init__(path)
        _check_elements(path)
        self._top: dict[str, tuple[tuple[int, ...], str]] = {}
        self._repeated: set[str] = set()
        for name, shape, kind in scipy.io.whosmat(path, appendmat=False):
            if name in self._top:
                self._repeated.add(name)
            self._top[name] = tuple(int(size) for size in shape), kind
        self._loaded: dict[str, Any] = {}
        self._structs: dict[str, dict[str, Any]] = {}

    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""
        top = self._top_name(name)
        if top not in self._top:
            return None
        if top in self._repeated:
            raise DataError(f"{self.path.name}: there are several variables {top!r}: save the file again with one.")
        shape, kind = self._top[top]
        if kind in ("logical", "sparse") and name == top:  # which become numbers, or an object, once they are loaded
            return Variable(name, shape, lambda _: raise_type(self.path.name, name, kind))
        if kind == "struct":
            fields = self._load_struct(top)
            if name not in fields:
                return None
            value = fields[name]
            return Variable(name, np.shape(value), lambda _: value)
        return Variable(name, shape, lambda _: self._value(top)) if name == top else None

    def names(self) -> Iterator[str]:
        """Full names of the variables."""
        for name, (_, kind) in self._top.items():
            yield from self._load_struct(name) if kind == "struct" else (name,)

    def load(self, names: Sequence[str]) -> None:
        """Load several variables in one pass over the file."""
        import scipy.io

        tops = [top for top in dict.fromkeys(self._top_name(name) for name in names) if top not in self._loaded]
        if tops:
            self._loaded |= scipy.io.loadmat(self.path, appendmat=False, variable_names=tops, simplify_cells=True)

    def _top_name(self, name: str) -> str:
        return name.split(self.separator, 1)[0]

    def _value(self, top: str) -> Any:
        self.load([top])
        return self._loaded[top]

    def _load_struct(self, top: str) -> dict[str, Any]:
        if top not in self._structs:
            self._structs[top] = dict(_flatten_struct({top: self._value(top)}))
        return self._structs[top]


def _check_elements(path: Path) -> None:
    """Refuse a MATLAB v5 file that ends within a variable: its library leaves out the variables behind, in silence."""
    size = path.stat().st_size
    with open(path, "rb") as file:
        header = file.read(128)
        order = {b"IM": "little", b"MI": "big"}.get(header[126:128])
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

    def __init__(self, path: Path) -> None:
        import scipy.io

        super().__init__(path)
        with open(path, "rb") as file:
            if file.read(4) == b"CDF\x05":
                raise DataError(f"{path.name}: classic NetCDF with 64-bit data: convert it by nccopy -k nc4.")
        self._file = scipy.io.netcdf_file(path, "r", mmap=True, maskandscale=False)
        if self._file._recs < 0:
            raise DataError(f"{path.name}: the number of records is not known: it is still written, or damaged.")

    def find(self, name: str) -> Variable | None:
        """Variable of a name; None if there is none."""
        variable = self._file.variables.get(name)
        if variable is None:
            return None
        # A copy, because arrays on the file do not outlive it.
        return Variable(
            name, variable.data.shape, lambda part: np.array(take_samples(variable.data, part)), variable._attributes
        )

    def names(self) -> Iterator[str]:
        """Names of the variables."""
        yield from self._file.variables

    def find_attribute(self, owner: str, name: str) -> Any:
        """Attribute of a variable, or of the file, whose name is empty; None if there is none."""
        if not owner:
            return self._file._attributes.get(name)
        variable = self._file.variables.get(owner)
        return None if variable is None else variable._attributes.get(name)


def find_suffix(path: Path) -> str | None:
    """Suffix by which the format of a file is chosen; None if it is unknown."""
    return next((suffix for suffix in SUFFIXES if path.name.lower().endswith(suffix)), None)


def open_contents(path: Path) -> Contents:
    r"""Open a file, whose format follows from its suffix."""
    suffix = find_suffix(path)
    if suffix in (".csv", ".csv.gz"):
        return CsvContents(path)
    if suffix in (".h5", ".hdf5") or _is_hdf5(path):
        from ankleloop.trials.hdf5_files import Hdf5Contents  # here, because only these files need h5py

        return Hdf5Contents(path, "." if suffix == ".mat" else "/")
    return MatContents(path) if suffix == ".mat" else ClassicNetcdfContents(path)


def _is_hdf5(path: Path) -> bool:
    """Whether a file has the signature of HDF5, at its start or behind a user block, as MATLAB writes it."""
    with open(path, "rb") as file:
        for offset in (0, 512, 1024, 2048):
            file.seek(offset)
            if file.read(8) == HDF5_SIGNATURE:
                return True
    return False
