"""Pages and tables from templates: every value that enters is escaped, and no script runs but those of the library."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from itertools import count
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

HEADING = re.compile(r"<h([23])(?=>(.*?)</h\1>)", re.DOTALL)
# Names of methods in cells, which are as short as they can be.
SHORT_NAMES = {
    r"Refined instrumental variables( \(riv\))?": "riv",
    "Parallel cascade": "cascade",
    "Real-time algorithm": "real-time",
    "instruments for B and D": "instr. for B, D",
}
EMPTY = ("", "–")  # cells without a value
TEXT = 24  # letters of a cell from which on it is a text, which wraps
FILTERED_ROWS = 15  # of a table from which it has a field that filters
NUMBER = r"[+-]?[\d.,]+(e[+-]?\d+)?|nan"
ENVIRONMENT = Environment(
    loader=PackageLoader("ankleloop.pages"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
ENVIRONMENT.policies["json.dumps_kwargs"] = {"sort_keys": False}  # Bokeh reads the models of a figure in their order


def render_template(name: str, **values: Any) -> Markup:
    """Fill in a template."""
    return Markup(ENVIRONMENT.get_template(name).render(**values))  # noqa: S704 # what enters has been escaped


def render_page(
    title: str, body: str, *, note: str = "", index: str | None = None, pictures_of_files: bool = False
) -> str:
    """Page around a body: a note, table of contents, link to the index, style, and the scripts that the body needs."""
    body, headings = find_headings(body)
    sources = [("ankleloop.pages", "scripts/tables.js")]
    if 'class="interactive"' in body:  # without Bokeh's widgets and tables
        sources += [("bokeh", "server/static/js/bokeh.min.js"), ("ankleloop.pages", "scripts/figures.js")]
    scripts = [files(package).joinpath(path).read_text(encoding="utf-8") for package, path in sources]
    return render_template(
        "base.html.j2",
        title=title,
        note=note,
        body=body,
        contents=headings,
        index=index,
        pictures_of_files=pictures_of_files,
        scripts=scripts,
        digests=[base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts],
    )


def find_headings(body: str) -> tuple[str, list[tuple[str, str]]]:
    """Give headings of the second and third level anchors, `section-1` and so on; also their levels and texts."""
    headings = [(level, Markup(content).striptags()) for level, content in HEADING.findall(body)]  # noqa: S704
    numbers = count(1)
    return HEADING.sub(lambda heading: f'<h{heading[1]} id="section-{next(numbers)}"', body), headings


def find_captions(notebook: Mapping[str, Any]) -> dict[bytes, str]:
    """Captions of the pictures that a notebook shows: their alternative texts."""
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", ()) if "data" in output]
    pictures = [
        (output["data"]["image/png"], output["metadata"]) for output in outputs if "image/png" in output["data"]
    ]
    return {base64.b64decode(data): metadata.get("image/png", {}).get("alt", "") for data, metadata in pictures}


def render_table(
    table: pd.DataFrame, links: Sequence[str] = (), *, colours: Mapping[str, str] | None = None, identifier: str = ""
) -> Markup:
    """Table as HTML with a link for each row; columns with one value are said below it.

    Cells with a colour have it as background. A long table with an identifier has a field that filters its rows.
    """
    cells = table.map(str).replace(SHORT_NAMES, regex=True)
    constant = [name for name in cells.columns[1:] if len(cells) > 2 and cells[name].nunique() == 1]
    shown = cells.drop(columns=constant)
    return render_template(
        "table.html.j2",
        table=shown,
        classes=[_class_of(shown[name]) for name in shown],
        constant={name: cells[name].iloc[0] for name in constant if cells[name].iloc[0] not in EMPTY},
        links=links or [""] * len(table),
        colours=colours or {},
        identifier=identifier,
        filtered=identifier and len(table) >= FILTERED_ROWS,
    )


def _class_of(column: pd.Series) -> str:
    texts = column[~column.isin(EMPTY)].astype(str)
    if len(texts) and texts.str.fullmatch(NUMBER).all():
        return "number"
    return "text" if texts.str.len().max() > TEXT else ""


ENVIRONMENT.globals["render_table"] = render_table
