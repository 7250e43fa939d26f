"""Variables and attributes of HDF5 files (NetCDF-4 and MATLAB v7.3 among them), MATLAB v5, classic NetCDF and FLB."""

from __future__ import annotations

from collections.abc import Mapping
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
from ankleloop.trials.matlab_values import load_parts

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
# Classes of MATLAB whose variables are read when they are asked for.
NUMBERS = {"double", "single", "logical", "char", "int8", "int16", "int32", "int64"}
NUMBERS |= {"uint8", "uint16", "uint32", "uint64"}
FLB_TYPES = {4: "<f4", 2: "<i2", -2: "<u2"}  # of samples, by the format of a case
FLB_LEVELS = 65535  # of format -2, from the lower end of the range to the upper one
LISTED_CASES = 30  # that a message has


class Hdf5Contents(Contents):
    """Variables of an HDF5 file.

    Links are followed within the file. Samples outside of it (external links, external storage, virtual data sets) are
    refused: HDF5 puts zeros where such a file is missing.

    A matrix of MATLAB is stored with its axes in reverse, and what it keeps behind references is read by mat-io.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._separator = "." if path.name.lower().endswith(".mat") else "/"
        self._file = h5py.File(path, "r")
        self._values = [name for name in self._file if _has_references(self._file.get(name))]
        self._file.visititems(self._add)
        for name in self._values:  # of which mat-io reads virtual data sets as zeros
            self._file.visititems(lambda path, node: self._check_place(node, path))
            self.variables += load_parts(path, name)

    def _add(self, path: str, node: Any) -> None:
        """Add a variable; MATLAB's internals, #refs# and #subsystem#, are left out."""
        if not path.startswith("#") and path.partition("/")[0] not in self._values:
            self.variables += self._list_variables(path.replace("/", self._separator), node)

    def _list_variables(self, name: str, node: Any) -> list[Variable]:
        """The variable of a data set, or one for each field of records."""
        if not _is_variable(node):
            return []
        shape = (0,) if node.shape is None else node.shape

        def read(key: Any) -> np.ndarray:
            self._check_place(node, name)
            samples: np.ndarray = node[key]
            return samples

        if node.dtype.names:
            return [
                Variable(f"{name}.{field}", shape + node.dtype[field].shape, partial(read, field))
                for field in node.dtype.names
            ]
        if "MATLAB_class" in node.attrs:
            return [Variable(name, shape[::-1], lambda: read(...).T, node.attrs)]
        return [Variable(name, shape, partial(read, ...), node.attrs)]

    def _check_place(self, node: Any, name: str) -> None:
        """Refuse samples in other files."""
        is_elsewhere = h5py.h5f.get_name(node.id) != h5py.h5f.get_name(self._file.id)
        is_data = isinstance(node, h5py.Dataset)
        if is_elsewhere or (is_data and (node.is_virtual or node.external)):
            raise DataError(
                f"{self.path.name}: the samples of {name} are in other files: copy them into one file, for example by "
                "h5repack or with MATLAB."
            )

    def open(self, name: str) -> Variable | None:
        """Variable of a full name, also behind a link; None if there is none."""
        variable = super().open(name)
        if variable is not None:
            return variable
        linked = self._list_variables(name, self._resolve(name))
        return next((variable for variable in linked if variable.name == name), None)

    def attributes(self, owner: str) -> Mapping[str, Any]:
        """Attributes of a variable, a group, or of the file, whose name is empty."""
        return getattr(self._resolve(owner), "attrs", {})

    def _resolve(self, name: str) -> Any:
        """Object of a full name; None if there is none."""
        return self._file.get(name.replace(self._separator, "/") or "/")


def _is_variable(node: Any) -> bool:
    """Whether an object is a data set, and no value of MATLAB, nor the zeros of a dimension of NetCDF."""
    if not isinstance(node, h5py.Dataset) or _is_value(node):
        return False
    return not as_text(node.attrs.get("NAME")).startswith(NO_VARIABLE)


def _is_value(node: Any) -> bool:
    """Whether an object is one of MATLAB, a text, or has references, as struct and cell arrays have."""
    is_object = "MATLAB_object_decode" in node.attrs
    is_text = as_text(node.attrs.get("MATLAB_class")) == "char"
    return is_object or is_text or h5py.check_ref_dtype(getattr(node, "dtype", None)) is not None


def _has_references(node: Any) -> bool:
    """Whether a variable of MATLAB is, or has in it, what mat-io reads."""
    if node is None or not node.attrs.keys() & {"MATLAB_class", "MATLAB_fields"}:
        return False
    parts = [node]
    if isinstance(node, h5py.Group):
        node.visititems(lambda _, part: parts.append(part))
    return any(map(_is_value, parts))


class MatContents(Contents):
    """Variables of a MATLAB file before v7.3; arrays of numbers are read when they are asked for."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        for name, (shape, kind) in whosmat(path).items():
            if kind.removeprefix("complex ") in NUMBERS:
                self.variables.append(Variable(name, shape, partial(self._read, name)))
            else:
                self.variables += load_parts(path, name)

    def _read(self, name: str) -> np.ndarray:
        samples: np.ndarray = load_from_mat(self.path, variable_names=[name])[name]
        return samples


class ClassicNetcdfContents(Contents):
    """Variables of a classic NetCDF file, which has no groups."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        file = scipy.io.netcdf_file(path, "r", mmap=True, maskandscale=False)
        self.file_attributes = file._attributes
        for name, node in file.variables.items():
            samples = node.data
            variable = Variable(name, samples.shape, samples.view, node._attributes)
            self.variables.append(variable)


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
        self.variables = cases[number - 1].variables
        self.file_attributes = {"sampling_rate": cases[number - 1].rate}


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
