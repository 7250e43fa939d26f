"""Channels of a recording as they come from a file: how many samples are read at once, and what their units say."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
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
OTHERS = frozenset(
    ("velocity", "speed", "acceleration", "rate", "offset", "gain", "index", "unit", "units", "name", "label")
)
LISTED = 30  # names of variables that a message lists


@dataclass(frozen=True)
class Variable:
    """A variable of a file, whose samples are read when they are asked for."""

    name: str  # its full name
    shape: tuple[int, ...] = ()  # its shape in the file
    read: Callable[[slice], Any] = np.empty(0).__getitem__  # gives the samples of a slice as an array of any type
    attributes: Mapping[str, Any] = field(default_factory=dict)  # its attributes

    @property
    def values(self) -> np.ndarray:
        """All samples."""
        return np.asarray(self.read(slice(None)))

    @property
    def unit(self) -> str:
        """Unit that the file states, numbers as text; texts that differ are joined, so that they are refused."""
        values = [value for name, value in self.attributes.items() if name.lower() in ("units", "unit")]
        texts = [str(value) if np.asarray(value).dtype.kind in "iuf" else as_text(value) for value in values]
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
            f"({MAX_SAMPLES / 3.6e6:.1f} h at 1 kHz): read a long record by ankleloop.LongRecord from HDF5 or NetCDF; "
            "if the record is short, the file is damaged."
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
        raise DataError(f"{source}: {name} is in {stated!r} according to the file: write it in seconds, ms or µs.")
    return TIME_UNITS.get(unit or find_unit_in_name(name))


def find_variable(channel: str, variables: Sequence[Variable], *, source: str, taken: Iterable[str] = ()) -> str | None:
    """Find the variable of a channel by its name.

    A name fits if one of its words, between underscores, spaces, brackets or capitals, is one of `WORDS`: `ankle_angle`
    and `AnkleAngle` are positions, `angle_command` is a reference.
    """
    excluded = set(taken)
    fitting = [v.name for v in variables if v.name not in excluded and _is_signal(v) and _channel_of(v.name) == channel]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        text = f"{len(fitting)} variables may be the {channel}: {list_names(fitting)}. Name one of them."
        raise DataError(f"{source}: {text}")
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
