"""Checks of arguments and one wording of their limits, for options and for functions that have none.

A flag is no number, text is no flag, a float without a fraction is a whole number, numbers of numpy are numbers, and no
number is nan or infinite.
"""

from __future__ import annotations

import math
import os
import reprlib
import sys
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

LARGEST_MEMORY = 64 * 2**30  # bytes, of a machine that does not state its memory
CONTROL_GROUP = Path("/sys/fs/cgroup/memory.max")  # of a container, or of a job on a cluster

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 80


def show_value(value: Any) -> str:
    """A value as a message shows it, cut where it is long."""
    return " ".join(_SHORT.repr(value).split())


def suggest_name(name: Any, names: Iterable[str]) -> str:
    """Question that offers the name that is nearest to an unknown one, in brackets; empty where none is near."""
    from difflib import get_close_matches  # here, because only errors need it

    close = get_close_matches(str(name), list(names), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def describe_limits(
    unit: str = "1",
    *,
    ge: float | None = None,
    gt: float | None = None,
    le: float | None = None,
    lt: float | None = None,
) -> str:
    """Limits in words, with their unit; empty where there are none."""
    if ge is not None and le is not None:
        words = f"between {_show_limit(ge)} and {_show_limit(le)}"
    else:
        limits = (("at least", ge), ("above", gt), ("at most", le), ("below", lt))
        words = " and ".join(f"{word} {_show_limit(limit)}" for word, limit in limits if limit is not None)
    return words and words + ("" if unit == "1" else f" {unit}")


def _show_limit(limit: float) -> str:
    return f"{limit:.6g}".replace("e+", "e").replace("e0", "e").replace("e-0", "e-")


def as_plain(value: Any) -> Any:
    """A scalar of numpy as the number, flag or text of Python that it is; anything else unchanged."""
    if type(value).__module__ == "numpy" and hasattr(value, "item") and getattr(value, "ndim", None) == 0:
        return value.item()
    return value


def check_number(owner: str, name: str, value: Any, unit: str = "1", **limits: float) -> float:
    """Check that an argument is a finite number within its limits."""
    number = as_plain(value)
    if type(number) not in (int, float) or not abs(number) <= sys.float_info.max:
        _refuse(owner, name, value, "a finite number", unit, limits)
    if not _is_within(number, **limits):
        _refuse(owner, name, value, "", unit, limits)
    return float(number)


def check_integer(owner: str, name: str, value: Any, unit: str = "1", **limits: float) -> int:
    """Check that an argument is a whole number within its limits, as `check_number` does."""
    number = as_plain(value)
    if type(number) not in (int, float) or not (type(number) is int or number.is_integer()):
        _refuse(owner, name, value, "a whole number", unit, limits)
    if not _is_within(number, **limits):
        _refuse(owner, name, value, "", unit, limits)
    return int(number)


def _is_within(
    number: float, ge: float = -math.inf, gt: float = -math.inf, le: float = math.inf, lt: float = math.inf
) -> bool:
    return ge <= number <= le and gt < number < lt


def _refuse(owner: str, name: str, value: Any, kind: str, unit: str, limits: dict[str, float]) -> NoReturn:
    raise ValueError(f"{owner}: {name} must be {describe_kind(kind, unit, limits)}, got {show_value(value)}.")


def describe_kind(kind: str, unit: str, limits: dict[str, float]) -> str:
    """Kind of a value with its limits: "a whole number between 1 and 20"; either may be missing."""
    words = describe_limits(unit, **limits)
    if not kind:
        return words
    if not words:
        return kind if unit == "1" else f"{kind} [{unit}]"
    return f"{kind} of {words}" if words.startswith("at ") else f"{kind} {words}"


def check_flag(owner: str, name: str, value: Any) -> bool:
    """Check that an argument is true or false."""
    flag = as_plain(value)
    if type(flag) is not bool:
        raise ValueError(f"{owner}: {name} must be True or False, got {show_value(value)}.")
    return flag


def check_text(owner: str, name: str, value: Any) -> str:
    """Check that an argument is text."""
    if not isinstance(value, str):
        raise ValueError(f"{owner}: {name} must be text, got {show_value(value)}.")
    return value


def check_choice(owner: str, name: str, value: Any, choices: Sequence[Any]) -> Any:
    """Check that an argument is one of some values."""
    plain = as_plain(value)
    for choice in choices:
        if type(plain) is type(choice) and plain == choice:
            return choice
    *others, last = map(repr, choices)
    known = f"one of {', '.join(others)} or {last}" if others else last
    raise ValueError(f"{owner}: {name} must be {known}; got {show_value(value)}.")


def check_path(owner: str, name: str, value: Any) -> Path:
    """Check that an argument is the path of a file."""
    if not isinstance(value, (str, os.PathLike)):
        raise TypeError(f"{owner}: {name} must be text or a pathlib.Path, got {show_value(value)}.")
    return Path(value)


def check_memory(owner: str, size: float, remedy: str) -> None:
    """Refuse what needs more memory than the machine has, before anything is allocated."""
    limit = _find_memory()
    if size > limit:
        raise ValueError(
            f"{owner}: this would need {_show_bytes(size)} of memory, and the machine has {_show_bytes(limit)}: "
            f"{remedy}."
        )


@cache
def _find_memory() -> int:
    """Memory of the machine, or of the container or job that this process belongs to [bytes]."""
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not a POSIX system
        return LARGEST_MEMORY
    try:
        return min(memory, int(CONTROL_GROUP.read_text()))
    except (OSError, ValueError):  # no such file, or no limit
        return memory


def _show_bytes(size: float) -> str:
    for unit, factor in (("EB", 1e18), ("PB", 1e15), ("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size / 1e3:.3g} kB"
