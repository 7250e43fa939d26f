"""The figure of torques holds every sample, fewer of a long record, and no text of it is taken for HTML."""

import pytest

import ankleloop
from ankleloop.plotting.style import METHOD_STYLES
from ankleloop_lab.pages.interactive import render_interactive_torques

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


def test_a_long_record_says_what_is_drawn_and_stays_small(trial, estimates, monkeypatch):
    whole = render_interactive_torques(trial, estimates, STYLES, WINDOW)
    monkeypatch.setattr("ankleloop_lab.pages.interactive.MOST_SAMPLES", 1_000)
    page = render_interactive_torques(trial, estimates, STYLES, WINDOW)
    assert "of every 2 samples one is drawn" in page
    assert len(page) < len(whole)
