"""Tests of residuals: false alarms are as frequent as their level says, and deviations are detected."""

import numpy as np
import pytest
from scipy import signal as sps
from scipy import stats

from ankleloop import DataError, identify, simulate
from ankleloop.assessment.residuals import residual_test
from ankleloop.joint.prepared import prepare
from ankleloop.signals.decimation import decimate


def draw_residual(rng, samples):
    """White noise at 1 kHz, decimated as the library does it."""
    return decimate(rng.standard_normal(10 * (samples + 100)), 10, 500, samples)


@pytest.fixture(scope="module")
def movements():
    trials = [prepare(simulate(seed=seed, duration=22.0)) for seed in range(8)]
    return [decimate(trial.samples["position"], 10, 500, 2000) for trial in trials]


@pytest.fixture(scope="module")
def null_tests(movements):
    """Tests of residuals that are white in the pass band and unrelated to the movement."""
    rng = np.random.default_rng(1)
    return [
        residual_test(draw_residual(rng, 2000), movements[k % len(movements)], 100.0)
        for k in range(600)
    ]


@pytest.mark.parametrize("name", ["white_p", "related_p"])
def test_frequency_of_false_alarms(null_tests, name):
    """It is within the 99.9 % interval of a binomial at each level, and the probabilities are uniform."""
    p = np.array([getattr(test, name) for test in null_tests])
    for level in (0.01, 0.05, 0.2):
        low, high = stats.binom.interval(0.999, p.size, level)
        assert low <= np.sum(p < level) <= high
    assert stats.kstest(p, "uniform").pvalue > 0.001


def test_the_limit_holds_99_percent_of_the_correlations(null_tests):
    beyond = np.mean([np.mean(np.abs(test.correlation) > test.limit) for test in null_tests])
    assert beyond == pytest.approx(0.01, abs=0.002)


def test_colour_and_relation_are_detected():
    rng = np.random.default_rng(3)
    x = rng.standard_normal(5000)
    e = sps.lfilter([1.0], [1.0, -0.5], rng.standard_normal(5000))
    assert not residual_test(e, x, 100.0).white
    test = residual_test(e + 0.2 * np.roll(x, 7), x, 100.0)
    assert test.related
    assert test.lags[np.argmax(np.abs(test.correlation))] == pytest.approx(0.07)


def test_instruments_in_closed_loop():
    """The residual of the true model does not depend on the reference, though it depends on the position."""
    trial = simulate(seed=1, load=(0.1, 10.0, 100.0), reflex_gain=25.0, voluntary=0.3)
    prepared = prepare(trial)
    r = prepared.regressors(
        delay=0.04, basis="rectifier", identification_rate=100.0, reference="reference"
    )
    instrument = prepared.predict_inputs(r)[:, 0]
    consistent = r.torque - identify(trial, "riv").torque["net"].values
    biased = r.torque - identify(trial, "pr-moesp", basis="rectifier").torque["net"].values
    assert not residual_test(consistent, instrument, 100.0).related
    assert residual_test(consistent, r.inputs[:, 0], 100.0).related
    assert residual_test(biased, instrument, 100.0).related


def test_a_short_residual_is_refused():
    with pytest.raises(
        DataError, match=r"3 s have 114 frequencies .* need 150: use a longer record"
    ):
        residual_test(np.arange(300.0) % 7, np.arange(300.0), 100.0)
