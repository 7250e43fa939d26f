"""Pages from templates: every value that enters one is escaped, and no script runs but those of this library."""

from __future__ import annotations

import base64
import hashlib
import html
import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from itertools import pairwise
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

HEADING = re.compile(r"<h([23])((?:\s[^>]*)?)>(.*?)</h\1>", re.DOTALL)
LINK = re.compile(r'<a class="anchor-link".*?</a>', re.DOTALL)
ANCHOR = re.compile(r'\bid="([^"]*)"')


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


def render_page(title: str, body: str, *, index: str | None = None, pictures_of_files: bool = False) -> str:
    """Page around a body: table of contents, link to the index, style, and the scripts that the body needs."""
    body, headings = find_headings(body)
    scripts = [_read("ankleloop.pages", "scripts/tables.js")] if '<table class="sortable' in body else []
    if 'class="interactive"' in body:  # without Bokeh's widgets and tables
        scripts += [_read("bokeh", "server/static/js/bokeh.min.js"), _read("ankleloop.pages", "scripts/figures.js")]
    return render_template(
        "base.html.j2",
        title=title,
        body=body,
        contents=headings,
        index=index,
        pictures_of_files=pictures_of_files,
        scripts=scripts,
        hashes=[_hash_script(script) for script in scripts] or ["'none'"],
        style=_read("ankleloop.pages", "templates/page.css"),
    )


def find_headings(body: str) -> tuple[str, list[tuple[str, str, str]]]:
    """Give headings of the second and third level anchors of their own; also their levels, texts and anchors."""
    headings: list[tuple[str, str, str]] = []

    def add_anchor(match: re.Match[str]) -> str:
        level, attributes, content = match.groups()
        text = " ".join(html.unescape(re.sub("<.*?>", "", LINK.sub("", content))).split())
        anchor = ANCHOR.search(attributes)
        name = stem = html.unescape(anchor[1]) if anchor else re.sub(r"\W+", "-", text).strip("-")
        used, number = {anchor for *_, anchor in headings}, 2
        while name in used:
            name, number = f"{stem}-{number}", number + 1
        headings.append((level, text, name))
        others = ANCHOR.sub("", attributes).strip()
        return f'<h{level} id="{html.escape(name)}"{" " + others if others else ""}>{content}</h{level}>'

    return HEADING.sub(add_anchor, body), headings


@cache
def _read(package: str, path: str) -> str:
    return files(package).joinpath(path).read_text(encoding="utf-8")


@cache
def _hash_script(text: str) -> str:
    """A script in the policy of a page."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def render_notebook_page(title: str, body_html: str, note: str = "", *, index: str | None = None) -> str:
    """Page of an executed notebook."""
    notice = f"<p><strong>{html.escape(note)}</strong></p>\n" if note else ""
    return render_page(title, notice + body_html, index=index)


def find_captions(notebook: Mapping[str, Any]) -> dict[bytes, str]:
    """Captions of the pictures that a notebook shows: the text that follows each of them in its cell."""
    captions = {}
    for cell in notebook["cells"]:
        for output, following in pairwise(cell.get("outputs", [])):
            picture, text = output.get("data", {}).get("image/png"), following.get("data", {}).get("text/markdown")
            if picture and text:
                caption = " ".join(text.replace("**", "").split())
                captions[base64.b64decode(picture)] = caption
                output["metadata"].setdefault("image/png", {})["alt"] = caption
    return captions
