"""Channels of a recording as they come from a file: how many samples are read at once, and what their units say."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from ankleloop.errors import DataError

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


@dataclass(frozen=True)
class Channel:
    """A variable of a file that serves as a channel of a trial."""

    name: str  # full name of the variable or attribute in the file
    unit: str  # unit that the file states, or the empty string
    shape: tuple[int, ...]  # its shape in the file
    values: np.ndarray | None = None  # its samples; None where they were not read


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
