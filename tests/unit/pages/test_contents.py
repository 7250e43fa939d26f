"""Headings have anchors of their own, and the contents lead to them."""

import re

from ankleloop.pages.rendering import find_headings, render_page


def test_headings_of_one_text_have_different_anchors():
    body, headings = find_headings("<h2>Trials</h2>" * 3 + "<h3>A &amp; <i>B</i></h3>")
    assert headings == [("2", "Trials")] * 3 + [("3", "A & B")]
    assert re.findall(r'<h(.) id="([^"]*)">', body) == [("2", f"section-{n}") for n in (1, 2, 3)] + [("3", "section-4")]


def test_contents_are_escaped_and_a_page_without_headings_has_none():
    page = render_page("Results", "<h2>&lt;script&gt;</h2><h2>Other</h2>")
    assert '">&lt;script&gt;</a>' in page
    assert "<nav>" not in render_page("Results", "<h1>Only</h1>")
