"""Channels of a trial in a file: which variables they are, and their samples as numbers."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.channels import Channel, check_size, join_units
from ankleloop.trials.contents import Contents, Variable, raise_type
from ankleloop.trials.decoding import as_text, decode, shorten

# Upper and lower case count: T is often the torque, not the time.
RATE_NAMES = ("sampling_rate", "sample_rate", "fs", "Fs")
TIME_NAMES = ("time", "time_s", "t", "Time", "time_ms", "t_ms", "time_us")
UNIT_NAMES = ("units", "unit")  # in whatever case
RATE_TOLERANCE = 1e-3
HERTZ = ("hz", "hertz", "1/s", "s-1", "s^-1", "samples/s", "samples per second")
TIME, RATE = "time", "sampling_rate"  # roles beside the channels of the trial
MOST_VARIABLES = 1000  # that are listed


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
    for name in dict.fromkeys(itertools.islice(contents.names(), MOST_VARIABLES)):
        channel = Channel(name, "", ())
        try:
            variable = contents.find(name)
        except DataError:  # it matters only where this variable is wanted, and is raised there
            variable = None
        if variable is not None:
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
    if rate is not None and request.rate is None:
        _check_other_rates(contents, rate)
        selected[RATE] = rate
    elif rate is not None and request.rate is not None:
        _check_stated_rate(contents, rate, request.rate)
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
        if not _is_number(cell):
            raise DataError(
                f"{contents.path.name}: {name} is not a number {contents.locate_sample(sample)} but {_show(cell)}: "
                "correct the file, or choose another variable."
            )


def _is_number(cell: Any) -> bool:
    if cell is None:
        return True
    try:
        float(cell)
    except (TypeError, ValueError, OverflowError):
        return False
    return True


def _show(cell: Any) -> str:
    if isinstance(cell, str | bytes):
        return shorten(repr(str(cell) if isinstance(cell, str) else bytes(cell)))  # not as a text of numpy
    return f"an object ({type(cell).__name__})"


def _check_other_rates(contents: Contents, rate: Variable) -> None:
    """Refuse two sampling rates beside each other that differ."""
    number = _read_rate(contents, rate)
    for other in _find_rates(contents, rate):
        if abs(_read_rate(contents, other) - number) > RATE_TOLERANCE * abs(number):
            raise DataError(
                f"{contents.path.name}: {rate.name} is {number.item():g} Hz, but {other.name} is "
                f"{_read_rate(contents, other).item():g} Hz: pass sampling_rate, or correct the file."
            )


def _check_stated_rate(contents: Contents, rate: Variable, stated: float) -> None:
    """Refuse a stated sampling rate that no rate of the file agrees with."""
    try:
        numbers = {variable.name: _read_rate(contents, variable).item() for variable in _find_rates(contents, rate)}
    except DataError:  # what cannot be read contradicts nothing
        return
    if not any(abs(number - stated) <= RATE_TOLERANCE * stated for number in numbers.values()):
        texts = " and ".join(f"{name} of the file is {number:g} Hz" for name, number in numbers.items())
        raise DataError(
            f"{contents.path.name}: sampling_rate is stated as {stated:g} Hz, but {texts}: leave sampling_rate out, or "
            "correct the file."
        )


def _find_rates(contents: Contents, rate: Variable) -> list[Variable]:
    """A sampling rate, and all others beside it."""
    owner, separator, _ = rate.name.rpartition(contents.separator)
    variables = (contents.find_number(owner, name, f"{owner}{separator}{name}") for name in RATE_NAMES)
    return [rate, *(variable for variable in variables if variable is not None and variable.name != rate.name)]


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
