"""Units of the variables of a file, as their attributes or the ends of their names state them.

A registry of our own, in units.txt, has all that are known: the usual one of Pint knows `dot` as a pixel and `RA` as a
resistance. An angle is a dimension there, and no unit is one of energy.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from ankleloop.errors import DataError
from ankleloop.trials.units import TORQUE_UNIT, normalise_unit

if TYPE_CHECKING:
    import pint

FILE = Path(__file__).with_name("units.txt")
# Usual units, and their dimensions.
DIMENSIONS = {
    "rad": {"[angle]": 1},
    TORQUE_UNIT: {"[force]": 1, "[length]": 1},
    "s": {"[time]": 1},
}
# Usual units of each channel with the option for it. A command may be one of the torque.
OPTIONS = {
    "position": ("position_unit", ("rad",)),
    "torque": ("torque_unit", (TORQUE_UNIT,)),
    "reference": ("reference_unit", ("rad", TORQUE_UNIT)),
}
# What a number stands for, where it is more than so much for each unit of the file.
NEEDS = {"N": "the lever arm in m", "N·m/kg": "the mass of the body in kg"}

TIME_WORDS = {"time", "times", "t", "timestamp", "timestamps", "zeit", "elapsed"}
WORDS_OF_TIME = TIME_WORDS | {"lsl", "stamp", "stamps"}
NUMBERS = re.compile(r"(\[[\d:,* ]+\]|\.\d+)+$|(?<=\w)\.$")  # of a part, and what R makes of names
BRACKETS = re.compile(r"[(\[]([^()\[\]]*[^\W\d_][^()\[\]]*|[°%])[)\]]$")  # that have no number
RATE_UNITS = ("", "hz", "hertz", "1/s", "s-1", "s^-1", "samples/s", "samples per second")
# A unit in a name begins behind one of these signs, or with a capital.
UNIT_START = re.compile(r"^|[\s_,.-]+|(?<=[a-z])(?=[A-Z][A-Za-z])")
SIGNS = re.compile(r"[\s·.*⋅•×_^-]")  # between the units of a product
INVERSE = re.compile(r"[\s·.*⋅_]*([^\W\d_]+)\^?(-1|⁻¹)")  # kg⁻¹
PER = re.compile(r"/|(?<![^\W_])per(?![^\W_])")
LONE = ("V", "N")  # letters that are units without brackets, too; A and others are sides and legs
WORDS = ("in",)  # units that are words of names


@cache
def _load_registry() -> pint.UnitRegistry:
    """The registry of our own."""
    import pint  # here: the help of the command needs none

    registry: pint.UnitRegistry = pint.UnitRegistry(FILE)
    registry.formatter.default_sort_func = None  # N·m, as it is written
    return registry


@cache
def _load_units() -> dict[str, pint.Unit]:
    """Units by all their names, without capitals."""
    registry = _load_registry()
    units = {name.lower(): registry.Unit(name) for name in registry}
    return units | {
        "": registry.Unit(""),
        "1": registry.Unit(""),
        "%mvc": units["%"],
        "nmkg": units["n"] * units["m"] / units["kg"],
    }


def parse_unit(text: str) -> pint.Unit | None:
    """The unit that a text says in any spelling, such as ft.lb, kgfcm or N·m/kg; None if it says none."""
    text = INVERSE.sub(r"/\1", text.lower().strip(" ()[]"))
    above, *below = map(_parse_product, PER.split(text))
    if above is None or None in below or (not below and above.dimensionless):
        return None
    for unit in below:
        above = above / unit
    return above


def _parse_product(text: str) -> pint.Unit | None:
    """The unit of a word, or the torque of a force and a length without a sign between them."""
    units = _load_units()
    word = SIGNS.sub("", text)
    if word in units:
        return units[word]
    for place in range(1, len(word)):
        first, second = units.get(word[:place]), units.get(word[place:])
        if first is not None and second is not None and is_of(first * second, TORQUE_UNIT):
            return first * second
    return None


def is_of(unit: pint.Unit | None, usual: str) -> bool:
    """Whether a unit is one of the quantity that is usually in another one: rad, N·m or s."""
    return unit is not None and unit.dimensionality == DIMENSIONS[usual]


def name_unit(unit: pint.Unit) -> str:
    """Short name of a unit."""
    return f"{unit:~P}"


def normalise(text: str) -> str:
    """Name of a unit in any spelling; empty where nobody has said which; another text as it is."""
    unit = parse_unit(text)
    return name_unit(unit) if unit is not None else normalise_unit(text)


def split_unit(name: str) -> tuple[str, str]:
    """A name without its unit, and its unit: what its last brackets have, or else the longest end that is a unit."""
    return _split_end(name, _is_unit_of_channel)


def _split_end(name: str, is_unit: Callable[[str], bool]) -> tuple[str, str]:
    """A name without what its last brackets have, or else without its longest end that is a unit; and that.

    The numbers of a part, as those of `angle_deg[3]`, do not count.
    """
    whole = NUMBERS.sub("", name)
    brackets = BRACKETS.search(whole)
    if brackets:
        return whole[: brackets.start()], brackets[1].strip()
    for start in UNIT_START.finditer(whole):
        end = whole[start.end() :]
        if is_unit(end):
            return whole[: start.start()], end
    return whole, ""


def _is_unit_of_channel(end: str) -> bool:
    """Whether the end of a name is a unit, and no letter or word of the name."""
    unit = parse_unit(end)
    if unit is None or end.lower() in WORDS or is_of(unit, "s"):
        return False
    return len(end) > 1 or not end.isalpha() or end in LONE


@dataclass(frozen=True)
class ChannelUnit:
    """Unit of a channel in a file: its name, how much of the usual unit 1 is, and whether the file states it."""

    name: str
    factor: float
    usual: str
    stated: bool = False


def parse_option(option: str, value: object) -> object:
    """Name of the unit that an option has in any spelling; refused if it is none of the channel."""
    if not isinstance(value, str):
        return value
    units = next(units for name, units in OPTIONS.values() if name == option)
    unit = parse_unit(value)
    usual = " or ".join(units)
    number = f"a number, how many {usual} 1 is in the file"
    if unit is None:
        raise ValueError(f"{option} must be a unit such as {usual}, or {number}; got {value!r}.")
    if not any(is_of(unit, each) for each in units):
        raise ValueError(
            f"{option} takes {number}, for one that is in {name_unit(unit)}: pass {_need(unit, usual)}; got {value!r}."
        )
    return name_unit(unit)


def _need(unit: pint.Unit | None, usual: str) -> str:
    """The number by which samples in a unit become a channel."""
    if unit is None:
        return f"the {usual} of 1 in the file"
    return NEEDS.get(name_unit(unit), f"the {usual} per {unit:P}")


def find_unit(
    role: str,
    name: str,
    stated: str,
    given: str | float | None = None,
    default: ChannelUnit | None = None,
    *,
    source: str,
) -> ChannelUnit:
    """Unit of a channel: the one that the file states by an attribute or its name, or the given one, or the default.

    A number that is given is how much 1 is in the file. It overrides no unit of an angle, or a torque, that the file
    states. A name that is given overrides what brackets have that is no unit.
    """
    option, units = OPTIONS["torque" if role.startswith("torque") else role]
    text = normalise_unit(stated) or split_unit(name)[1]
    if "offset = " in text.lower():
        raise DataError(
            f"{source}: {name} has {text} according to the file, which no option applies: apply it to the samples, "
            "and make the trial with new_trial."
        )
    unit = parse_unit(text) if text else None
    kind = next((each for each in units if is_of(unit, each)), None)
    usual = kind or units[0]
    fault = f"{source}: {name} is in {text!r} according to the file"
    if unit is not None and kind is not None:
        own = ChannelUnit(name_unit(unit), _factor(unit), usual, stated=True)
        if given is None or math.isclose(_factor_of(given), own.factor, rel_tol=1e-6):
            return own
        raise DataError(
            f"{fault}, but {option} is {given!r}: pass {option}={own.name!r} (1 {own.name} = {own.factor:.6g} "
            f"{usual}), or convert it to {usual}.",
            remedy={option: own.name},
        )
    is_open = not text or (unit is None and not normalise_unit(stated))  # brackets need a word
    if isinstance(given, float):
        return ChannelUnit(f"{given:g} {usual}", given, usual)
    if given is not None and is_open:
        return ChannelUnit(given, _factor_of(given), usual)
    if not text:
        return default or ChannelUnit(usual, 1.0, usual)
    raise DataError(
        f"{fault}: pass {_need(unit, usual)} as {option}, or convert it to {usual}.",
        remedy={option: None},
    )


def _factor(unit: pint.Unit) -> float:
    """How much rad, N·m or s a unit is."""
    return float(_load_registry().Quantity(1.0, unit).to_root_units().magnitude)


def _factor_of(given: str | float) -> float:
    """How much rad or N·m 1 is, as an option says it."""
    if isinstance(given, float):
        return given
    unit = parse_unit(given)
    assert unit is not None, "the options have checked it"
    return _factor(unit)


# --- Times


def seconds_of(text: str) -> float | None:
    """Seconds of a unit of time; None if a text says none."""
    unit = parse_unit(text)
    return _factor(unit) if unit is not None and is_of(unit, "s") else None


def split_time(name: str) -> tuple[str, str]:
    """Name of a time without its unit, and its unit: what brackets have, or the last word."""
    return _split_end(name, lambda end: seconds_of(end) is not None)


def is_time(text: str) -> bool:
    """Whether a whole name says a time, with or without a unit, or what it has in brackets is a unit of time."""
    name, unit = split_time(text)
    words = set(re.findall(r"[^\W\d_]+", name.lower()))
    if seconds_of(unit) is not None and (not words or text[-1:] in ")]"):
        return True
    return bool(words & TIME_WORDS) and words <= WORDS_OF_TIME and text != "T"  # often the torque


def time_factor(name: str, stated: str, *, source: str) -> float | None:
    """Seconds per unit of a time column; None if neither the file nor the name of the column states its unit."""
    text = stated.lower().split(" since ")[0].strip() or split_time(name)[1]
    if not text:
        return None
    factor = seconds_of(text)
    if factor is None:
        raise DataError(
            f"{source}: {name} is in {text!r} according to the file: write it in seconds, ms or µs."
        )
    return factor
