"""The figure of torques holds every sample, fewer of a long record, and no text of it is taken for HTML."""

import re

import pytest

import ankleloop
from ankleloop.pages.interactive import render_interactive_torques
from ankleloop.plotting.style import METHOD_STYLES

HOSTILE = '</script><b>riv & "co"'
STYLES = dict.fromkeys([HOSTILE, "cascade"], METHOD_STYLES["riv"])
WINDOW = {"start": 10.0, "length": 5.0}


@pytest.fixture(scope="module")
def trial():
    return ankleloop.simulate(seed=1, duration=20.0)


@pytest.fixture(scope="module")
def estimates(trial):
    return {
        HOSTILE: ankleloop.identify(trial, "riv"),
        "cascade": ankleloop.identify(trial, "parallel-cascade"),
    }


def test_no_text_of_a_label_is_html(trial, estimates):
    page = render_interactive_torques(trial, estimates, STYLES, WINDOW)
    assert page.count("</script>") == 1
    assert "<b>riv" not in page
    assert "\\u003c/script\\u003e\\u003cb\\u003eriv" in page


@pytest.mark.parametrize(
    ("window", "expected"),
    [({"start": 3.0, "length": 5.0}, (3.0, 8.0)), ({"start": 90.0, "length": 5.0}, None)],
)
def test_the_window_lies_within_the_record(trial, estimates, window, expected):
    page = render_interactive_torques(trial, estimates, STYLES, window)
    text = page[page.index('"bounds"') - 200 :][:500]
    first = [float(re.search(rf'"{name}": ([\d.]+)', text)[1]) for name in ("start", "end")]
    begin, end = map(float, re.search(r'"bounds": .*?\[([\d.]+), ([\d.]+)\]', text).groups())
    assert 0.0 <= begin < end <= 20.0
    assert tuple(first) == (expected or (pytest.approx(end - 5.0), end))


def test_a_long_record_says_what_is_drawn_and_stays_small(trial, estimates, monkeypatch):
    whole = render_interactive_torques(trial, estimates, STYLES, WINDOW)
    monkeypatch.setattr("ankleloop.pages.interactive.MOST_SAMPLES", 1_000)
    page = render_interactive_torques(trial, estimates, STYLES, WINDOW)
    assert "of every 2 samples one is drawn" in page
    assert len(page) < len(whole)
