"""Templates of the pages: every value that enters one is escaped."""

from __future__ import annotations

from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

__all__ = ["render_template"]


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("ankleloop.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def render_template(name: str, **values: Any) -> str:
    """Fill in a template.

    Parameters
    ----------
    name : str
        File in the folder `templates` of this package.
    **values
        Values by the names that the template has for them.

    Returns
    -------
    str
        HTML.

    Raises
    ------
    jinja2.UndefinedError
        If a value is missing.
    """
    return _environment().get_template(name).render(**values)
