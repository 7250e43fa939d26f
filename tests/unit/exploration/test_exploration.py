import numpy as np
import pytest

import ankleloop
from ankleloop.exploration.controls import (
    SIMULATION_CONTROLS,
    default_values,
)
from ankleloop.exploration.experiment import Experiment, pole_frequency
from ankleloop.exploration.picture import Picture
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.simulation.settings import SimulationSettings

COMPLIANT = {"load_stiffness": 10.0, "load_viscosity": 0.1, "load_inertia": 0.01, "reflex_gain": 40.0}


@pytest.fixture(scope="module")
def experiment():
    return Experiment(seed=1)


@pytest.fixture
def picture():
    return Picture()


def run(experiment, options=None, methods=None, **settings):
    values, entries = default_values()
    for entry, name in zip(entries, methods or (entry["method"] for entry in entries), strict=True):
        entry["method"] = name
        entry["options"] |= options or {}
    return experiment.run(values | settings, entries)


@pytest.mark.parametrize("control", SIMULATION_CONTROLS, ids=lambda control: control.name)
def test_both_ends_of_every_range_are_settings(control):
    for value in control.choices or (control.low, control.high) * (control.low is not None):
        assert getattr(SimulationSettings(**{control.name: value}), control.name) == value
    limits = SimulationSettings.limits(control.name)
    if control.low is not None:
        assert limits["ge" if "ge" in limits else "gt"] <= control.low < control.default < control.high <= limits["le"]


def test_the_picture_shows_what_the_library_computes(experiment, picture):
    result = run(experiment, reflex_gain=8.0)
    picture.update(result)
    trial = ankleloop.simulate(seed=1, duration=20.0, reflex_gain=8.0)
    estimate = ankleloop.identify(trial, "riv", delay=0.04)
    riv = result.fits[1]
    assert riv.estimate.stiffness == estimate.stiffness
    assert riv.estimate.intervals == estimate.intervals
    scores = ankleloop.evaluate(trial, estimate).set_index(["torque", "against"])["vaf"]
    assert riv.vaf["reflex"] == scores["reflex", "true"]
    shown = picture._methods[1]._symbols[0].get_xdata()
    truth = {"K": 150.0, "B": 0.8, "I": 0.015, "G": 8.0}
    values = {**estimate.stiffness, **estimate.reflex}
    np.testing.assert_allclose(shown, [100 * values[name] / truth[name] for name in truth])
    low, high = estimate.intervals["K"]
    np.testing.assert_allclose(picture._methods[1]._intervals[0].get_xdata(), [low / 1.5, high / 1.5])
    np.testing.assert_allclose(picture._methods[1]._poles.get_xdata(), np.linalg.eigvals(estimate.matrices.A).real)


def test_intervals_of_a_method_that_gives_none_are_those_of_the_bootstrap(experiment, picture):
    settings, methods = default_values()
    assert experiment.run(settings, methods).fits[0].intervals == {}
    result = experiment.run(settings, methods, bootstrap=True)
    pr_moesp, riv = result.fits
    assert riv.intervals == riv.estimate.intervals
    trial = ankleloop.simulate(seed=1, duration=20.0)
    expected = ankleloop.block_bootstrap(trial, "pr-moesp", repetitions=40, block=1.5, **methods[0]["options"])
    assert pr_moesp.intervals == expected.intervals()
    picture.update(result)
    low, high = pr_moesp.intervals["K"]
    np.testing.assert_allclose(picture._methods[0]._intervals[0].get_xdata(), [low / 1.5, high / 1.5])


def test_true_poles_are_those_of_the_reflex(experiment):
    result = run(experiment)
    expected = np.exp(-40.0 / 100.0)  # ωn = 40 rad/s, ζ = 1, at 100 Hz
    np.testing.assert_allclose(result.poles, expected, atol=1e-6)
    for dynamics in (ReflexDynamics(50.0, 0.3), ReflexDynamics(20.0, 0.9)):
        frequency, damping = pole_frequency(np.linalg.eigvals(dynamics.matrices(200.0)[0]), 200.0)
        np.testing.assert_allclose(2 * np.pi * frequency, dynamics.omega_n)
        np.testing.assert_allclose(damping, dynamics.zeta)


def test_an_unstable_loop_is_a_sentence_in_the_picture(experiment, picture):
    picture.update(run(experiment))
    before = picture.png()
    picture.update(run(experiment, **COMPLIANT))
    assert picture.message.startswith("the closed loop is unstable")
    assert picture.png() != before
    assert all(
        line.get_xdata().size == 0 if hasattr(line.get_xdata(), "size") else not line.get_xdata()
        for line in picture._targets.values()
    )
    picture.update(run(experiment))
    assert picture.message == ""
    assert picture.png() == before  # nothing is left behind


def test_a_joint_without_a_reflex_has_no_reflex_vaf(experiment, picture):
    result = run(experiment, reflex_gain=0.0)
    assert all(np.isnan(fit.vaf["reflex"]) for fit in result.fits)
    picture.update(result)
    assert picture._methods[0]._values.get_text().endswith(", – %")
    assert picture.png()


def test_what_a_method_refuses_is_a_sentence_below_the_picture(experiment, picture):
    result = run(experiment, options={"order": 4})
    assert [fit.estimate is None for fit in result.fits] == [False, True]  # riv has two or three poles
    picture.update(result)
    assert picture.remarks[1].startswith("riv: method 'riv': order must be one of 2 or 3")
    assert picture.png()
    assert not picture.message


def test_a_trial_is_simulated_again_only_when_its_settings_change(experiment, monkeypatch):
    run(experiment, voluntary=0.3)
    calls = []
    monkeypatch.setattr("ankleloop.exploration.experiment.simulate", lambda **settings: calls.append(settings))
    first = run(experiment, voluntary=0.3, methods=("eiv-moesp", "riv"))
    assert not calls
    assert first.fits[0].method == "eiv-moesp"
