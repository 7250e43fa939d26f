"""Tests of residuals: false alarms as often as they say, and what is left is seen."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import identify, simulate
from ankleloop.assessment.residuals import residual_test
from ankleloop.joint.regressors import build_regressors, predicted_inputs
from ankleloop.signals.decimation import decimate


def test_false_alarms():
    rng = np.random.default_rng(1)
    found = []
    for _ in range(200):
        e, x = rng.standard_normal((2, 5000))
        found.append(residual_test(e, sps.lfilter([1.0], [1.0, -0.9], x), 100.0))
    for p in (np.array([f.white_p for f in found]), np.array([f.related_p for f in found])):
        assert 0.015 < np.mean(p < 0.05) < 0.1
        assert 0.4 < p.mean() < 0.65
    spread = np.std([f.correlation for f in found]) / found[0].limit
    assert spread == pytest.approx(1 / 2.576, rel=0.06)


def test_decimated_white_noise_counts_as_white():
    """Its autocorrelation at 100 Hz is not that of white noise; within the pass band it is white."""
    rng = np.random.default_rng(2)
    recorded = rng.standard_normal(60_000)
    e = decimate(recorded, 10, 500, 5800)
    assert np.corrcoef(e[1:], e[:-1])[0, 1] > 0.1
    found = residual_test(e, rng.standard_normal(5800), 100.0)
    assert found.white
    assert not found.related


def test_colour_and_relation_are_seen():
    rng = np.random.default_rng(3)
    x = rng.standard_normal(5000)
    e = sps.lfilter([1.0], [1.0, -0.5], rng.standard_normal(5000))
    assert not residual_test(e, x, 100.0).white
    late = residual_test(e + 0.2 * np.roll(x, 7), x, 100.0)
    assert late.related
    assert late.lags[np.argmax(np.abs(late.correlation))] == pytest.approx(0.07)


def test_the_density_is_a_density():
    rng = np.random.default_rng(4)
    found = residual_test(3.0 * rng.standard_normal(50_000), rng.standard_normal(50_000), 100.0)
    # White noise of variance 9 has 9 / 50 per Hz up to 50 Hz.
    assert found.density.mean() == pytest.approx(9.0 / 50.0, rel=0.03)


def test_instruments_judge_in_closed_loop():
    """The true model leaves nothing that depends on the reference, though its residual depends on the position."""
    trial = simulate(seed=1, load=(0.1, 10.0, 100.0), reflex_gain=25.0, voluntary=0.3)
    r = build_regressors(trial, delay=0.04, basis="rectifier", identification_rate=100.0, reference="reference")
    instrument = predicted_inputs(trial, r, 0.04)[:, 0]
    right = r.torque - identify(trial, "riv").torque["net"].values
    wrong = r.torque - identify(trial, "pr-moesp", basis="rectifier").torque["net"].values
    assert not residual_test(right, instrument, 100.0).related
    assert residual_test(right, r.inputs[:, 0], 100.0).related
    assert residual_test(wrong, instrument, 100.0).related
