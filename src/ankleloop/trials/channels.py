"""Channels of a trial in a file: which variables they are, their units, and their samples as numbers.

There is one rule for all files. A container (CSV, MATLAB, HDF5, NetCDF, FLB) is a class of `Contents`, chosen by the
suffix in `trials.reading_process`. Damaged files can kill or halt the process that opens them, so the one that is
started there does, and no other.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ankleloop.errors import DataError

# Unit and long name of each variable that the library writes.
VARIABLES = {
    "time": ("s", "time from the first sample"),
    "position": ("rad", "joint position"),
    "torque": ("N·m", "net torque, opposing stretch"),
    "reference": ("rad", "position command to the servo"),
    "torque_intrinsic": ("N·m", "true intrinsic torque"),
    "torque_reflex": ("N·m", "true reflex torque"),
    "torque_voluntary": ("N·m", "true voluntary torque"),
    "torque_noise": ("N·m", "true torque measurement noise"),
    "stiffness_true": ("N·m/rad", "true intrinsic stiffness"),
    "viscosity_true": ("N·m·s/rad", "true intrinsic viscosity"),
    "reflex_gain_true": ("N·m·s/rad", "true reflex gain"),
    "phase": ("1", "phase of the cycle"),
    "schedule": ("1", "scheduling variable"),
}
TRUE_TORQUES = tuple(name for name in VARIABLES if name.startswith("torque_"))
MAX_SAMPLES = 20_000_000  # 160 MB in double precision
TORQUE_UNITS = ("nm", "newtonmeter", "newtonmetre", "newtonmeters", "newtonmetres")
TIME_UNITS = {
    **dict.fromkeys(("s", "sec", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "μs", "usec", "microsecond", "microseconds"), 1e-6),
}
ANGLES = {
    **dict.fromkeys(("deg", "degree", "degrees", "°"), "deg"),
    **dict.fromkeys(("rad", "radian", "radians"), "rad"),
}
# Words of a name that say what a channel is. A command of the position is a reference, one of the torque is nothing
# that a trial has.
WORDS = {
    "position": ("position", "pos", "angle", "theta"),
    "torque": ("torque", "moment", "tq", "trq"),
    "reference": ("reference", "ref", "command", "cmd", "setpoint", "target"),
}
# Words that make another quantity of it.
OTHERS = {
    "velocity",
    "speed",
    "acceleration",
    "rate",
    "offset",
    "gain",
    "index",
    "unit",
    "units",
    "name",
    "label",
}
LISTED = 30  # names of variables that a message lists
SUFFIXES = (".csv", ".csv.gz", ".mat", ".h5", ".hdf5", ".nc", ".flb")
# Upper and lower case count: T is often the torque, not the time.
RATE_NAMES = ("sampling_rate", "sample_rate", "fs", "Fs")
TIME_NAMES = ("time", "time_s", "t", "Time", "time_ms", "t_ms", "time_us")
HERTZ = ("", "hz", "hertz", "1/s", "s-1", "s^-1", "samples/s", "samples per second")
TIME, RATE = "time", "sampling_rate"  # roles beside the channels of the trial
MOST_VARIABLES = 1000  # in a list of them


@dataclass(frozen=True)
class Variable:
    """A variable of a file, whose samples are read when they are asked for."""

    name: str  # its full name
    shape: tuple[int, ...] = ()  # its shape in the file
    read: Callable[[slice], Any] = np.empty(
        0
    ).__getitem__  # gives the samples of a slice as an array of any type
    attributes: Mapping[str, Any] = field(default_factory=dict)  # its attributes

    @property
    def values(self) -> np.ndarray:
        """All samples."""
        return np.asarray(self.read(slice(None)))

    @property
    def unit(self) -> str:
        """Unit that the file states, numbers as text; texts that differ are joined, so that they are refused."""
        values = [
            value for name, value in self.attributes.items() if name.lower() in ("units", "unit")
        ]
        texts = [
            str(value) if np.asarray(value).dtype.kind in "iuf" else as_text(value)
            for value in values
        ]
        return " and ".join({normalise_unit(text): text for text in texts if text}.values())


def as_text(value: Any) -> str:
    """Text of an attribute, which libraries give as text, bytes or an array of one of them; "" for what is no text."""
    array = np.asarray(value)
    item = array.item() if array.size == 1 else None
    text = item.decode(errors="replace") if isinstance(item, bytes) else item
    return text.strip("\x00 \t\r\n") if isinstance(text, str) else ""


def check_size(samples: int, name: str) -> None:
    """Refuse more samples than are read at once."""
    if samples > MAX_SAMPLES:
        raise DataError(
            f"{name} has {samples:,} samples by its size in the file; at most {MAX_SAMPLES:,} are read as a trial "
            f"({MAX_SAMPLES / 3.6e6:.1f} h at 1 kHz): cut the record; if it is short, the file is damaged."
        )


def find_unit_in_name(name: str) -> str:
    """What may be a unit at the end of a name, behind an underscore or in brackets, or the empty string."""
    match = re.search(r"(?:_|[\[(])\s*([^\W_]+|°)\s*[\])]?\s*$", name)
    return match.group(1).lower() if match else ""


def normalise_unit(text: str) -> str:
    """Unit in one of its spellings, where it is one of a channel."""
    plain = re.sub(r"[\s·.*⋅•×_-]", "", text).lower()
    return "N·m" if plain in TORQUE_UNITS else ANGLES.get(plain, text)


def check_unit(role: str, name: str, stated: str, position_unit: str, *, source: str) -> None:
    """Refuse a channel whose unit, as the file states it, is another one than it is read with."""
    is_torque = role.startswith("torque")
    unit = normalise_unit(stated) if is_torque else find_position_unit(name, stated) or stated
    if unit in ("", "N·m" if is_torque else position_unit):
        return
    if is_torque:
        remedy = ": convert it to N·m"
    elif unit in ANGLES.values():
        remedy = f", but position_unit is {position_unit!r}: pass position_unit={unit!r} to read_trial, or convert it"
    else:
        remedy = ": convert it to rad or deg"
    raise DataError(f"{source}: {name} is in {unit!r} according to the file{remedy}.")


def find_position_unit(name: str, stated: str) -> str | None:
    """Unit of a position as the file states it, or else its name."""
    return ANGLES.get(stated.lower() or find_unit_in_name(name))


def time_factor(name: str, stated: str, *, source: str) -> float | None:
    """Seconds per unit of a time column; None if neither the file nor the name of the column states its unit."""
    unit = stated.lower().split(" since ")[0].strip()
    if unit and unit not in TIME_UNITS:
        raise DataError(
            f"{source}: {name} is in {stated!r} according to the file: write it in seconds, ms or µs."
        )
    return TIME_UNITS.get(unit or find_unit_in_name(name))


def find_variable(
    channel: str, variables: Sequence[Variable], *, source: str, taken: Iterable[str] = ()
) -> str | None:
    """Find the variable of a channel by its name.

    A name fits if one of its words, between underscores, spaces, brackets or capitals, is one of `WORDS`: `ankle_angle`
    and `AnkleAngle` are positions, `angle_command` is a reference.
    """
    excluded = set(taken)
    fitting = [
        v.name
        for v in variables
        if v.name not in excluded and _is_signal(v) and _channel_of(v.name) == channel
    ]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        names = list_names(fitting)
        raise DataError(
            f"{source}: {len(fitting)} variables may be the {channel}: {names}. Name one of them."
        )
    if channel == "reference":
        return None
    text = f"no variable is called {' or '.join(WORDS[channel])}, so that it would be the {channel}; the file has: "
    names = list_names(variable.name for variable in variables if _is_signal(variable))
    raise DataError(f"{source}: {text}{names}. Name one of these.")


def _is_signal(variable: Variable) -> bool:
    """Whether a variable may have samples: it is no single number, and its shape may be unknown."""
    return variable.shape == () or math.prod(variable.shape) > 1


def _channel_of(name: str) -> str | None:
    """Channel that a full name says; None if it says none, or something else."""
    last = re.split(r"[/.]", name.rstrip("/."))[-1]
    if last in TRUE_TORQUES:
        return None
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", last).lower()
    words = set(re.findall(r"[^\W\d_]+", spaced))
    channels = [channel for channel, synonyms in WORDS.items() if words & set(synonyms)]
    if words & OTHERS or not channels:
        return None
    if channels == ["position", "reference"]:
        return "reference"
    return channels[0] if len(channels) == 1 else None


def list_names(names: Iterable[str]) -> str:
    """The first names of variables, for a message."""
    shown = [name if name.isprintable() else repr(name) for name in islice(names, LISTED + 1)]
    return (", ".join(shown[:LISTED]) or "none") + " and more" * (len(shown) > LISTED)


# --- An open file


class Contents:
    """Variables and attributes of an open file."""

    separator = "/"  # joins the names of groups or structs
    kind = "variables"  # what a table or a sequence of cases calls them

    def __init__(self, path: Path, case: int | None = None) -> None:
        self.path = path
        self.variables: list[Variable] = []
        self.warnings: list[str] = []  # for who reads the file
        if case is not None:
            raise DataError(f"{path.name}: case chooses a trial of an .flb file: leave it out.")

    def find(self, name: str) -> Variable | None:
        """Variable of a full name; None if there is none."""
        places = [
            place for place, variable in enumerate(self.variables, 1) if variable.name == name
        ]
        if len(places) > 1:
            raise DataError(
                f"{self.path.name}: {len(places)} {self.kind} are called {name!r} ({self.kind} "
                f"{', '.join(map(str, places))}): give each a name of its own."
            )
        return self.variables[places[0] - 1] if places else None

    def names(self) -> Iterable[str]:
        """Full names of the variables."""
        return [variable.name for variable in self.variables if variable.name]

    def attributes(self, owner: str) -> Mapping[str, Any]:
        """Attributes of a variable, a group, or of the file, whose name is empty."""
        return {}

    def locate_sample(self, sample: int) -> str:
        """Describe where a sample is in the file."""
        return f"at sample {sample}"

    def require(self, name: str) -> Variable:
        """Variable of a name; a leading slash, as HDF5 tools show it, does not matter."""
        variable = self.find(name) or self.find(name.lstrip("/"))
        if variable is not None:
            return variable
        if name in ("position", "torque"):  # the default, and perhaps the file has position_rad
            with suppress(DataError):
                return self.require(str(find_variable(name, find_variables(self), source="")))
        raise DataError(
            f"{self.path.name}: there is no variable {name!r}; the file has: {list_names(self.names())}. Name one of "
            "these."
        )

    def find_number(self, owner: str, name: str) -> Variable | None:
        """Variable of a single value beside others, or else attribute; None if there is neither."""
        full = f"{owner}{self.separator}{name}" if owner else name
        variable = self.find(full)
        if variable is None and (value := self.attributes(owner).get(name)) is not None:
            variable = Variable(full, np.shape(value), lambda _: value)
        return variable if variable is not None and math.prod(variable.shape) == 1 else None


def find_suffix(path: Path) -> str | None:
    """Suffix by which the format of a file is chosen; None if it is unknown."""
    return next((suffix for suffix in SUFFIXES if path.name.lower().endswith(suffix)), None)


def take_samples(samples: Any, part: slice) -> Any:
    """Samples of a slice along the only axis that has several; all of what has no such axis."""
    if part == slice(None):
        return samples[...]
    return samples[0, part] if len(samples.shape) == 2 and samples.shape[0] == 1 else samples[part]


def find_variables(contents: Contents) -> list[Variable]:
    """Variables of an open file, without their samples."""
    variables = []
    for name in dict.fromkeys(islice(contents.names(), MOST_VARIABLES)):
        variables.append(Variable(name))
        with suppress(
            DataError
        ):  # it matters only where this variable is wanted, and is raised there
            if (found := contents.find(name)) is not None:
                variables[-1] = Variable(name, found.shape, attributes=found.attributes)
    return variables


def select_channels(
    contents: Contents,
    variables: Mapping[str, str],
    rate: float | None = None,
    part: Sequence[int] | None = None,
    roles: Sequence[str] | None = None,
) -> Iterator[tuple[str, Variable]]:
    """Read the channels of a trial, its times and its sampling rates, each alone, from an open file.

    `variables` are names in the file by channel, `rate` is what the caller states [Hz], `part` the first sample and the
    one before which reading ends, and `roles` what is read of all this. The true torques of a simulation are read
    where a whole file has them beside the torque.
    """
    selected = {role: contents.require(name) for role, name in variables.items()}
    source, separator = contents.path.name, contents.separator
    parent, dot, _ = selected["torque"].name.rpartition(separator)
    for role in TRUE_TORQUES if part is None else ():
        if (variable := contents.find(f"{parent}{dot}{role}")) is not None:
            selected[role] = variable
    groups = selected["position"].name.split(separator)
    owners = [
        separator.join(groups[:depth]) for depth in range(len(groups), -1, -1)
    ]  # the nearest first
    times = (
        contents.find(f"{owner}{separator * bool(owner)}{name}")
        for owner in owners
        for name in TIME_NAMES
    )
    time = next(
        (found for found in times if found is not None and math.prod(found.shape) != 1), None
    )
    if time is not None and time.name not in {variable.name for variable in selected.values()}:
        selected[TIME] = time
    selected = {
        role: variable for role, variable in selected.items() if roles is None or role in roles
    }
    for role, variable in selected.items():
        values = _read_numbers(contents, variable, slice(*part) if part else slice(None))
        shape = (
            values.shape if part is None else variable.shape
        )  # cells with line ends make a table shorter
        yield role, Variable(variable.name, shape, values.__getitem__, variable.attributes)
    if roles is None:
        rates = (
            [v for name in RATE_NAMES if (v := contents.find_number(owner, name)) is not None]
            for owner in owners
        )
        found = next(filter(None, rates), [])
        numbers = {
            v.name: number for v in found if (number := _read_rate(source, v, rate)) is not None
        }
        if numbers:
            yield (
                RATE,
                Variable(" and ".join(numbers), read=np.array([*numbers.values()]).__getitem__),
            )


def _read_numbers(contents: Contents, variable: Variable, part: slice) -> np.ndarray:
    """Samples of a variable as floating-point numbers, scaled, nan where they are missing."""
    place = f"{contents.path.name}: {variable.name}"
    values = np.asarray(variable.read(part))
    if values.dtype.kind in "OSU":
        for sample, cell in enumerate(values.ravel().tolist()):
            try:
                float("nan" if cell is None else cell)
            except (TypeError, ValueError):
                raise DataError(
                    f"{place} is not a number {contents.locate_sample(sample)} but {cell!r:.60}: correct the file, or "
                    "choose another variable."
                ) from None
    elif values.dtype.kind not in "iuf":
        raise DataError(
            f"{place} is of type {values.dtype}, not real numbers: convert it, or choose another variable."
        )
    check_size(values.size, place)
    numbers = np.array(decode(values, variable.attributes), dtype="<f8", order="C")
    numbers[np.isnan(numbers)] = (
        np.nan
    )  # damaged files have nan that signal an error wherever they are used
    return numbers


def _read_rate(source: str, variable: Variable, stated: float | None) -> float | None:
    """Sampling rate [Hz]; None for what cannot be read, where a rate is stated: it contradicts nothing."""
    value = np.ravel(variable.values)[0]
    with suppress(TypeError, ValueError):
        if variable.unit.lower() in HERTZ:
            return float(value)
    if stated is not None:
        return None
    unit = variable.unit and f" {variable.unit}"
    raise DataError(
        f"{source}: {variable.name} is {value!s:.60}{unit}, not a number in Hz: pass sampling_rate in Hz."
    )


def decode(values: np.ndarray, attributes: Mapping[str, Any]) -> np.ndarray:
    """Apply scale, offset and missing values that the attributes of a variable state, by the conventions of NetCDF.

    A sample is `stored · scale_factor + add_offset`; one that equals `_FillValue` or `missing_value` as stored becomes
    nan. `_Unsigned` turns integers into those without a sign.
    """
    missing = np.zeros(values.shape, dtype=bool)
    for key in {"_FillValue", "missing_value"} & {
        *attributes
    }:  # libraries round them to the type of the samples
        missing |= np.isin(values, np.asarray(attributes[key]).astype(values.dtype))
    if as_text(attributes.get("_Unsigned", "")).lower() == "true" and values.dtype.kind == "i":
        values = values.view(
            values.dtype.str.replace("i", "u")
        )  # the markers have the signed type as stored
    if {"scale_factor", "add_offset"} & {*attributes}:
        factor, offset = (
            np.asarray(attributes.get(key, default)).item() for key, default in SCALE.items()
        )
        values = values.astype(float) * factor + offset
    return np.where(missing, np.nan, values) if missing.any() else values


SCALE = {"scale_factor": 1.0, "add_offset": 0.0}
