"""Headings of a page, and the links that reach them."""

from __future__ import annotations

import html
import re
from dataclasses import dataclass

HEADING = re.compile(r"<h([23])((?:\s[^>]*)?)>(.*?)</h\1>", re.DOTALL)
LINK = re.compile(r'<a class="anchor-link".*?</a>', re.DOTALL)
ANCHOR = re.compile(r'\bid="([^"]*)"')


@dataclass(frozen=True)
class Heading:
    """A heading of a page."""

    level: int  # 2 or 3
    text: str  # what it says
    anchor: str  # its name for links


def find_headings(body: str) -> tuple[str, list[Heading]]:
    """Headings of the second and third level, each with an anchor of its own."""
    headings: list[Heading] = []

    def add_anchor(match: re.Match[str]) -> str:
        level, attributes, content = match.groups()
        text = " ".join(html.unescape(re.sub("<.*?>", "", LINK.sub("", content))).split())
        anchor = ANCHOR.search(attributes)
        name = html.unescape(anchor[1]) if anchor else re.sub(r"\W+", "-", text).strip("-")
        used, number, stem = {heading.anchor for heading in headings}, 2, name
        while name in used:
            name, number = f"{stem}-{number}", number + 1
        headings.append(Heading(int(level), text, name))
        others = ANCHOR.sub("", attributes).strip()
        return f'<h{level} id="{html.escape(name)}"{" " + others if others else ""}>{content}</h{level}>'

    return HEADING.sub(add_anchor, body), headings
