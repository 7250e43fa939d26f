"""Units of the variables of a file, as their attributes or the ends of their names state them."""

from __future__ import annotations

import re
from collections.abc import Container

from ankleloop.errors import DataError
from ankleloop.trials.units import POSITION_UNITS, by_spelling, normalise_unit, strip_unit
from ankleloop.trials.units import SPELLINGS as TRIAL_SPELLINGS

TORQUE_UNITS = {  # and their N·m
    "N·m": 1.0,
    "mN·m": 1e-3,
    "N·cm": 1e-2,
    "lbf·ft": 1.3558179483314004,
    "lbf·in": 0.1129848290276167,
    "kgf·m": 9.80665,
}
# Spellings of the units of channels, without signs and capitals.
SPELLINGS = TRIAL_SPELLINGS | {
    "mN·m": "mnm nmm millinewtonmeter millinewtonmetre millinewtonmeters millinewtonmetres",
    "N·cm": "ncm newtoncentimeter newtoncentimetre newtoncentimeters newtoncentimetres",
    "lbf·ft": "lbfft ftlbf ftlb ftlbs lbft lbsft footpound footpounds poundfoot poundfeet",
    "lbf·in": "lbfin inlbf inlb inlbs lbin lbsin inchpound inchpounds poundinch",
    "kgf·m": "kgfm mkgf kgm kpm",
}
# How much N·m, or rad, 1 is in other units, and their spellings.
OTHERS = {
    "the {} per volt": "v mv uv volt volts millivolt millivolts",
    "the {} per count": "count counts adc bit bits lsb tick ticks pulse pulses step steps",
    "the {} of 1 %": "% percent pct %mvc",
    "the lever arm in m": "n newton newtons",
    "the mass of the body in kg": "nm/kg nmkg nmkg1 nmperkg 1/kg /kg",
    "the {} of 1 in the file": "kn lb lbs lbf kg kgf mm cm a ma",
}
TIME_SPELLINGS = {
    1.0: "s sec second seconds",
    1e-3: "ms msec millisecond milliseconds",
    1e-6: "us µs μs usec microsecond microseconds",
}
TIME_WORDS = ("time", "times", "t", "timestamp", "timestamps", "zeit", "elapsed", "elapsed time")
PART_NUMBERS = re.compile(r"(\[[\d:,* ]+\])+$")
BRACKETS = re.compile(r"[(\[]([^()\[\]]*[^\W\d_][^()\[\]]*|[°%])[)\]]$")  # that have no number
RATE_UNITS = ("", "hz", "hertz", "1/s", "s-1", "s^-1", "samples/s", "samples per second")
# A unit in a name begins behind one of these signs, or with a capital.
UNIT_START = re.compile(r"^|[\s_,(\[-]+|(?<=[a-z])(?=[A-Z][A-Za-z])")


UNITS = by_spelling(SPELLINGS)
OTHER_UNITS = by_spelling(OTHERS)
TIME_UNITS = by_spelling(TIME_SPELLINGS)
CHANNEL_UNITS = UNITS | OTHER_UNITS


def is_unit(text: str) -> bool:
    """Whether a text is a known unit of a channel or a time."""
    return strip_unit(text) in CHANNEL_UNITS | TIME_UNITS


def split_unit(name: str, units: Container[str] = CHANNEL_UNITS) -> tuple[str, str]:
    """A name without its unit, and the longest end of it that is a unit, or else what its last brackets have.

    The numbers of a part, as those of `angle_deg[3]`, do not count.
    """
    whole = PART_NUMBERS.sub("", name)
    for start in UNIT_START.finditer(whole):
        end = whole[start.end() :]
        if strip_unit(end) in units:
            return whole[: start.start()], end.strip(" ()[]")
    brackets = BRACKETS.search(whole)
    if brackets:
        return whole[: brackets.start()], brackets[1].strip()
    return whole, ""


def find_position_unit(name: str, stated: str) -> str | None:
    """Unit of a position as the file states it, or else its name; None where it is read with an option only."""
    unit = normalise_unit(stated or split_unit(name)[1], UNITS)
    return unit if unit in ("rad", "deg") else None


def find_factor(
    role: str, name: str, stated: str, given: str | float | None = None, *, source: str
) -> float:
    """How much N·m, or rad, 1 is in a channel; one whose unit, as the file states it, is not the given one is refused.

    Without an option it is read in rad or N·m. An option settles what a name has in brackets, if that is no unit; a
    number, how much 1 is in the file, settles all but an offset.
    """
    option, usual, factors = "position_unit", "rad", POSITION_UNITS
    if role.startswith("torque"):
        option, usual, factors = "torque_unit", "N·m", TORQUE_UNITS
    if "offset = " in stated.lower():
        raise DataError(
            f"{source}: {name} has {stated} according to the file, which no option applies: apply it to the samples, "
            "and make the trial with new_trial."
        )
    expected = given or usual
    factor = expected if isinstance(expected, float) else factors[expected]
    unit = normalise_unit(stated or split_unit(name)[1], UNITS)
    is_settled = given is not None and not stated and not is_unit(unit)
    if unit in ("", expected) or isinstance(given, float) or is_settled:
        return factor
    if unit in factors:
        advice = f", but {option} is {expected!r}: pass {option}={unit!r} (1 {unit} = {factors[unit]:.6g} {usual})"
    else:
        size = OTHER_UNITS.get(strip_unit(unit), "the {} of 1 in the file").format(usual)
        advice = f": pass {size} as {option}"
    raise DataError(
        f"{source}: {name} is in {stated or unit!r} according to the file{advice}, or convert it to {usual}.",
        remedy={option: unit if unit in factors else None},
    )


def is_time(text: str) -> bool:
    """Whether a name or a unit says that something is a time: by a word and no other, or by a unit in brackets."""
    word, unit = split_unit(text, TIME_UNITS)
    word = word.strip(" _,-").lower()
    is_unit_of_time = strip_unit(unit) in TIME_UNITS and (word == "" or text.endswith((")", "]")))
    return is_unit_of_time or (word in TIME_WORDS and text != "T")  # which is often the torque


def time_factor(name: str, stated: str, *, source: str) -> float | None:
    """Seconds per unit of a time column; None if neither the file nor the name of the column states its unit."""
    unit = stated.lower().split(" since ")[0].strip() or split_unit(name, TIME_UNITS)[1]
    if unit and strip_unit(unit) not in TIME_UNITS:
        raise DataError(
            f"{source}: {name} is in {unit!r} according to the file: write it in seconds, ms or µs."
        )
    return TIME_UNITS.get(strip_unit(unit))
