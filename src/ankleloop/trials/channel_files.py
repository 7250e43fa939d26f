"""Channels of a trial in a file: which variables they are, and their samples as numbers, by one rule for all files."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.channels import Channel, check_size, join_units

# Upper and lower case count: T is often the torque, not the time.
RATE_NAMES = ("sampling_rate", "sample_rate", "fs", "Fs")
TIME_NAMES = ("time", "time_s", "t", "Time", "time_ms", "t_ms", "time_us")
UNIT_NAMES = ("units", "unit")  # in whatever case
RATE_TOLERANCE = 1e-3
HERTZ = ("hz", "hertz", "1/s", "s-1", "s^-1", "samples/s", "samples per second")
TIME, RATE = "time", "sampling_rate"  # roles beside the channels of the trial
LISTED, MOST_VARIABLES = 100, 1000  # names of variables in an error message, and in a list of them
# Attributes by the conventions of NetCDF and CF, which HDF5 files of laboratories follow, too.
MISSING = ("_FillValue", "missing_value")
UNWRITTEN = 9.969209968386869e36  # what NetCDF libraries put where no sample was written


@dataclass(frozen=True)
class Variable:
    """A variable of a file, whose samples are read when they are asked for."""

    name: str  # its full name
    shape: tuple[int, ...]  # its shape in the file
    read: Callable[[slice], Any]  # gives the samples of a slice as an array of any type
    attributes: Mapping[str, Any] = field(default_factory=dict)  # its attributes

    @property
    def size(self) -> int:
        """Number of its samples, by its shape."""
        return math.prod(self.shape)


class Contents(ABC):
    """Variables and attributes of an open file."""

    separator = "/"  # joins the names of groups or structs

    def __init__(self, path: Path) -> None:
        self.path = path

    @abstractmethod
    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""

    @abstractmethod
    def names(self) -> Iterator[str]:
        """Full names of the variables, for messages."""

    def find_attribute(self, owner: str, name: str) -> Any:
        """Attribute of a variable, a group, or of the file, whose name is empty; None if there is none."""
        return None

    def load(self, names: Sequence[str]) -> None:  # noqa: B027 # most formats have nothing to prepare
        """Prepare to read variables, where a pass over the file reads several."""

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file."""
        return f"at sample {sample}"

    def close(self) -> None:  # noqa: B027
        """Close the file."""

    def require(self, name: str) -> Variable:
        """Variable of a name; a leading slash, as HDF5 tools show it, does not matter."""
        variable = self.find(name) or self.find(name.lstrip("/"))
        if variable is not None:
            return variable
        known = [name if name.isprintable() else repr(name) for name in islice(self.names(), LISTED + 1)]
        listed = ", ".join(known[:LISTED]) + (" and more" if len(known) > LISTED else "")
        raise DataError(
            f"{self.path.name}: there is no variable {name!r}; the file has: {listed or 'none'}. Name one of these."
        )

    def find_nearest(self, names: Sequence[str], variable: str, *, scalar: bool) -> Variable | None:
        """First variable or attribute of these names: at a variable, beside it, or further up."""
        groups = variable.split(self.separator)
        for depth in range(len(groups), -1, -1):
            owner = self.separator.join(groups[:depth])
            for name in names:
                full = self.separator.join([*groups[:depth], name])
                candidate = self.find_number(owner, name, full) if scalar else self.find(full)
                if candidate is not None and (scalar or candidate.size != 1):
                    return candidate
        return None

    def find_number(self, owner: str, name: str, full: str) -> Variable | None:
        """Variable of a single value, or else attribute; None if there is neither."""
        variable = self.find(full)
        if variable is None and (value := self.find_attribute(owner, name)) is not None:
            variable = Variable(full, np.shape(value), lambda _: value)
        return variable if variable is not None and variable.size == 1 else None


def take_samples(samples: Any, part: slice) -> Any:
    """Samples of a slice along the only axis that has several; all of what has no such axis."""
    if part == slice(None):
        return samples[...]
    return samples[0, part] if len(samples.shape) == 2 and samples.shape[0] == 1 else samples[part]


def raise_type(source: str, name: str, kind: object) -> NoReturn:
    """Refuse a variable that is not of real numbers."""
    raise DataError(f"{source}: {name} is of type {kind}, not real numbers: convert it, or choose another variable.")


@dataclass(frozen=True)
class Request:
    """What is wanted of a file."""

    path: str
    seconds: float  # limit of time
    memory: float  # limit of memory [bytes]
    task: str = "channels"  # or "listing" of the variables, or "copy" of the file with the same contents
    variables: Mapping[str, str] = field(default_factory=dict)  # names in the file by channel, position and torque too
    extras: Sequence[str] = ()  # channels that are read if the file has them beside the torque
    rate: float | None = None  # sampling rate that the caller states [Hz]; that of the file must not contradict it
    part: Sequence[int] | None = None  # first and last sample but one that are wanted; None for all of them
    # Whether samples are read; otherwise the channels have their shapes alone, but for the sampling rate.
    with_samples: bool = True
    roles: Sequence[str] | None = None  # channels that are wanted; all, by default


