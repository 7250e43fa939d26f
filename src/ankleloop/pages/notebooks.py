"""Pages of executed notebooks, and the captions of their figures."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from ankleloop.pages.rendering import render_page


def render_notebook_page(title: str, body_html: str, note: str = "", *, index: str | None = None) -> str:
    """Page of an executed notebook."""
    notice = f"<p><strong>{html.escape(note)}</strong></p>\n" if note else ""
    return render_page(title, notice + body_html, index=index)


def find_captions(notebook: Mapping[str, Any]) -> dict[bytes, str]:
    r"""Captions of the pictures that a notebook shows: the text that follows each of them in its cell."""
    captions = {}
    for cell in notebook["cells"]:
        outputs = cell.get("outputs", [])
        for output, following in pairwise(outputs):
            picture, text = output.get("data", {}).get("image/png"), following.get("data", {}).get("text/markdown")
            if picture and text:
                caption = " ".join(text.replace("**", "").split())
                captions[base64.b64decode(picture)] = caption
                output["metadata"].setdefault("image/png", {})["alt"] = caption
    return captions
