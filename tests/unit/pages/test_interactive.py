"""The figure of torques holds every sample, or the peaks of a long record, and no text of it is taken for HTML."""

import base64
import html
import json
import re

import numpy as np
import pytest

import ankleloop
from ankleloop.pages import interactive
from ankleloop.pages.interactive import render_interactive_torques
from ankleloop.plotting.torque_series import torque_series

HOSTILE = '</script><b>riv & "co"'
WINDOW = {"start": 10.0, "length": 5.0}


@pytest.fixture(scope="module")
def trial():
    return ankleloop.simulate(seed=1, duration=20.0)


@pytest.fixture(scope="module")
def estimates(trial):
    return {HOSTILE: ankleloop.identify(trial, "riv"), "cascade": ankleloop.identify(trial, "parallel-cascade")}


def read_data(page):
    """Data of the script of a figure."""
    (text,) = re.findall(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)
    return json.loads(text)


def decode(text):
    return np.frombuffer(base64.b64decode(text), dtype="<f4")


def test_every_sample_is_in_the_page(trial, estimates):
    data = read_data(render_interactive_torques(trial, estimates, window=WINDOW))
    series = torque_series(trial, estimates)
    assert len(data["series"]) == len(series) == 6
    for item, described in zip(series, data["series"], strict=True):
        assert [trace["torque"] for trace in described["traces"]] == list(item.traces)
        for trace, expected in zip(described["traces"], item.traces.values(), strict=True):
            assert (trace["start"], trace["step"], trace["high"]) == (expected.start, expected.step, None)
            np.testing.assert_array_equal(decode(trace["low"]), expected.low)


def test_a_long_record_has_the_ends_of_bins(trial, estimates, monkeypatch):
    monkeypatch.setattr(interactive, "MOST_VALUES", 2_000)
    page = render_interactive_torques(trial, estimates, window=WINDOW)
    traces = [trace for item in read_data(page)["series"] for trace in item["traces"]]
    assert sum(decode(trace[end]).size for trace in traces for end in ("low", "high")) <= 2_000
    samples = torque_series(trial, estimates)[0].traces["net"].low
    assert decode(traces[0]["low"]).min() == samples.min()
    assert decode(traces[0]["high"]).max() == samples.max()
    assert f"least and greatest value in every {traces[0]['step']:.3g} s" in page


def test_no_text_of_a_label_is_html(trial, estimates):
    page = render_interactive_torques(trial, estimates, window=WINDOW)
    assert page.count("</script>") == 1
    assert "<b>riv" not in page
    assert f"residual of {html.escape(HOSTILE, quote=False)}" in page.replace("&#34;", '"')


def test_the_same_figure_twice_is_the_same_text(trial, estimates):
    first, second = (render_interactive_torques(trial, estimates, window=WINDOW) for _ in range(2))
    assert first == second


def test_methods_that_are_not_shown_at_first_have_a_switch(trial, estimates):
    page = render_interactive_torques(trial, estimates, window=WINDOW, shown=["cascade"])
    assert re.findall(r'<input type="checkbox" data-series="(\d)"', page) == list("012345")
    assert re.findall(r'<input type="checkbox" data-series="(\d)" checked', page) == ["0", "1", "3"]


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
