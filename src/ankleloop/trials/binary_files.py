"""Variables and attributes of HDF5 files (NetCDF-4 and MATLAB v7.3 among them), MATLAB v5, classic NetCDF and FLB."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
import scipy.io
from matio import load_from_mat, whosmat

from ankleloop.errors import DataError
from ankleloop.signals.sampling import rate_of_interval
from ankleloop.trials.contents import Contents, Variable, as_text
from ankleloop.trials.files import UnreadableError
from ankleloop.trials.matlab_values import fold_numbers, load_parts

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
# Classes of MATLAB whose variables are read when they are asked for.
NUMBERS = {"double", "single", "logical", "char", "int8", "int16", "int32", "int64"}
NUMBERS |= {"uint8", "uint16", "uint32", "uint64"}
FLB_TYPES = {4: "<f4", 2: "<i2", -2: "<u2"}  # of samples, by the format of a case
FLB_LEVELS = 65535  # of format -2, from the lower end of the range to the upper one
LISTED_CASES = 30  # that a message has


class MatlabContents(Contents):
    """Variables of a file that may have values of MATLAB: struct and cell arrays, tables and other objects."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._parts: dict[str, dict[str, Variable]] = {}  # of each value

    def load_parts(self, name: str) -> dict[str, Variable]:
        """The variables in such a value by their full names, all of which mat-io reads at once."""
        if name not in self._parts:
            self._parts[name] = load_parts(self.path, name)
        return self._parts[name]

    def list_parts(self, name: str) -> list[str]:
        """Names of the variables in a value; none where it cannot be read, which is refused where it is wanted."""
        with suppress(Exception):
            return fold_numbers(self.load_parts(name))
        return []


class Hdf5Contents(MatlabContents):
    """Variables of an HDF5 file.

    Links are followed within the file. Samples outside of it (external links, external storage, virtual data sets) are
    refused: HDF5 puts zeros where such a file is missing.

    A matrix of MATLAB is stored with its axes in reverse, and what it keeps behind references is read by mat-io.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.separator = "." if path.name.lower().endswith(".mat") else "/"
        self._file = h5py.File(path, "r")
        self._values = [name for name in self._file if _has_references(self._file.get(name))]

    def open(self, name: str) -> Variable | None:
        """Variable, or field of records, of a full name; None if there is none."""
        value = _first_name(name)
        if value in self._values:
            if value not in self._parts:
                self._file.visititems(lambda path, node: self._check_place(node, path))
            return self.load_parts(value).get(name)
        node = self._resolve(name)
        if node is None:
            return self._open_field(*name.rpartition(".")[::2])
        if not _is_variable(node) or node.dtype.names:
            return None
        self._check_place(node, name)
        shape = (0,) if node.shape is None else node.shape
        read = partial(node.__getitem__, ...)
        if "MATLAB_class" in node.attrs:
            return Variable(name, shape[::-1], lambda: read().T, node.attrs)
        return Variable(name, shape, read, node.attrs)

    def _open_field(self, name: str, field: str) -> Variable | None:
        """Field of records; None if there is none."""
        records = self._resolve(name)
        if not _is_variable(records) or field not in (records.dtype.names or ()):
            return None
        self._check_place(records, name)
        shape = records.shape + records.dtype[field].shape
        return Variable(f"{name}.{field}", shape, partial(records.__getitem__, field))

    def _check_place(self, node: Any, name: str) -> None:
        """Refuse samples in other files."""
        is_elsewhere = h5py.h5f.get_name(node.id) != h5py.h5f.get_name(self._file.id)
        is_data = isinstance(node, h5py.Dataset)
        if is_elsewhere or (is_data and (node.is_virtual or node.external)):
            raise DataError(
                f"{self.path.name}: the samples of {name} are in other files: copy them into one file, for example by "
                "h5repack or with MATLAB."
            )

    def names(self) -> Iterator[str]:
        """Full names of the variables, and of their parts."""
        for path in self.paths():
            node = self._resolve(path)
            if _is_variable(node) and _first_name(path) not in self._values:
                fields = node.dtype.names
                yield from (f"{path}.{field}" for field in fields) if fields else (path,)
        for value in self._values:
            yield from self.list_parts(value)

    def paths(self) -> list[str]:
        """Full names of variables and groups; MATLAB's internals, #refs# and #subsystem#, are left out."""
        paths: list[str] = []
        self._file.visit(paths.append)
        return [path.replace("/", self.separator) for path in paths if not path.startswith("#")]

    def attributes(self, owner: str) -> Mapping[str, Any]:
        """Attributes of a variable, a group, or of the file, whose name is empty."""
        return getattr(self._resolve(owner), "attrs", {})

    def join(self, owner: str, name: str) -> str:
        """Full name of a variable of a group; the fields of records are behind a point."""
        if owner and not isinstance(self._resolve(owner), h5py.Group):
            return f"{owner}.{name}"
        return super().join(owner, name)

    def _resolve(self, name: str) -> Any:
        """Object of a full name; None if there is none."""
        return self._file.get(name.replace(self.separator, "/") or "/")


def _is_variable(node: Any) -> bool:
    """Whether an object is a data set, and no references, nor the zeros of a dimension of NetCDF without a variable."""
    if not isinstance(node, h5py.Dataset) or h5py.check_ref_dtype(node.dtype) is not None:
        return False
    return not as_text(node.attrs.get("NAME")).startswith(NO_VARIABLE)


def _first_name(name: str) -> str:
    """Name of the variable of a MATLAB file in which something is."""
    return re.split(r"[.\[]", name)[0]


