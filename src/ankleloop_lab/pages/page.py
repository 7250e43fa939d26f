"""Pages that need no other files, on which no script runs but those of the library."""

from __future__ import annotations

import base64
import hashlib
import re
from importlib.resources import files
from itertools import count

from ankleloop_lab.pages.rendering import render_template

HEADING = re.compile(r"<h([23])(?=>(.*?)</h\1>)", re.DOTALL)  # level and content


def render_page(
    title: str, body: str, note: str = "", index: str | None = None, local_pictures: bool = False
) -> str:
    """Page around a body: a note, table of contents, link to the index, style, and the scripts that the body needs."""
    numbers = count(1)
    anchored = HEADING.sub(lambda heading: f'<h{heading[1]} id="section-{next(numbers)}"', body)
    sources = [(__package__, "scripts/tables.js")]
    if 'class="interactive"' in body:  # without Bokeh's widgets and tables
        sources.append(("bokeh", "server/static/js/bokeh.min.js"))
        sources.append((__package__, "scripts/figures.js"))
    scripts = [
        files(package).joinpath(path).read_text(encoding="utf-8") for package, path in sources
    ]
    hashes = [hashlib.sha256(script.encode()).digest() for script in scripts]
    return render_template(
        "base.html.j2",
        title=title,
        note=note,
        body=anchored,
        contents=HEADING.findall(body),
        index=index,
        local_pictures=local_pictures,
        scripts=scripts,
        digests=[base64.b64encode(digest).decode() for digest in hashes],
    )
