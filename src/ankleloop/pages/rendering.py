"""Pages and tables from templates: every value that enters is escaped, and no script runs but those of the library."""

from __future__ import annotations

import base64
import hashlib
import html
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined

if TYPE_CHECKING:
    import pandas as pd

HEADING = re.compile(r"<h([23])((?:\s[^>]*)?)>(.*?)</h\1>", re.DOTALL)
LINK = re.compile(r'<a class="anchor-link".*?</a>', re.DOTALL)
ANCHOR = re.compile(r'\bid="([^"]*)"')
# Names of methods in cells, which are as short as they can be; the first one that a cell has.
SHORT_NAMES = {
    "Refined instrumental variables (riv)": "riv",
    "Refined instrumental variables": "riv",
    "Parallel cascade": "cascade",
    "Real-time algorithm": "real-time",
    "instruments for B and D": "instr. for B, D",
}
NAME, TEXT = 60, 24  # letters of a cell up to which it may be a name, and from which on it is a text, which wraps
FILTERED_ROWS = 15  # of a table from which it has a field that filters
NUMBER = re.compile(r"[+-]?[\d.,]+(e[+-]?\d+)?|nan")


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
    title: str, body: str, *, note: str = "", index: str | None = None, pictures_of_files: bool = False
) -> str:
    """Page around a body: a note, table of contents, link to the index, style, and the scripts that the body needs."""
    body, headings = find_headings(f"<p><strong>{html.escape(note)}</strong></p>\n{body}" if note else body)
    sources = [("ankleloop.pages", "scripts/tables.js")] if '<table class="sortable' in body else []
    if 'class="interactive"' in body:  # without Bokeh's widgets and tables
        sources += [("bokeh", "server/static/js/bokeh.min.js"), ("ankleloop.pages", "scripts/figures.js")]
    scripts = [_read(*source) for source in sources]
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    return render_template(
        "base.html.j2",
        title=title,
        body=body,
        contents=headings,
        index=index,
        pictures_of_files=pictures_of_files,
        scripts=scripts,
        hashes=[f"'sha256-{digest}'" for digest in digests] or ["'none'"],
        style=_read("ankleloop.pages", "templates/page.css"),
    )


def find_headings(body: str) -> tuple[str, list[tuple[str, str, str]]]:
    """Give headings of the second and third level anchors of their own; also their levels, texts and anchors."""
    headings: list[tuple[str, str, str]] = []

    def add_anchor(match: re.Match[str]) -> str:
        level, attributes, content = match.groups()
        text = " ".join(html.unescape(re.sub("<.*?>", "", LINK.sub("", content))).split())
        anchor = ANCHOR.search(attributes)
        name = html.unescape(anchor[1]) if anchor else re.sub(r"\W+", "-", text).strip("-")
        if name in [used for *_, used in headings]:
            name = f"{name}-{len(headings) + 1}"
        headings.append((level, text, name))
        return f'<h{level} id="{html.escape(name)}"{ANCHOR.sub("", attributes).rstrip()}>{content}</h{level}>'

    return HEADING.sub(add_anchor, body), headings


@cache
def _read(package: str, path: str) -> str:
    return files(package).joinpath(path).read_text(encoding="utf-8")


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


def describe_table(
    table: pd.DataFrame,
    links: Sequence[str] = (),
    *,
    colours: Mapping[str, str] | None = None,
    identifier: str = "",
) -> dict[str, Any]:
    """A table for the template `table.html.j2`, with a link for each row; columns with one value are said below it."""
    columns = {str(name): [_shorten(str(cell)) for cell in cells] for name, cells in table.items()}
    repeated = [name for name, cells in columns.items() if len(cells) > 2 and len(set(cells)) == 1]
    constant = {name: columns.pop(name)[0] for name in repeated if name != str(table.columns[0])}
    return {
        "identifier": identifier,
        "filtered": len(table) >= FILTERED_ROWS,
        "names": list(columns),
        "classes": [_class_of(cells) for cells in columns.values()],
        "rows": list(zip(*columns.values(), strict=True)),
        "constant": [f"{name} {text}" for name, text in constant.items() if text not in ("", "–")],
        "links": links or [""] * len(table),
        "colours": colours or {},
    }


def _shorten(text: str) -> str:
    """A name of a method in short."""
    name = next((name for name in SHORT_NAMES if name in text), "")
    return text.replace(name, SHORT_NAMES[name]) if name and len(text) <= NAME else text


def _class_of(column: Sequence[str]) -> str:
    texts = [text for text in column if text not in ("", "–")]
    if texts and all(map(NUMBER.fullmatch, texts)):
        return "number"
    return "text" if max(map(len, texts), default=0) > TEXT else ""


def render_table(table: pd.DataFrame, links: Sequence[str] = (), *, colours: Mapping[str, str] | None = None) -> str:
    """Table as HTML; cells with a colour have it as background."""
    return render_template("table.html.j2", table=describe_table(table, links, colours=colours))


def render_paragraphs(items: Iterable[tuple[str, str]]) -> str:
    """Paragraphs as HTML, each with a term in bold in front."""
    return render_template("paragraphs.html.j2", items=items)
