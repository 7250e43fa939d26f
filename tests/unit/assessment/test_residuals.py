"""Tests of residuals: false alarms are as frequent as their level says, and deviations are detected."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import identify, simulate
from ankleloop.assessment.residuals import residual_test
from ankleloop.joint.prepared import prepare
from ankleloop.signals.decimation import decimate


def test_frequency_of_false_alarms():
    rng = np.random.default_rng(1)
    tests = []
    for _ in range(200):
        e, x = rng.standard_normal((2, 5000))
        tests.append(residual_test(e, sps.lfilter([1.0], [1.0, -0.9], x), 100.0))
    for p in (np.array([test.white_p for test in tests]), np.array([test.related_p for test in tests])):
        assert 0.015 < np.mean(p < 0.05) < 0.1
        assert 0.4 < p.mean() < 0.65
    spread = np.std([test.correlation for test in tests]) / tests[0].limit
    assert spread == pytest.approx(1 / 2.576, rel=0.06)


def test_decimated_white_noise_counts_as_white():
    """Its autocorrelation at 100 Hz is not that of white noise; within the pass band it is white."""
    rng = np.random.default_rng(2)
    recorded = rng.standard_normal(60_000)
    e = decimate(recorded, 10, 500, 5800)
    assert np.corrcoef(e[1:], e[:-1])[0, 1] > 0.1
    test = residual_test(e, rng.standard_normal(5800), 100.0)
    assert test.white
    assert not test.related


def test_colour_and_relation_are_detected():
    rng = np.random.default_rng(3)
    x = rng.standard_normal(5000)
    e = sps.lfilter([1.0], [1.0, -0.5], rng.standard_normal(5000))
    assert not residual_test(e, x, 100.0).white
    test = residual_test(e + 0.2 * np.roll(x, 7), x, 100.0)
    assert test.related
    assert test.lags[np.argmax(np.abs(test.correlation))] == pytest.approx(0.07)


def test_density_of_white_noise():
    rng = np.random.default_rng(4)
    test = residual_test(3.0 * rng.standard_normal(50_000), rng.standard_normal(50_000), 100.0)
    # White noise of variance 9 has 9 / 50 per Hz up to 50 Hz.
    assert test.density.mean() == pytest.approx(9.0 / 50.0, rel=0.03)


def test_instruments_in_closed_loop():
    """The residual of the true model does not depend on the reference, though it depends on the position."""
    trial = simulate(seed=1, load=(0.1, 10.0, 100.0), reflex_gain=25.0, voluntary=0.3)
    prepared = prepare(trial)
    r = prepared.regressors(delay=0.04, basis="rectifier", identification_rate=100.0, reference="reference")
    instrument = prepared.predict_inputs(r)[:, 0]
    consistent = r.torque - identify(trial, "riv").torque["net"].values
    biased = r.torque - identify(trial, "pr-moesp", basis="rectifier").torque["net"].values
    assert not residual_test(consistent, instrument, 100.0).related
    assert residual_test(consistent, r.inputs[:, 0], 100.0).related
    assert residual_test(biased, instrument, 100.0).related
