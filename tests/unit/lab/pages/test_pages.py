"""Pages hold all results of a recording, need no other files, and escape every text."""

import base64
import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import bokeh
import pytest

import ankleloop
from ankleloop import DataError
from ankleloop.plotting.style import DataFigure
from ankleloop.quantities import QUANTITIES
from ankleloop_lab.pages import rendering
from ankleloop_lab.pages.recordings import draw_figures, render_recording_page
from ankleloop_lab.recordings.analysis import analyse
from ankleloop_lab.recordings.files import refuse_recording
from ankleloop_lab.recordings.recommendation import recommend

SCRIPTS = [
    *(Path(rendering.__file__).parent / "scripts").glob("*.js"),
    Path(bokeh.__file__).parent / "server" / "static" / "js" / "bokeh.min.js",
]
HOSTILE = "<script>alert('x')</script> & \"co\""
VOID = {"meta", "img", "br", "input"}
WINDOW = {"start": 3.0, "length": 4.0}
POLICY = re.compile(r"script-src ([^;]*);")


class Reader(HTMLParser):
    """Elements and texts of a page; refuses elements that are not closed."""

    def __init__(self, html):
        super().__init__()
        self.elements, self.attributes, self.texts, self.open, self.scripts = [], [], [], [], []
        self.feed(html)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.elements.append(tag)
        self.attributes += [(tag, *attribute) for attribute in attributes]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if (
            self.open
            and self.open[-1] == "script"
            and ("script", "type", "application/json") not in self.attributes[-1:]
        ):
            self.scripts.append(data)
        elif self.open and self.open[-1] not in ("style", "title", "script") and data.strip():
            self.texts.append(" ".join(data.split()))


def hash_script(text):
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def check_page(html):
    """A page that is whole, fetches nothing, and runs no script but those of the library, which its policy allows."""
    page = Reader(html)
    assert html.startswith("<!DOCTYPE html>")
    allowed = POLICY.search(html)[1].split()
    assert allowed == ([hash_script(script) for script in page.scripts] or ["'none'"])
    assert set(page.scripts) <= {path.read_text(encoding="utf-8") for path in SCRIPTS}
    assert not [name for _, name, _ in page.attributes if name.startswith("on")]
    links = [str(value) for _, name, value in page.attributes if name in ("src", "href")]
    assert not [link for link in links if re.match(r"(https?:)?//", link)]
    return page


def mapping(**values):
    groups = {
        "subject": "S1",
        "condition": "rest",
        "trial": 1,
        "session": "",
        "parts": [{"file": "first.csv"}],
    }
    return {**groups, **values}


@pytest.fixture(scope="module")
def recording():
    """A trial and its analysis: one method that is valid, one that is not."""
    trial = ankleloop.simulate(seed=1, duration=20.0)
    methods = {f"riv {HOSTILE}": {"method": "riv"}, f"PI-MOESP {HOSTILE}": {"method": "pi-moesp"}}
    return trial, analyse(trial, methods)


def placeholder_figures():
    return dict.fromkeys(("spectra", "torques", "models", "residuals"), DataFigure())


def test_recording_page_has_checks_methods_figures_and_tests(recording):
    trial, analysis = recording
    figures = draw_figures([trial], analysis, WINDOW)
    assert list(figures) == ["spectra", "torques", "models", "residuals"]
    recommendation = recommend(analysis)
    html = render_recording_page("A1", mapping(), analysis, figures)
    page = check_page(html)
    assert "subject S1, condition rest, trial 1, file first.csv" in page.texts
    assert recommendation.text in page.texts
    for finding in analysis.check.findings:
        assert {finding.name, finding.verdict, finding.text} <= set(page.texts)
    row = page.texts[page.texts.index(QUANTITIES["K"].label) + 1]
    low, high = analysis.table.loc[0, ["K_low", "K_high"]]
    assert row == f"{analysis.table.loc[0, 'K']:.4g} ({low:.4g} … {high:.4g})"
    assert QUANTITIES["threshold"].label not in page.texts  # that no method here has
    assert [name for _, name, _ in page.attributes].count("src") == 4
    assert any("white in the pass band" in text for text in page.texts)


def test_recording_page_has_the_reason_why_a_method_is_not_valid(recording):
    _, analysis = recording
    page = check_page(render_recording_page("A1", mapping(), analysis, placeholder_figures()))
    reason = page.texts[page.texts.index(f"PI-MOESP {HOSTILE}:") + 1]
    assert reason.startswith("not fitted: least squares for B and D is biased in closed loop")


def test_recording_page_marks_what_is_not_to_be_trusted(recording):
    """A method with a warning is marked in every place, has no intervals, and is not recommended."""
    trial, analysis = recording
    table = analysis.table.drop(
        columns=[name for name in analysis.table if name.endswith(("_low", "_high"))]
    )
    table.loc[0, ["trusted", "warnings", "caution"]] = [
        False,
        "not converged.",
        "its poles are biased.",
    ]
    suspect = replace(analysis, table=table)
    figures = draw_figures([trial], suspect, WINDOW)
    page = check_page(render_recording_page("A1", mapping(), suspect, figures))
    label = f"riv {HOSTILE}"
    assert f"{label} (warning)" in page.texts
    assert f"{label} (warning):" in page.texts  # of its residual
    remarks = [page.texts[k + 1] for k, text in enumerate(page.texts) if text == f"{label}:"]
    assert remarks == ["warning: not converged.", "caution: its poles are biased."]
    assert page.texts[page.texts.index(QUANTITIES["K"].label) + 1] == f"{table.loc[0, 'K']:.4g}"
    assert any("every method that was fitted has a warning" in text for text in page.texts)
    assert set(figures["models"].data["series"]) == {f"{label} (warning)"}


def test_recording_page_escapes_every_text(recording):
    _, analysis = recording
    hostile = mapping(subject=HOSTILE, condition=HOSTILE, trial=HOSTILE, parts=[{"file": HOSTILE}])
    for result in (analysis, refuse_recording(DataError(HOSTILE))):
        html = render_recording_page(HOSTILE, hostile, result, placeholder_figures())
        page = check_page(html)
        assert (
            f"subject {HOSTILE}, condition {HOSTILE}, trial {HOSTILE}, file {HOSTILE}" in page.texts
        )
        assert "script>alert" not in html.replace("&lt;script&gt;", "")


def test_page_of_a_refused_recording_has_its_reason_and_no_figures():
    analysis = refuse_recording(DataError("bad.csv: torque is not finite"))
    figures = draw_figures([], analysis, WINDOW)
    page = check_page(render_recording_page("A3", mapping(subject=""), analysis, figures))
    heading = page.texts.index("A3", page.texts.index("Contents"))
    description = [
        "condition rest, trial 1, file first.csv",
        recommend(analysis).text,
        "Check: refused",
    ]
    assert page.texts[heading + 1 : heading + 4] == description
    assert "bad.csv: torque is not finite" in page.texts
    assert "img" not in page.elements
    assert "Methods" not in page.texts
