"""What an estimate says of itself: parameters, what is missing, what is assumed; and which method is the default."""

import numpy as np
import pytest

from ankleloop import DataError, identify, simulate
from ankleloop.quantities import QUANTITIES


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=1, duration=20.0)


@pytest.fixture(scope="module")
def open_trial():
    """The movement of an open loop hardly separates a polynomial of the velocity from the intrinsic torque."""
    return simulate(seed=3, closed_loop=False)


@pytest.mark.parametrize("method", ["pr-moesp", "eiv-moesp", "po-moesp", "pi-moesp", "moesp"])
@pytest.mark.parametrize("settings", [{"closed_loop": False}, {"load": (10.0, 300.0, 1e4)}])
def test_no_reflex_gain_without_a_separation(method, settings):
    """It was -2281 … 11,000 where 13 is true, without a warning."""
    for seed in (3, 4):
        estimate = identify(simulate(seed=seed, **settings), method)
        assert not {"G", "omega_n", "zeta"} & set(estimate.reflex)
        assert "G, ωn and ζ" in estimate.diagnostics["missing"][0]
        assert estimate.diagnostics["missing"][0] in repr(estimate)
        assert 0 <= estimate.diagnostics["separation"]["ramp"] < 1
        assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.15)


def test_where_the_separation_holds_the_gain_is_given(trial, open_trial):
    for method, options in [("pr-moesp", {}), ("pr-moesp", {"basis": "rectifier"}), ("parallel-cascade", {})]:
        estimate = identify(trial, method, **options)
        assert {"G", "omega_n", "zeta"} <= set(estimate.reflex)
        assert estimate.diagnostics["separation"]["ramp"] > 0.95
    assert identify(open_trial, "pr-moesp", basis="rectifier").reflex["G"] == pytest.approx(13.0, rel=0.15)


def test_parameters_that_no_joint_has_are_warnings(trial):
    """Of every method and parameter, unless the interval reaches what a joint can have."""
    turned = trial.assign(torque=-trial["torque"])
    warnings = " ".join(identify(turned, "parallel-cascade").diagnostics["warnings"])
    assert "K = " in warnings
    assert "G = " in warnings
    assert "no joint has" in warnings
    assert all(low < high for low, high in (quantity.plausible for quantity in QUANTITIES.values()))


def test_the_default_is_the_method_that_feedback_does_not_bias(trial):
    assert identify(trial) == identify(trial, "riv")
    with pytest.raises(DataError, match=r"no reference.*reference='position'.*parallel-cascade"):
        identify(trial.drop_vars("reference"))
    with pytest.raises(DataError, match=r"name the method for trials that are merged: one of pr-moesp"):
        identify([trial, simulate(seed=2, duration=20.0)])


@pytest.mark.parametrize(
    ("method", "options", "texts"),
    [
        ("riv", {}, []),
        ("riv", {"delay": 0.04}, ["the reflex delay is 40 ms."]),
        ("riv", {"reference": "position"}, ["the loop is open: the position"]),
        ("pr-moesp", {}, ["the reflex is a polynomial", "little torque is fed back", "the reflex delay"]),
        (
            "pr-moesp",
            {"input_matrices": "instruments", "basis": "rectifier", "delay": 0.05},
            ["the reflex delay is 50 ms."],
        ),
        ("parallel-cascade", {}, ["the loop is open: no reference", "the reflex delay"]),
    ],
)
def test_assumptions_are_said_and_are_no_warnings(trial, method, options, texts):
    estimate = identify(trial, method, **options)
    assumptions = estimate.diagnostics["assumptions"]
    assert len(assumptions) == len(texts)
    for assumption, text in zip(assumptions, texts, strict=True):
        assert assumption.startswith(text)
        assert f"assumed: {assumption}" in repr(estimate)
        assert assumption not in estimate.diagnostics["warnings"]


def test_an_estimate_shows_all_of_its_parameters(trial):
    text = repr(identify(trial, "riv"))
    for symbol in ("K = ", "B = ", "I = ", "G = ", "ωn = ", "ζ = ", "delay = 0.04"):
        assert symbol in text


def test_estimates_compare_and_hash(trial):
    first, second = (identify(trial, "pr-moesp") for _ in range(2))
    assert first == second
    assert len({first, second, identify(trial, "riv")}) == 2
    assert first != identify(simulate(seed=2, duration=20.0), "pr-moesp")
    assert first != "an estimate"
    assert np.isfinite(hash(first))
