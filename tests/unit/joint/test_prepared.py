"""A prepared trial: methods and scores share its values, and give exactly the results that they give alone."""

import numpy as np
import pytest

from ankleloop import METHODS, evaluate, identify, simulate
from ankleloop.joint import prepared as module
from ankleloop.joint.prepared import PreparedTrial, prepare

OPTIONS = {"delay": 0.04, "basis": "rectifier", "identification_rate": 100.0}
SHORT = {"real-time": {"memory": 2.0}}  # options that a short trial needs
SIGNALS = ("position", "torque", "reference", "torque_intrinsic", "torque_reflex")


@pytest.fixture(scope="module")
def trials():
    return [simulate(seed=seed, duration=12.0) for seed in (1, 2)]


def identify_by(trial, name):
    return identify(trial, name, delay=0.04, **SHORT.get(name, {}))


@pytest.fixture
def calls(monkeypatch):
    """Arguments of every derivative and decimation, arrays by their content."""
    records = []

    def count(name):
        function = getattr(module, name)

        def counted(x, *args, **options):
            records.append((name, np.asarray(x).tobytes(), args, tuple(options.items())))
            return function(x, *args, **options)

        monkeypatch.setattr(module, name, counted)

    count("decimate")
    count("differentiate")
    return records


# --- sharing


def test_options_do_not_mix(trials):
    """Values of one delay, rate, basis or reference do not serve another."""
    shared = prepare(trials[0])
    for options in (
        {},
        {"delay": 0.05},
        {"identification_rate": 50.0},
        {"basis": "rectifier"},
        {"basis": "chebyshev", "degree": 3},
        {"basis": "spline"},
        {"input_matrices": "instruments"},
        {"input_matrices": "instruments", "basis": "rectifier", "delay": 0.05},
        {},
    ):
        assert identify(shared, "pr-moesp", **options) == identify(trials[0], "pr-moesp", **options)
    lags = ({}, {"reflex_lags": 0.3}, {"intrinsic_lags": 0.02}, {})
    for options in lags:
        cascade = {"max_passes": 2, **options}
        assert identify(shared, "parallel-cascade", **cascade) == identify(trials[0], "parallel-cascade", **cascade)


def test_every_derivative_and_channel_is_computed_once(trials, calls):
    shared = prepare(trials[0])
    for _ in range(2):
        for name in METHODS:
            evaluate(shared, identify_by(shared, name))
    assert len(calls) > 10
    assert len(set(calls)) == len(calls)


def test_a_trial_is_validated_once(trials, monkeypatch):
    count = []
    monkeypatch.setattr(module, "validate", lambda trial: count.append(1) or trial)
    shared = prepare(trials[0])
    for name in ("pr-moesp", "parallel-cascade"):
        evaluate(shared, identify(shared, name).predict(shared))
    assert len(count) == 1
    assert prepare(shared) is shared
    PreparedTrial(trials[0], validated=True)
    assert len(count) == 1
