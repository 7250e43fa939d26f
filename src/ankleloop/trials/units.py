"""Units of the variables of a file, as their attributes or the ends of their names state them."""

from __future__ import annotations

import re

from ankleloop.errors import DataError

TORQUE_UNITS = ("nm", "newtonmeter", "newtonmetre", "newtonmeters", "newtonmetres")
TIME_UNITS = {
    **dict.fromkeys(("s", "sec", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "μs", "usec", "microsecond", "microseconds"), 1e-6),
}
ANGLE_UNITS = {
    **dict.fromkeys(("deg", "degree", "degrees", "°"), "deg"),
    **dict.fromkeys(("rad", "radian", "radians"), "rad"),
}
PART_NUMBERS = re.compile(r"(\[[\d:,* ]+\])+$")
RATE_UNITS = ("", "hz", "hertz", "1/s", "s-1", "s^-1", "samples/s", "samples per second")


def normalise_unit(text: str) -> str:
    """Unit in one of its spellings, where it is one of a channel."""
    plain = re.sub(r"[\s·.*⋅•×_-]", "", text).lower()
    return "N·m" if plain in TORQUE_UNITS else ANGLE_UNITS.get(plain, text)


def find_unit_in_name(name: str) -> str:
    """What may be a unit at the end of a name, behind an underscore or in brackets, or the empty string.

    The numbers of a part, as those of `angle_deg[3]`, do not count.
    """
    whole = PART_NUMBERS.sub("", name)
    match = re.search(r"(?:_|[\[(])\s*([^\W_]+|°)\s*[\])]?\s*$", whole)
    return match.group(1).lower() if match else ""


def find_position_unit(name: str, stated: str) -> str | None:
    """Unit of a position as the file states it, or else its name."""
    return ANGLE_UNITS.get(stated.lower() or find_unit_in_name(name))


def check_unit(role: str, name: str, stated: str, position_unit: str, *, source: str) -> None:
    """Refuse a channel whose unit, as the file states it, is another one than it is read with."""
    if role.startswith("torque"):
        unit = normalise_unit(stated)
        expected = "N·m"
    else:
        unit = find_position_unit(name, stated) or stated
        expected = position_unit
    if unit in ("", expected):
        return
    remedy = {}
    if expected == "N·m":
        advice = ": convert it to N·m"
    elif unit in ANGLE_UNITS.values():
        remedy["position_unit"] = unit
        advice = f", but position_unit is {position_unit!r}: pass position_unit={unit!r} to read_trial, or convert it"
    else:
        advice = ": convert it to rad or deg"
        if role == "reference":
            advice += ", or leave it out"
    raise DataError(f"{source}: {name} is in {unit!r} according to the file{advice}.", remedy)


def time_factor(name: str, stated: str, *, source: str) -> float | None:
    """Seconds per unit of a time column; None if neither the file nor the name of the column states its unit."""
    unit = stated.lower().split(" since ")[0].strip()
    if unit and unit not in TIME_UNITS:
        raise DataError(
            f"{source}: {name} is in {stated!r} according to the file: write it in seconds, ms or µs."
        )
    return TIME_UNITS.get(unit or find_unit_in_name(name))
