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

HEADING = re.compile(r"<h([23])(?=>(.*?)</h\1>)", re.DOTALL)  # level and content
# Names of methods in cells, which are as short as they can be; one before a word begins a sentence.
SHORT_NAMES = {
    r"Refined instrumental variables(?! \w)( \(riv\))?": "riv",
    "Parallel cascade": "cascade",
}
TEXT = 24  # letters of a cell from which on it is a text, which wraps
NUMBER = r"[+-]?[\d.,]+(e[+-]?\d+)?|nan"
ENVIRONMENT = Environment(
    loader=PackageLoader("ankleloop.pages"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
)
ENVIRONMENT.policies["json.dumps_kwargs"] = {
    "sort_keys": False
}  # Bokeh reads the models of a figure in their order


def render_template(name: str, /, **values: Any) -> Markup:
    """Fill in a template."""
    return Markup(ENVIRONMENT.get_template(name).render(**values))  # noqa: S704 # what enters has been escaped


def render_page(
    title: str, body: str, note: str = "", index: str | None = None, local_pictures: bool = False
) -> str:
    """Page around a body: a note, table of contents, link to the index, style, and the scripts that the body needs."""
    contents, numbers = HEADING.findall(body), count(1)
    body = HEADING.sub(lambda heading: f'<h{heading[1]} id="section-{next(numbers)}"', body)
    sources = [("ankleloop.pages", "scripts/tables.js")]
    if 'class="interactive"' in body:  # without Bokeh's widgets and tables
        sources += [
            ("bokeh", "server/static/js/bokeh.min.js"),
            ("ankleloop.pages", "scripts/figures.js"),
        ]
    scripts = [
        files(package).joinpath(path).read_text(encoding="utf-8") for package, path in sources
    ]
    return render_template(
        "base.html.j2",
        title=title,
        note=note,
        body=body,
        contents=contents,
        index=index,
        local_pictures=local_pictures,
        scripts=scripts,
        digests=[
            base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
            for script in scripts
        ],
    )


def find_captions(notebook: Mapping[str, Any]) -> dict[bytes, str]:
    """Captions of the pictures that a notebook shows: their alternative texts."""
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", ())]
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    texts = [picture["metadata"].get("image/png", {}).get("alt", "") for picture in pictures]
    return {
        base64.b64decode(picture["data"]["image/png"]): text
        for picture, text in zip(pictures, texts, strict=True)
    }


def render_table(
    table: pd.DataFrame,
    links: Sequence[str] = (),
    *,
    colours: Mapping[str, str] | None = None,
    name: str = "",
) -> Markup:
    """Table as HTML with a link for each row; columns with one value are said below it.

    Cells with a colour have it as background. A long table with a name has a field that filters its rows.
    """
    cells = table.map(str).replace(SHORT_NAMES, regex=True)
    repeated = [
        column for column in cells.columns[1:] if len(cells) > 2 and cells[column].nunique() == 1
    ]
    constant = {column: cells.pop(column).iloc[0] for column in repeated}
    classes = [_class_of(cells[column]) for column in cells]
    return render_template(
        "table.html.j2",
        table=cells,
        name=name,
        classes=classes,
        constant=constant,
        links=links,
        colours=colours or {},
    )


def _class_of(column: pd.Series) -> str:
    texts = column[~column.isin(["", "–"])].astype(str)
    if len(texts) and texts.str.fullmatch(NUMBER).all():
        return "number"
    return "text" if texts.str.len().max() > TEXT else ""


ENVIRONMENT.globals["render_table"] = render_table
