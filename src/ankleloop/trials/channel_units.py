"""Units that a file states for its channels, by an attribute or by the name of a variable."""

from __future__ import annotations

import re

from ankleloop.errors import DataError

TORQUE_UNITS = ("nm", "newtonmeter", "newtonmetre", "newtonmeters", "newtonmetres")
TIME_UNITS = {
    "s": 1.0,
    "sec": 1.0,
    "secs": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "msecs": 1e-3,
    "millisecond": 1e-3,
    "milliseconds": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "μs": 1e-6,
    "usec": 1e-6,
    "microsecond": 1e-6,
    "microseconds": 1e-6,
}
ANGLES = {"deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "rad": "rad", "radian": "rad", "radians": "rad"}


def find_unit_in_name(name: str, units: tuple[str, ...]) -> str:
    """Unit at the end of a name, behind an underscore or in brackets, or the empty string."""
    match = re.search(r"(?:_|[\[(])\s*([^\W_]+|°)\s*[\])]?\s*$", name)
    unit = match.group(1).lower() if match else ""
    return unit if unit in units else ""


def check_unit(role: str, name: str, stated: str, position_unit: str, *, source: str) -> None:
    """Refuse a channel whose unit, as the file states it, is another one than it is read with."""
    if role.startswith("torque"):
        if stated and re.sub(r"[\s·.*⋅•×_-]", "", stated).lower() not in TORQUE_UNITS:
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
