"""Pages of executed notebooks."""

from __future__ import annotations

import html

from ankleloop.pages.rendering import render_page

__all__ = ["render_notebook_page"]


def render_notebook_page(title: str, body_html: str, note: str = "", *, index: str | None = None) -> str:
    """Page of an executed notebook.

    Parameters
    ----------
    title : str
        Title of the page; it is escaped.
    body_html : str
        Cells as HTML, from an exporter that has escaped them.
    note : str
        Text above the cells; it is escaped.
    index : str, optional
        Path of the page that lists all results, relative to this one.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> page = render_notebook_page("B & I", "<h1>Results</h1>")
    >>> "<title>B &amp; I · ankleloop</title>" in page, "<h1>Results</h1>" in page
    (True, True)
    """
    notice = f"<p><strong>{html.escape(note)}</strong></p>\n" if note else ""
    return render_page(title, notice + body_html, index=index)
