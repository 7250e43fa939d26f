"""Variables and attributes of HDF5 files (NetCDF-4 and MATLAB v7.3 among them), MATLAB v5, classic NetCDF and FLB."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, Literal

import h5py
import numpy as np
import scipy.io

from ankleloop.errors import DataError
from ankleloop.trials.contents import Contents, Variable, as_text
from ankleloop.trials.files import UnreadableError

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
FLB_TYPES = {4: "<f4", 2: "<i2", -2: "<u2"}  # of samples, by the format of a case
FLB_LEVELS = 65535  # of format -2, from the lower end of the range to the upper one
LISTED_CASES = 30  # that a message has


class Hdf5Contents(Contents):
    """Variables of an HDF5 file.

    Links are followed within the file. Samples outside of it (external links, external storage, virtual data sets) are
    refused: HDF5 puts zeros where such a file is missing.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.separator = "." if path.name.lower().endswith(".mat") else "/"
        self._file = h5py.File(path, "r")

    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""
        node = self._resolve(name)
        if not _is_variable(node):
            return None
        is_elsewhere = h5py.h5f.get_name(node.id) != h5py.h5f.get_name(self._file.id)
        if is_elsewhere or node.is_virtual or node.external:
            raise DataError(
                f"{self.path.name}: the samples of {name} are in other files: copy them into one file, for example by "
                "h5repack or with MATLAB."
            )
        shape = (0,) if node.shape is None else node.shape
        return Variable(name, shape, partial(node.__getitem__, ...), node.attrs)

    def names(self) -> Iterator[str]:
        """Full names of the variables."""
        return (path for path in self.paths() if _is_variable(self._resolve(path)))

    def paths(self) -> list[str]:
        """Full names of variables and groups; MATLAB's internals, #refs# and #subsystem#, are left out."""
        paths: list[str] = []
        self._file.visit(paths.append)
        return [path.replace("/", self.separator) for path in paths if not path.startswith("#")]

    def attributes(self, owner: str) -> Mapping[str, Any]:
        """Attributes of a variable, a group, or of the file, whose name is empty."""
        return getattr(self._resolve(owner), "attrs", {})

    def _resolve(self, name: str) -> Any:
        """Object of a full name; None if there is none."""
        return self._file.get(name.replace(self.separator, "/") or "/")


def _is_variable(node: Any) -> bool:
    """Whether an object is a data set, and not the zeros of a dimension of NetCDF that has no variable."""
    if not isinstance(node, h5py.Dataset):
        return False
    return not as_text(node.attrs.get("NAME")).startswith(NO_VARIABLE)


class MatContents(Contents):
    """Variables of a MATLAB file before v7.3, those of structs by their full names."""

    separator = "."

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        _check_end(path)
        for name, shape, kind in scipy.io.whosmat(path, False):
            if kind == "struct":
                for field, values in self._load(name).items():
                    self.variables.append(Variable(field, values.shape, values.view))
            else:
                self.variables.append(Variable(name, shape, partial(self._read, name)))

    def _read(self, name: str) -> np.ndarray:
        return self._load(name)[name]

    def _load(self, name: str) -> dict[str, np.ndarray]:
        """A variable, or all of a struct, by their full names."""
        contents = scipy.io.loadmat(
            self.path, appendmat=False, variable_names=[name], simplify_cells=True
        )
        return dict(_flatten_struct({name: contents[name]}))


def _check_end(path: Path) -> None:
    """Refuse a MATLAB v5 file that ends within a variable: its library leaves out those behind and says nothing."""
    size = path.stat().st_size
    with open(path, "rb") as file:
        mark = file.read(128)[126:]
        if mark not in (b"IM", b"MI"):  # v4
            return
        order: Literal["little", "big"] = "little" if mark == b"IM" else "big"
        while tag := file.read(8):
            end = file.seek(int.from_bytes(tag[4:], order), os.SEEK_CUR)
            if end > size:
                raise UnreadableError("it ends within a variable")


def _flatten_struct(
    struct: Mapping[str, Any], prefix: str = ""
) -> Iterator[tuple[str, np.ndarray]]:
    for name, value in struct.items():
        full_name = f"{prefix}{name}"
        if isinstance(value, dict):
            yield from _flatten_struct(value, f"{full_name}.")
        elif isinstance(value, list):  # of structs of any shape
            yield full_name, np.fromiter(value, object)
        else:
            yield full_name, np.atleast_1d(value)


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
    rate = _rate_of(interval)
    duration = length / rate
    text = f"case {number}: {', '.join(names)}, {duration:.4g} s at {rate:g} Hz, {comment[:60]!r}"
    return FlbCase(variables, rate, text)


def _rate_of(interval: float) -> float:
    """Sampling rate [Hz] of an interval [s] in single precision: a whole number, where it is one."""
    rate = 1.0 / interval
    whole = float(round(rate))
    return whole if abs(rate - whole) <= 1e-5 * rate else rate
