"""What an estimate says of itself: parameters, what is missing, what is assumed; and which method is the default."""

from dataclasses import replace

import pytest

from ankleloop import METHODS, DataError, identify, simulate
from ankleloop.methods.description import SOURCES


@pytest.mark.parametrize("method", ["pr-moesp", "eiv-moesp", "po-moesp", "pi-moesp", "moesp"])
@pytest.mark.parametrize("settings", [{"closed_loop": False}, {"load": (10.0, 300.0, 1e4)}])
def test_no_reflex_gain_without_a_separation(method, settings):
    """In open loop a polynomial is hardly told from the intrinsic torque: G was -2281 … 11,000 where 13 is true."""
    estimate = identify(simulate(seed=3, **settings), method)
    assert not {"G", "omega_n", "zeta"} & set(estimate.reflex)
    assert "G, ωn and ζ" in estimate.diagnostics["missing"][0]
    assert estimate.diagnostics["missing"][0] in repr(estimate)
    assert 0 <= estimate.diagnostics["separation"]["ramp"] < 1
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.15)


def test_the_default_is_the_method_that_feedback_does_not_bias(noisy):
    assert identify(noisy) == identify(noisy, "riv")
    with pytest.raises(DataError, match=r"no reference.*reference='position'.*parallel-cascade"):
        identify(noisy.drop_vars("reference"))
    other = simulate(seed=2, duration=20.0)
    assert identify([noisy, other]) == identify([noisy, other], "riv")
    with pytest.raises(DataError, match=r"no reference"):
        identify([noisy, other.drop_vars("reference")])


def test_an_estimate_shows_all_of_its_parameters_and_compares(noisy):
    estimate, other = identify(noisy, "riv"), identify(noisy, "pr-moesp")
    rows = [line.split() for line in repr(estimate).splitlines()[2:9]]
    assert [row[0] for row in rows] == ["K", "B", "I", "G", "ωn", "ζ", "delay"]
    assert all(len(row) == 5 for row in rows)
    assert other == identify(noisy, "pr-moesp") != estimate


@pytest.mark.parametrize(
    ("method", "options", "texts"),
    [
        ("riv", {"delay": 0.04}, ["the reflex delay is 40 ms."]),
        ("riv", {"reference": "position"}, ["the loop is open: the position"]),
        (
            "pr-moesp",
            {},
            ["the reflex is a polynomial", "little torque is fed back", "the reflex delay"],
        ),
        ("parallel-cascade", {}, ["the loop is open: no reference", "the reflex delay"]),
    ],
)
def test_assumptions_are_said_and_are_no_warnings(noisy, method, options, texts):
    estimate = identify(noisy, method, **options)
    assumptions = estimate.diagnostics["assumptions"]
    assert len(assumptions) == len(texts)
    for assumption, text in zip(assumptions, texts, strict=True):
        assert assumption.startswith(text)
        assert assumption not in estimate.diagnostics["warnings"]


def test_every_method_has_its_source():
    for name in METHODS:
        assert name in SOURCES


def test_what_is_said_of_a_method_of_another_package(noisy):
    """It has no source here, and without a reflex torque no delay was assumed."""
    estimate = identify(noisy, "riv")
    intrinsic = estimate.torque.intrinsic
    torque = estimate.torque.assign(reflex=0.0 * intrinsic, net=intrinsic)
    text = replace(estimate, method="stiffness", torque=torque).methods_text()
    assert text.startswith(
        "Intrinsic stiffness was estimated by the method stiffness of another package from one trial"
    )
    assert "delay" not in text
    assert "reflex stiffness were estimated by refined" in estimate.methods_text()
    assert "The reflex delay was " in estimate.methods_text()