def _has_references(node: Any) -> bool:
    """Whether a variable of MATLAB is an object, or has references in it, as struct and cell arrays have."""
    if node is None or not node.attrs.keys() & {"MATLAB_class", "MATLAB_fields"}:
        return False
    parts = [node]
    if isinstance(node, h5py.Group):
        node.visititems(lambda _, part: parts.append(part))
    return any(
        "MATLAB_object_decode" in part.attrs or h5py.check_ref_dtype(getattr(part, "dtype", None))
        for part in parts
    )


class MatContents(MatlabContents):
    """Variables of a MATLAB file before v7.3."""

    separator = "."

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._kinds = whosmat(path)

    def open(self, name: str) -> Variable | None:
        """Variable of a full name, which is read when it is asked for, or a part of a value; None if there is none."""
        if self._has_numbers(name):
            shape = self._kinds[name][0]
            return Variable(name, shape, partial(self._read, name))
        value = _first_name(name)
        is_value = value in self._kinds and not self._has_numbers(value)
        return self.load_parts(value).get(name) if is_value else None

    def names(self) -> Iterator[str]:
        """Full names of the variables, and of those in values."""
        for name in self._kinds:
            yield from [name] if self._has_numbers(name) else self.list_parts(name)

    def _has_numbers(self, name: str) -> bool:
        """Whether a variable is an array of numbers, or a text."""
        return name in self._kinds and self._kinds[name][1].removeprefix("complex ") in NUMBERS

    def _read(self, name: str) -> np.ndarray:
        samples: np.ndarray = load_from_mat(self.path, variable_names=[name])[name]
        return samples


class ClassicNetcdfContents(Contents):
    """Variables of a classic NetCDF file, which has no groups."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._file = scipy.io.netcdf_file(path, "r", mmap=True, maskandscale=False)
        for name, node in self._file.variables.items():
            samples = node.data
            variable = Variable(name, samples.shape, samples.view, node._attributes)
            self.variables.append(variable)

    def attributes(self, owner: str) -> Mapping[str, Any]:
        """Attributes of a variable, or of the file, whose name is empty."""
        node = self._file.variables.get(owner) if owner else self._file
        return getattr(node, "_attributes", {})


@dataclass(frozen=True)
class FlbCase:
    """A trial of an FLB file."""

    variables: list[Variable]
    rate: float  # Hz
    text: str  # for a list of cases


class FlbContents(Contents):
    """Channels of one case of an FLB file ("filelb"), a sequence of cases (trials) of named channels of equal length.

    A case begins with its version (2, 3 or 4), the numbers of its dimensions and realizations (not in version 2), and
    number, length and format of its channels; names, sampling interval, comment and ranges follow, then the samples,
    channel by channel. All is little endian. Channels of several realizations have its number behind a slash.
    """

    kind = "channels"

    def __init__(self, path: Path, case: int | None = None) -> None:
        super().__init__(path)
        content = np.memmap(path, "u1", "r")
        cases: list[FlbCase] = []
        with open(path, "rb") as file:
            while not cases or content.size - file.tell() >= 4:
                cases.append(_read_case(file, content, len(cases) + 1))
        if case is None and len(cases) > 1:
            listed = "; ".join(each.text for each in cases[:LISTED_CASES])
            raise DataError(
                f"{path.name}: there are {len(cases)} cases: choose one by the option case. {listed}.",
                remedy={"case": None},
            )
        number = case or 1
        if number > len(cases):
            raise DataError(
                f"{path.name}: there is no case {case}: the file has {len(cases)}, counted from 1."
            )
        self._case = cases[number - 1]
        self.variables = self._case.variables

    def attributes(self, owner: str) -> Mapping[str, Any]:
        """The sampling rate, which belongs to the file."""
        return {} if owner else {"sampling_rate": self._case.rate}


def _read_case(file: BinaryIO, content: np.ndarray, number: int) -> FlbCase:
    """Read the next case, and go to its end."""

    def read(kind: str, count: int = 1) -> np.ndarray:
        start = file.tell()
        end = start + np.dtype(kind).itemsize * count
        if not start <= end <= content.size:
            raise UnreadableError(f"case {number} is cut off")
        file.seek(end)
        return content[start:end].view(kind)

    def read_text() -> str:
        length = int(read("<i4")[0])
        return read("u1", length).tobytes().decode("latin-1").strip("\0 ")

    version = int(read("<i4")[0])
    if version not in (2, 3, 4):
        raise UnreadableError(f"case {number} is of version {version}, and there are 2, 3 and 4")
    realizations = 1 if version == 2 else int(read("<i4", 2)[1])
    channels, length, kind = read("<i4", 3).tolist()
    if kind not in FLB_TYPES:
        raise UnreadableError(
            f"case {number} has samples of format {kind}, and 4, 2 and -2 are read: convert it"
        )
    read_text()  # the domain, time
    interval = float(read("<f4", 2)[0])
    comment = read_text()
    names = [read_text() or f"channel {channel + 1}" for channel in range(channels)]
    ranges = read("<f8", 2 * channels).reshape(2, channels)
    if not (channels > 0 and length > 0 and realizations > 0 and 0.0 < interval < np.inf):
        raise UnreadableError(f"case {number} has no samples, or no sampling interval")
    if realizations > 1:
        names = [f"{name}/{k}" for k in range(1, realizations + 1) for name in names]
    samples = read(FLB_TYPES[kind], length * len(names)).reshape(len(names), length)
    variables = []
    for row, name in enumerate(names):
        attributes = {}
        if kind == -2:
            low, high = ranges[:, row % channels]
            attributes = {"scale_factor": (high - low) / FLB_LEVELS, "add_offset": low}
        variables.append(Variable(name, (length,), samples[row].view, attributes))
    rate = rate_of_interval(interval)
    duration = length / rate
    text = f"case {number}: {', '.join(names)}, {duration:.4g} s at {rate:g} Hz, {comment[:60]!r}"
    return FlbCase(variables, rate, text)
