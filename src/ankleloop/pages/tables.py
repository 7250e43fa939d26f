"""Tables and paragraphs inside pages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ankleloop.pages.rendering import render_template

if TYPE_CHECKING:
    import pandas as pd

SHORT_TEXT = 16  # letters up to which a cell is one line
# Letters of a cell from which its column has a class, which is wider.
LONG_TEXTS = {100: "long", 40: "text", SHORT_TEXT: "words"}
FILTERED_ROWS = 15  # of a table from which it has a field that filters


def describe_table(
    table: pd.DataFrame,
    links: Sequence[str] = (),
    *,
    colours: Mapping[str, str] | None = None,
    identifier: str = "",
    compact: bool = False,
) -> dict[str, Any]:
    """A table for the template `table.html.j2`, with the link of each row; its first cell has it unless it is empty."""
    columns = [[str(cell) for cell in column] for _, column in table.items()]
    return {
        "identifier": identifier,
        "compact": compact,
        "filtered": len(table) >= FILTERED_ROWS,
        "names": list(table.columns),
        "classes": [_class_of(column) for column in columns],
        "rows": list(zip(*columns, strict=True)),
        "links": links or [""] * len(table),
        "colours": colours or {},
        "short": SHORT_TEXT,
    }


def _class_of(column: Iterable[str]) -> str:
    texts = [text for text in column if text not in ("", "–")]
    if texts and all(_is_number(text) for text in texts):
        return "number"
    longest = max(map(len, texts), default=0)
    return next((name for letters, name in LONG_TEXTS.items() if longest > letters), "")


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", ""))
    except ValueError:
        return False
    return True


def render_table(table: pd.DataFrame, links: Sequence[str] = ()) -> str:
    """Table as HTML, with a link for each row."""
    return render_template("table.html.j2", table=describe_table(table, links))


def render_paragraphs(items: Iterable[tuple[str, str]]) -> str:
    """Paragraphs as HTML, each with a term in bold in front."""
    return render_template("paragraphs.html.j2", items=items)
