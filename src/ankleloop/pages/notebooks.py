"""Pages of executed notebooks."""

from __future__ import annotations

from ankleloop.pages.rendering import render_template

__all__ = ["render_notebook_page"]


def render_notebook_page(title: str, body_html: str) -> str:
    """Page of an executed notebook.

    Parameters
    ----------
    title : str
        Title of the page; it is escaped.
    body_html : str
        Cells as HTML, from an exporter that has escaped them.

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
    return render_template("notebook.html.j2", title=title, body=body_html)
