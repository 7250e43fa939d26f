"""Units of the channels of a trial: torques in N·m, positions in rad or degrees."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.options import as_text

TORQUE_UNIT = "N·m"
POSITION_UNITS = {  # and their rad
    "rad": 1.0,
    "deg": math.pi / 180.0,
}
# Spellings of the units, without signs and capitals.
SPELLINGS = {
    "": "defaultunits",  # of nldat, where nobody has said which
    "N·m": "nm newtonmeter newtonmetre newtonmeters newtonmetres",
    "rad": "rad radian radians",
    "deg": "deg degree degrees °",
}
# What turns samples into numbers with a unit, where no convention says how, and its neutral value.
SCALES = {"conversion": 1.0, "gain": 1.0, "scale": 1.0, "sensitivity": 1.0, "offset": 0.0}


UNITS = {word: unit for unit, words in SPELLINGS.items() for word in words.split()}


def normalise_unit(text: str) -> str:
    """Unit in one of its spellings, without signs and capitals; another text as it is."""
    return UNITS.get(re.sub(r"[\s·.*⋅•×_^()\[\]-]", "", text).lower(), text)


def find_stated_unit(
    attributes: Mapping[str, Any], normalise: Callable[[str], str] = normalise_unit
) -> str:
    """Unit that attributes state, and a scale without a convention; texts that differ are joined, to be refused."""
    units: dict[str, str] = {}
    scales = {} if is_nwb(attributes) else SCALES
    for name, value in attributes.items():
        word = name.lower()
        is_number = np.asarray(value).dtype.kind in "iuf"
        if word in ("units", "unit"):
            text = as_text(value)
            units[normalise(text)] = text
        elif word in scales and is_number and np.any(value != scales[word]):
            units[name] = f"{name} = {value}"
    return " and ".join(text for unit, text in units.items() if unit)


def is_nwb(attributes: Mapping[str, Any]) -> bool:
    """Whether a scale follows the convention of NWB: in its unit a sample is `stored · conversion + offset`."""
    return "conversion" in attributes and "unit" in attributes


def check_unit(name: str, stated: str, expected: str, *, source: str) -> None:
    """Refuse a channel that states another unit than the expected one; most state none."""
    if normalise_unit(stated) not in ("", expected):
        raise DataError(
            f"{source}: {name} is in {stated!r} according to its attributes: convert it to {expected}."
        )
