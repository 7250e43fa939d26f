"""Pages from templates: every value that enters one is escaped, and no script runs but those of this library."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from ankleloop.pages.contents import find_headings


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("ankleloop.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    # Bokeh reads the models of a figure in their order.
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}
    return environment


def render_template(name: str, **values: Any) -> str:
    """Fill in a template."""
    return _environment().get_template(name).render(**values)


def render_page(
    title: str, body: str, *, index: str | None = None, wide: bool = False, pictures_of_files: bool = False
) -> str:
    """Page around a body: table of contents, link to the index, style, and the scripts that the body needs."""
    body, headings = find_headings(body)
    scripts = _scripts_of(body)
    return render_template(
        "base.html.j2",
        title=title,
        body=body,
        contents=headings,
        index=index,
        wide=wide,
        pictures_of_files=pictures_of_files,
        scripts=scripts,
        hashes=[_hash_script(script) for script in scripts] or ["'none'"],
        style=_read("templates", "page.css"),
    )


def _scripts_of(body: str) -> list[str]:
    """Scripts that a body needs: those that sort its tables, and those that draw its figures."""
    scripts = []
    if '<table class="sortable' in body:
        scripts.append(_read("scripts", "tables.js"))
    if 'class="interactive"' in body:
        scripts += [_read_bokeh(), _read("scripts", "torques.js")]
    return scripts


@cache
def _read(folder: str, name: str) -> str:
    return files("ankleloop.pages").joinpath(folder, name).read_text(encoding="utf-8")


@cache
def _read_bokeh() -> str:
    """The script of Bokeh that draws figures, without those of its widgets and tables."""
    return files("bokeh").joinpath("server", "static", "js", "bokeh.min.js").read_text(encoding="utf-8")


@cache
def _hash_script(text: str) -> str:
    """A script in the policy of a page."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
