"""Pages of the site whose text stands elsewhere in the project, and links that lead out of docs.

A page of the folder docs that stands in `outside_pages` of conf.py shows a file such as config/README.md. Links of
every page may lead to files of the project: if the file is a page, the link leads to that page, otherwise it is a
download.
"""

import os
import re
from pathlib import Path

FENCE = re.compile(r"(^ *(`{3,}|~{3,}).*?^ *\2`*\s*?$)", re.MULTILINE | re.DOTALL)
# [text](target#place), and a line [name]: target.
LINK = re.compile(r"(\]\(|^\[[^\]\n]+\]: )(?!\w+:|#)([^)\s#]+)(#[^)\s]*)?(?=\)|$)", re.MULTILINE)


def rewrite_links(text, origin, page, docs, pages):
    """The text of a file with its relative links as the page needs them; code stays as it is.

    `origin` is the file that the text is from, `page` the file in `docs` that shows it, and `pages` has the file behind
    each page, by the name of the page.
    """
    shown = {(docs.parent / file).resolve(): docs / f"{name}.md" for name, file in pages.items()}

    def rewrite(match):
        target = (origin.parent / match[2]).resolve()
        target = shown.get(target, target)
        return f"{match[1]}{os.path.relpath(target, page.parent)}{match[3] or ''}"

    parts = FENCE.split(text)  # every third one is code, the one behind it its fence
    return "".join(
        part if k % 3 == 1 else LINK.sub(rewrite, part)
        for k, part in enumerate(parts)
        if k % 3 != 2
    )


def read_page(app, name, source):
    """Replace the text of a page by that of the file which it shows, and rewrite its links."""
    docs, pages = Path(app.srcdir), app.config.outside_pages
    page = Path(app.env.doc2path(name))
    if page.suffix != ".md":
        return
    origin = page
    if name in pages:
        origin = docs.parent / pages[name]
        app.env.note_dependency(str(origin), docname=name)
        source[0] = origin.read_text(encoding="utf-8")
    source[0] = rewrite_links(source[0], origin, page, docs, pages)


def setup(app):
    """Register the extension with Sphinx."""
    app.add_config_value("outside_pages", {}, "env", [dict])
    app.connect("source-read", read_page)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
