"""The figure of torques holds every sample, or the peaks of a long record, and no text of it is taken for HTML."""

import html
import re

import pytest

import ankleloop
from ankleloop.pages.interactive import render_interactive_torques

HOSTILE = '</script><b>riv & "co"'
WINDOW = {"start": 10.0, "length": 5.0}


@pytest.fixture(scope="module")
def trial():
    return ankleloop.simulate(seed=1, duration=20.0)


@pytest.fixture(scope="module")
def estimates(trial):
    return {HOSTILE: ankleloop.identify(trial, "riv"), "cascade": ankleloop.identify(trial, "parallel-cascade")}


def test_no_text_of_a_label_is_html(trial, estimates):
    page = render_interactive_torques(trial, estimates, window=WINDOW)
    assert page.count("</script>") == 1
    assert "<b>riv" not in page
    assert f"residual of {html.escape(HOSTILE, quote=False)}" in page.replace("&#34;", '"')


@pytest.mark.parametrize(
    ("window", "expected"),
    [({"start": 3.0, "length": 5.0}, (3.0, 8.0)), ({"start": 90.0, "length": 5.0}, None)],
)
def test_the_window_lies_within_the_record(trial, estimates, window, expected):
    page = render_interactive_torques(trial, estimates, window=window)
    whole, first = (tuple(map(float, text.split())) for text in re.findall(r'data-window="(.*?)"', page))
    assert 0.0 <= whole[0] < whole[1] <= 20.0
    assert first == (expected or (pytest.approx(whole[1] - 5.0), whole[1]))


def test_a_recording_says_that_its_parts_are_not_known(trial, estimates):
    recording = trial.drop_vars([name for name in trial.data_vars if str(name).startswith("torque_")])
    page = render_interactive_torques(recording, estimates, window=WINDOW)
    assert "true (simulated)" not in page
    assert "are not known" in page