def read_channels(contents: Contents, request: Request) -> Iterator[tuple[str, Channel]]:
    """Read the channels of a trial, its times and its sampling rate, each alone, from an open file."""
    variables = _select(contents, request)
    if request.with_samples:
        for variable in variables.values():
            if request.part is None:
                check_size(variable.size, f"{contents.path.name}: {variable.name}")
        contents.load([variable.name for variable in variables.values()])
    for role, variable in variables.items():
        channel = Channel(variable.name, _find_unit(variable), variable.shape)
        if role == RATE:
            yield role, replace(channel, shape=(1,), values=_read_rate(contents, variable))
        elif request.with_samples:
            values = _read_numbers(contents, variable, slice(*request.part) if request.part else slice(None))
            yield role, replace(channel, shape=values.shape, values=values)
        else:
            yield role, channel


def list_variables(contents: Contents) -> Iterator[tuple[str, Channel]]:
    """List the variables of an open file."""
    for name in dict.fromkeys(islice(contents.names(), MOST_VARIABLES)):
        channel = Channel(name, "", ())
        with suppress(DataError):  # it matters only where this variable is wanted, and is raised there
            if (variable := contents.find(name)) is not None:
                channel = Channel(name, _find_unit(variable), tuple(map(int, variable.shape)))
        yield name, channel


def _select(contents: Contents, request: Request) -> dict[str, Variable]:
    """Variables by role."""
    selected = {role: contents.require(name) for role, name in request.variables.items()}
    position, torque = selected["position"].name, selected["torque"].name
    parent, separator, _ = torque.rpartition(contents.separator)
    for role in request.extras:
        variable = contents.find(f"{parent}{separator}{role}")
        if variable is not None:
            selected.setdefault(role, variable)
    rate = contents.find_nearest(RATE_NAMES, position, scalar=True)
    if rate is not None and _check_rates(contents, rate, request.rate):
        selected[RATE] = rate
    time = contents.find_nearest(TIME_NAMES, position, scalar=False)
    if time is not None and time.name not in {variable.name for variable in selected.values()}:
        selected[TIME] = time
    return {role: v for role, v in selected.items() if request.roles is None or role in request.roles}


def _find_unit(variable: Variable) -> str:
    """Unit that the file states for a variable, numbers as text, or the empty string."""
    found = [np.asarray(variable.attributes[name]) for name in variable.attributes if name.lower() in UNIT_NAMES]
    stated = [as_text(v) if v.size == 1 and v.dtype.kind in "OSU" else shorten(v) for v in found if v.size]
    return join_units([text for text in stated if text])


def _read_numbers(contents: Contents, variable: Variable, part: slice) -> np.ndarray:
    """Samples of a variable as floating-point numbers, scaled, nan where they are missing."""
    source, name = contents.path.name, variable.name
    values = np.asarray(variable.read(part))
    if values.dtype.kind in "OSU":
        _refuse_text(contents, name, values)
    if values.dtype.kind not in "iuf":
        raise_type(source, name, values.dtype)
    check_size(values.size, f"{source}: {name}")  # of a struct of MATLAB, whose size is not known before
    numbers = np.array(decode(values, variable.attributes, source=source, name=name), dtype="<f8", order="C")
    numbers[np.isnan(numbers)] = np.nan  # damaged files have nan that signal an error wherever they are used
    return numbers


def _refuse_text(contents: Contents, name: str, values: np.ndarray) -> None:
    for sample, cell in enumerate(np.ravel(values)):
        try:
            float("nan" if cell is None else cell)
        except (TypeError, ValueError, OverflowError):
            raise DataError(
                f"{contents.path.name}: {name} is not a number {contents.locate_sample(sample)} but {_show(cell)}: "
                "correct the file, or choose another variable."
            ) from None


def _show(cell: Any) -> str:
    if isinstance(cell, str | bytes):
        return shorten(repr(str(cell) if isinstance(cell, str) else bytes(cell)))  # not as a text of numpy
    return f"an object ({type(cell).__name__})"


