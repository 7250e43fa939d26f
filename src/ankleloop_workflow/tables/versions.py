"""Versions of the packages that compute, which tables carry."""

from __future__ import annotations

from importlib.metadata import version

COMPUTING = ("numpy", "scipy", "numba", "control")  # packages whose versions may change numbers


def read_versions() -> dict[str, str]:
    """Versions of the packages that compute, as they are installed."""
    return {package: version(package) for package in COMPUTING}
