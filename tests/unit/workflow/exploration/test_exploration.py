"""The explorer shows what the library computes; its widgets are moved by code."""

import json
from pathlib import Path

import pytest

pytest.importorskip("ipywidgets", reason="ipywidgets is not installed: the explorer has sliders")

import ankleloop
from ankleloop_workflow.exploration import explorer

NOTEBOOK = Path(__file__).parents[4] / "notebooks" / "explore.ipynb"
VALUES = {
    "load_stiffness": 10.0,
    "load_viscosity": 0.1,
    "load_inertia": 0.01,
    "reflex_gain": 40.0,
}  # unstable


@pytest.fixture
def controls():
    return explorer.make_controls()


@pytest.fixture
def show(controls, monkeypatch, capsys):
    """Show the experiment of all widgets: the figure or None, the table or None, and the printed text."""

    def run(**changes):
        for name, value in changes.items():
            controls[name.replace("__", " ")].value = value
        shown = []
        monkeypatch.setattr(explorer, "display", shown.append)
        explorer.show_experiment(**{name: widget.value for name, widget in controls.items()})
        return [None, None, *shown][-2:], capsys.readouterr().out

    return run


def test_it_shows_what_the_library_computes(show):
    (figure, table), text = show(reflex_gain=8.0, B__delay=0.041)
    trial = ankleloop.simulate(seed=1, duration=20.0, reflex_gain=8.0)
    estimate = ankleloop.identify(trial, "riv", delay=0.041)
    low, high = estimate.intervals["K"]
    assert (
        table.loc["K [N·m/rad]", "B: riv"]
        == f"{estimate.stiffness['K']:.3g} ({low:.3g} … {high:.3g})"
    )
    assert list(table["true"]) == ["150", "0.8", "0.015", "8", "40", "1", "0.04"]
    scores = ankleloop.evaluate(trial, estimate).set_index(["torque", "against"])["vaf"]
    titles = [axis.get_title() for axis in figure.axes]
    assert f"reflex: VAF {scores['reflex', 'true']:.1f} % (true)" in titles
    assert all(f"B: riv: {warning}" in text for warning in estimate.diagnostics["warnings"])


def test_what_cannot_be_simulated_or_identified_is_a_sentence(show):
    shown, text = show(A__order=4, B__order=4)  # riv has two or three poles
    assert "B: riv: method 'riv': order must be one of 2 or 3" in text
    assert list(shown[1].columns) == ["true", "A: pr-moesp"]
    shown, text = show(**VALUES)
    assert shown == [None, None]
    assert text.startswith("the closed loop is unstable")
    shown, _ = show(load_stiffness=250.0, load_viscosity=7.1, load_inertia=1.1, reflex_gain=0.0)
    assert shown[0] is not None  # a joint without a reflex


def test_a_change_of_a_slider_of_the_notebook_is_shown(controls, monkeypatch):
    changes = []
    monkeypatch.setattr(explorer, "make_controls", lambda: controls)
    monkeypatch.setattr(explorer, "show_experiment", lambda **values: changes.append(values))
    for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), {})
    controls["reflex_gain"].value = 20.0
    controls["A basis"].value = "rectifier"
    assert [(values["reflex_gain"], values["A basis"]) for values in changes] == [
        (13.0, None),
        (20.0, None),
        (20.0, "rectifier"),
    ]