def _check_rates(contents: Contents, rate: Variable, stated: float | None) -> bool:
    """Refuse rates of a file that contradict each other or the stated one; whether the file's one is to be taken."""
    source = contents.path.name
    owner, separator, _ = rate.name.rpartition(contents.separator)
    beside = (contents.find_number(owner, name, f"{owner}{separator}{name}") for name in RATE_NAMES)
    others = [variable for variable in beside if variable is not None and variable.name != rate.name]
    try:
        numbers = {variable.name: _read_rate(contents, variable).item() for variable in (rate, *others)}
    except DataError:
        if stated is None:
            raise
        return False  # what cannot be read contradicts nothing
    number = numbers[rate.name]
    if stated is None:
        for name, other in numbers.items():
            if abs(other - number) > RATE_TOLERANCE * abs(number):
                raise DataError(
                    f"{source}: {rate.name} is {number:g} Hz, but {name} is {other:g} Hz: pass sampling_rate, or "
                    "correct the file."
                )
    elif not any(abs(other - stated) <= RATE_TOLERANCE * stated for other in numbers.values()):
        texts = " and ".join(f"{name} of the file is {other:g} Hz" for name, other in numbers.items())
        raise DataError(
            f"{source}: sampling_rate is stated as {stated:g} Hz, but {texts}: leave sampling_rate out, or correct the "
            "file."
        )
    return stated is None


def _read_rate(contents: Contents, variable: Variable) -> np.ndarray:
    """Sampling rate [Hz], shape (1,)."""
    source, unit = contents.path.name, _find_unit(variable)
    if unit and unit.lower() not in HERTZ:
        raise DataError(f"{source}: {variable.name} is in {unit!r} according to the file: write it in Hz.")
    value = np.ravel(np.asarray(variable.read(slice(None))))
    text = as_text(value) if value.dtype.kind in "OSU" else ""
    try:
        number = np.array([float(text) if text else float(value[0])])
    except (TypeError, ValueError, OverflowError, IndexError):
        raise DataError(
            f"{source}: sampling_rate is {_show(text or value)} ({variable.name}): pass a single number in Hz."
        ) from None
    return decode(number, variable.attributes, source=source, name=variable.name)


def decode(values: np.ndarray, attributes: Mapping[str, Any], *, source: str, name: str) -> np.ndarray:
    """Apply scale, offset and missing values that the attributes of a variable state.

    A sample is `stored · scale_factor + add_offset`; one that equals `_FillValue` or `missing_value` as stored, or was
    never written to a NetCDF file, becomes nan. `_Unsigned` turns integers into those without a sign.
    """
    if values.dtype.kind not in "iuf":
        return values
    missing = _find_missing(values, attributes)
    if as_text(attributes.get("_Unsigned", "")).lower() == "true" and values.dtype.kind == "i":
        values = values.view(values.dtype.str.replace("i", "u"))  # the markers have the signed type as stored
    factor = _read_number(attributes, "scale_factor", 1.0, source, name)
    offset = _read_number(attributes, "add_offset", 0.0, source, name)
    if factor == 0.0:
        raise DataError(f"{source}: scale_factor of {name} is 0, so that all samples are alike: correct the file.")
    if missing is None and (factor, offset) == (1.0, 0.0):
        return values
    with np.errstate(over="ignore"):  # an infinite sample is refused by its number later on
        numbers = values.astype(float) * factor + offset
    if missing is not None:
        numbers[missing] = np.nan
    return numbers


def _find_missing(values: np.ndarray, attributes: Mapping[str, Any]) -> np.ndarray | None:
    """Mask of the samples that are missing; None if there are none."""
    markers = [marker for key in MISSING for marker in _as_numbers(attributes.get(key, ()))]
    if values.dtype.kind == "f":
        markers.append(UNWRITTEN)
    with np.errstate(over="ignore", invalid="ignore"):
        # A marker has the type of the samples; another one is rounded to it, as libraries round it when they write.
        stored = [values.dtype.type(marker) for marker in markers if _fits(marker, values.dtype)]
    mask = np.isin(values, np.array(stored, dtype=values.dtype)) if stored else np.zeros(values.shape, dtype=bool)
    return mask if mask.any() else None


def _fits(marker: float, dtype: np.dtype[Any]) -> bool:
    if dtype.kind == "f":
        return True
    limits = np.iinfo(dtype)
    return bool(limits.min <= marker <= limits.max and marker == int(marker))


def _as_numbers(value: Any) -> list[Any]:
    array = np.ravel(np.asarray(value))
    return array.tolist() if array.dtype.kind in "iuf" else []


def _read_number(attributes: Mapping[str, Any], key: str, default: float, source: str, name: str) -> float:
    if key not in attributes:
        return default
    array = np.ravel(np.asarray(attributes[key]))
    if array.size != 1 or array.dtype.kind not in "iuf" or not np.isfinite(array[0]):
        raise DataError(f"{source}: {key} of {name} is no finite number ({shorten(array)}): correct the file.")
    return float(array[0])


def shorten(value: Any) -> str:
    """Text of a value, of 60 characters at most."""
    text = str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def as_text(value: Any) -> str:
    """Text of an attribute, which libraries give as text, bytes or an array of one of them; "" for what is no text."""
    array = np.asarray(value)
    if array.size != 1 or array.dtype.kind not in "OSU":
        return ""
    item = array.item()
    text = item.decode(errors="replace") if isinstance(item, bytes) else item
    return text.strip("\x00 \t\r\n") if isinstance(text, str) else ""
