"""Channels of a recording: how a file is mapped to them, and what names and units of the file say."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Self

import numpy as np
from pydantic import field_validator, model_validator
from pydantic_core import PydanticCustomError

from ankleloop.errors import DataError
from ankleloop.options import Options, option, show_value

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
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "msecs", "millisecond", "milliseconds"), 1e-3),
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
class Channel:
    """A variable of a file that serves as a channel of a trial."""

    name: str  # full name of the variable or attribute in the file
    unit: str  # unit that the file states, or the empty string
    shape: tuple[int, ...]  # its shape in the file
    values: np.ndarray = field(default_factory=lambda: np.empty(0))  # its samples, where they were read


def check_size(samples: int, name: str) -> None:
    """Refuse more samples than are read at once."""
    if samples > MAX_SAMPLES:
        raise DataError(
            f"{name} has {samples:,} samples by its size in the file; at most {MAX_SAMPLES:,} are read as a trial "
            f"({MAX_SAMPLES / 3.6e6:.1f} h at 1 kHz): read a long record by ankleloop.LongRecord from HDF5 or NetCDF; "
            "if the record is short, the file is damaged."
        )


def find_unit_in_name(name: str, units: tuple[str, ...]) -> str:
    """Unit at the end of a name, behind an underscore or in brackets, or the empty string."""
    match = re.search(r"(?:_|[\[(])\s*([^\W_]+|°)\s*[\])]?\s*$", name)
    unit = match.group(1).lower() if match else ""
    return unit if unit in units else ""


def join_units(stated: list[str]) -> str:
    """One text of what attributes say of a unit: contradictions stay visible, so that the unit is refused."""
    meanings: dict[object, str] = {}
    for text in stated:
        meaning: object = ANGLES.get(text.lower()) or TIME_UNITS.get(text.lower()) or _is_newton_metre(text) or text
        meanings.setdefault(meaning, text)
    return " and ".join(meanings.values())


def check_unit(role: str, name: str, stated: str, position_unit: str, *, source: str) -> None:
    """Refuse a channel whose unit, as the file states it, is another one than it is read with."""
    if role.startswith("torque"):
        if stated and not _is_newton_metre(stated):
            raise DataError(f"{source}: {name} is in {stated!r} according to the file: convert it to N·m.")
        return
    unit = stated.lower() or find_unit_in_name(name, tuple(ANGLES))
    if not unit:
        return
    fault = f"{source}: {name} is in {unit!r} according to the file"
    if unit not in ANGLES:
        raise DataError(f"{fault}: convert it to rad or deg.")
    unit = ANGLES[unit]
    if unit != position_unit:
        raise DataError(
            f"{fault}, but position_unit is {position_unit!r}: pass position_unit={unit!r}, or correct the file."
        )


def _is_newton_metre(unit: str) -> bool:
    return re.sub(r"[\s·.*⋅•×_-]", "", unit).lower() in TORQUE_UNITS


def time_factor(name: str, stated: str, *, source: str) -> float | None:
    """Seconds per unit of a time column; None if neither the file nor the name of the column states its unit."""
    of_name = find_unit_in_name(name, tuple(TIME_UNITS))
    unit = stated.lower().split(" since ")[0].strip()
    if not unit:
        return TIME_UNITS[of_name] if of_name else None
    if unit not in TIME_UNITS:
        raise DataError(f"{source}: {name} is in {stated!r} according to the file: write it in seconds, ms or µs.")
    if of_name and TIME_UNITS[of_name] != TIME_UNITS[unit]:
        raise DataError(
            f"{source}: {name} is in {stated!r} according to the file, but its name says {of_name}: correct the one "
            "that is wrong."
        )
    return TIME_UNITS[unit]


class AmbiguousNameError(DataError):
    """A channel that the names of the variables leave open."""


def find_variable(channel: str, variables: Sequence[Channel], *, source: str, taken: Iterable[str] = ()) -> str | None:
    """Find the variable of a channel by its name.

    A name fits if one of its words, between underscores, spaces, brackets or capitals, is one of `WORDS`: `ankle_angle`
    and `AnkleAngle` are positions, `angle_command` is a reference.
    """
    excluded = set(taken)
    fitting = [v.name for v in variables if v.name not in excluded and _is_signal(v) and _channel_of(v.name) == channel]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        text = f"{len(fitting)} variables may be the {channel}: {_list_names(fitting)}. Name one of them."
        raise AmbiguousNameError(f"{source}: {text}")
    if channel == "reference":
        return None
    text = f"no variable is called {' or '.join(WORDS[channel])}, so that it would be the {channel}; the file has: "
    names = [variable.name for variable in variables if _is_signal(variable)]
    raise AmbiguousNameError(f"{source}: {text}{_list_names(names) or 'none'}. Name one of these.")


def find_position_unit(variable: Channel) -> str | None:
    """Unit of a position as the file or the name of the variable states it."""
    return ANGLES.get(variable.unit.lower() or find_unit_in_name(variable.name, tuple(ANGLES)))


def _is_signal(variable: Channel) -> bool:
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


def _list_names(names: Sequence[str]) -> str:
    shown = [name if name.isprintable() else repr(name) for name in names[:LISTED]]
    return ", ".join(shown) + (" and more" if len(names) > LISTED else "")


# --- How a file is read

NAME = r"(?!torque)[A-Za-z][A-Za-z0-9_]*(?<!_variable)"
# What a trial has anyway, or what its reading records.
RESERVED = ("position", "reference", "time", "sampling_rate", "source", "position_unit", "position_sign")
FORM = "pairs of a name in the trial and the variable of the file, as {'ankle_angle': 'angle'} or 'ankle_angle=angle'"


class ReadingOptions(Options):
    """How the variables of a file become the channels of a trial: their names, units and signs."""

    position: str = option("position", "name of the position variable in the file")
    torque: str = option("torque", "name of the torque variable in the file")
    reference: str | None = option(None, "name of the command of the servo in the file; null where it was not recorded")
    sampling_rate: float | None = option(
        None, "sampling rate; null takes it from the file", unit="Hz", ge=0.001, le=1e9
    )
    position_unit: Literal["rad", "deg"] = option("rad", "unit of position and reference in the file")
    position_sign: Literal[1, -1] = option(1, "-1 turns position and reference round")
    torque_sign: Literal[1, -1] = option(1, "-1 turns the torque round, so that it opposes stretch (positive K, B, I)")
    case: int | None = option(
        None, "trial of an FLB file, counted from 1; null where the file has one", ge=1, le=1_000_000
    )
    variables: dict[str, str] | str | None = option(
        None,
        "further variables of the trial, as a schedule or the phase of a cycle: name in the trial and variable of the "
        "file, as {ankle_angle: angle}; in tables ankle_angle=angle, with commas between several",
    )

    @field_validator("variables", mode="before")
    @classmethod
    def _as_pairs(cls, value: Any) -> Any:
        """Tables and the command line have pairs as a text."""
        if value is None:
            return None
        pairs = _split_pairs(value) if isinstance(value, str) else value
        if not isinstance(pairs, Mapping) or not all(
            isinstance(text, str) and text for pair in pairs.items() for text in pair
        ):
            raise ValueError(f"variables must be {FORM}; got {show_value(value)}.")
        for name in pairs:
            if name in RESERVED or not re.fullmatch(NAME, name):
                raise ValueError(
                    f"variables: a further variable of the trial cannot be called {name!r}: take letters, digits and "
                    f"underscores, but no name that begins with torque, ends with _variable, or is one of "
                    f"{', '.join(RESERVED)}."
                )
        return dict(pairs)

    @field_validator("position_sign", "torque_sign", mode="before")
    @classmethod
    def _as_integer(cls, sign: Any) -> Any:
        """Signs from tables are often floating-point numbers."""
        if isinstance(sign, bool):  # which equals 1, but is no sign
            raise PydanticCustomError("literal_error", "must be 1 or -1", {"expected": "1 or -1"})
        return int(sign) if type(sign) is float and sign in (1, -1) else sign

    @model_validator(mode="after")
    def _check_variables(self) -> Self:
        """A variable that serves as two channels makes every estimate of one by the other perfect, and wrong."""
        channels: dict[str, str] = {}
        for channel, name in self.channels.items():
            other = channels.setdefault(name.strip("/ "), channel)
            if other != channel:
                raise ValueError(
                    f"{other} and {channel} are the same variable, {name!r}: name another one"
                    f"{', or no reference' * (channel == 'reference')}."
                )
        return self

    @property
    def channels(self) -> dict[str, str]:
        """Names of the variables in the file by channel; the reference only where it was recorded."""
        names = {"position": self.position, "torque": self.torque, "reference": self.reference}
        return {channel: name for channel, name in names.items() if name is not None}

    @property
    def further(self) -> dict[str, str]:
        """Names of further variables in the file by their names in the trial."""
        return dict(self.variables) if isinstance(self.variables, dict) else {}

    def factor(self, channel: str) -> float:
        """Compute the factor that brings the numbers of the file to rad and N·m, with the sign of the convention."""
        if channel.startswith("torque"):
            return float(self.torque_sign)
        if channel not in ("position", "reference"):
            return 1.0
        return self.position_sign * (math.pi / 180.0 if self.position_unit == "deg" else 1.0)


def _split_pairs(text: str) -> dict[str, str]:
    """Names and variables of `name=variable, name=variable`; a name alone has an empty variable."""
    pairs = (pair.partition("=") for pair in text.split(","))
    return {name.strip(): variable.strip() for name, _, variable in pairs}
