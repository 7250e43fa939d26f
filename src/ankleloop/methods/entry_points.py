"""Entry points by which other packages register methods; it imports nothing but the standard library."""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, entry_points

GROUP = "ankleloop.methods"


@cache
def find_entry_points() -> tuple[EntryPoint, ...]:
    """The entry points of all installed packages that register methods."""
    return tuple(entry_points(group=GROUP))


def name_package(entry_point: EntryPoint) -> str:
    """Name and version of the package of an entry point, as NAME==VERSION."""
    package = entry_point.dist
    return "an unknown package" if package is None else f"{package.name}=={package.version}"


def list_packages() -> list[str]:
    """Names and versions of the packages that register methods, sorted."""
    return sorted({name_package(entry_point) for entry_point in find_entry_points()})
