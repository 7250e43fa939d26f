"""Tables and paragraphs inside pages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ankleloop.pages.rendering import render_template

if TYPE_CHECKING:
    import pandas as pd

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


def describe_table(
    table: pd.DataFrame,
    links: Sequence[str] = (),
    *,
    colours: Mapping[str, str] | None = None,
    identifier: str = "",
) -> dict[str, Any]:
    """A table for the template `table.html.j2`, with a link for each row; columns with one value are said below it."""
    columns = [(str(name), [_shorten(str(cell)) for cell in column]) for name, column in table.items()]
    constant = [(name, cells[0]) for name, cells in columns[1:] if len(cells) > 2 and len(set(cells)) == 1]
    names = {name for name, _ in constant}
    columns = [(name, cells) for name, cells in columns if name not in names]
    return {
        "identifier": identifier,
        "filtered": len(table) >= FILTERED_ROWS,
        "names": [name for name, _ in columns],
        "classes": [_class_of(cells) for _, cells in columns],
        "rows": list(zip(*(cells for _, cells in columns), strict=True)),
        "constant": [f"{name} {text}" for name, text in constant if text not in ("", "–")],
        "links": links or [""] * len(table),
        "colours": colours or {},
    }


def _shorten(text: str) -> str:
    """A name of a method in short."""
    name = next((name for name in SHORT_NAMES if name in text), "")
    return text.replace(name, SHORT_NAMES[name]) if name and len(text) <= NAME else text


def _class_of(column: Sequence[str]) -> str:
    texts = [text.replace(",", "") for text in column if text not in ("", "–")]
    if texts and all(_is_number(text) for text in texts):
        return "number"
    return "text" if max(map(len, texts), default=0) > TEXT else ""


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def render_table(table: pd.DataFrame, links: Sequence[str] = (), *, colours: Mapping[str, str] | None = None) -> str:
    """Table as HTML; cells with a colour have it as background."""
    return render_template("table.html.j2", table=describe_table(table, links, colours=colours))


def render_paragraphs(items: Iterable[tuple[str, str]]) -> str:
    """Paragraphs as HTML, each with a term in bold in front."""
    return render_template("paragraphs.html.j2", items=items)
