"""Tables and paragraphs inside pages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from ankleloop.pages.rendering import render_template

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["render_paragraphs", "render_table"]


def render_table(table: pd.DataFrame, links: Mapping[str, str] | None = None) -> str:
    """Table as HTML.

    Parameters
    ----------
    table : pandas.DataFrame
        The table; its cells are text, its index is left out.
    links : dict of str to str, optional
        Links of cells in the first column by their text: paths relative to the page.

    Returns
    -------
    str
        HTML; all texts are escaped.

    Examples
    --------
    >>> import pandas as pd
    >>> html = render_table(pd.DataFrame({"recording": ["A1"], "loop": ["<none>"]}), {"A1": "pages/A1.html"})
    >>> '<a href="pages/A1.html">A1</a>' in html, "&lt;none&gt;" in html
    (True, True)
    """
    rows = table.itertuples(index=False, name=None)
    return render_template("table.html.j2", names=list(table.columns), rows=rows, links=links or {})


def render_paragraphs(items: Iterable[tuple[str, str]]) -> str:
    """Paragraphs as HTML, each with a term in bold in front.

    Parameters
    ----------
    items : iterable of (str, str)
        Terms and texts.

    Returns
    -------
    str
        HTML; all texts are escaped.

    Examples
    --------
    >>> print(render_paragraphs([("A1 & A2", "without a reference")]))
    <p><b>A1 &amp; A2:</b> without a reference</p>
    <BLANKLINE>
    """
    return render_template("paragraphs.html.j2", items=items)
