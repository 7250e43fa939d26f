"""Headings have anchors of their own, and the contents lead to them."""

import re

from ankleloop_lab.pages.page import render_page


def test_headings_of_one_text_have_different_anchors():
    page = render_page("Results", "<h2>Trials</h2>" * 3 + "<h3>A &amp; <i>B</i></h3>")
    anchors = re.findall(r'<h[23] id="([^"]*)">', page)
    links = dict(re.findall(r'<a href="#([^"]*)">(.*?)</a>', page))
    assert list(links) == anchors
    assert list(links.values()) == ["Trials", "Trials", "Trials", "A &amp; B"]


def test_contents_are_escaped_and_a_page_without_headings_has_none():
    page = render_page("Results", "<h2>&lt;script&gt;</h2><h2>Other</h2>")
    assert '">&lt;script&gt;</a>' in page
    assert "<nav>" not in render_page("Results", "<h1>Only</h1>")
