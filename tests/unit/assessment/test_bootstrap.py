"""Intervals: of the VAF against its long run, of parameters by the bootstrap against the asymptotic ones."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import DataError, block_bootstrap, evaluate, identify, simulate
from ankleloop.signals.vaf import long_run_variance, vaf_interval


def correlated(rng, samples, pole):
    return sps.lfilter([np.sqrt(1 - pole**2)], [1.0, -pole], rng.standard_normal(samples + 500))[500:]


@pytest.mark.parametrize("pole", [0.0, 0.8, 0.95])
def test_long_run_variance_of_an_autoregression(pole):
    x = correlated(np.random.default_rng(1), 400_000, pole)
    assert long_run_variance(x, 400) == pytest.approx((1 + pole) / (1 - pole), rel=0.15)


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_intervals_of_the_vaf_hold_its_long_run(pole):
    rng = np.random.default_rng(2)
    truth, held = 100.0 * (1 - 0.25 / 1.25), 0
    for _ in range(300):
        y, e = correlated(rng, 4000, pole), 0.5 * correlated(rng, 4000, 0.5)
        low, high = vaf_interval(y + e, y, 100)
        assert low < high < 100
        held += low < truth < high
    assert 0.91 < held / 300 < 0.985


def test_a_perfect_estimate_has_no_interval():
    y = np.sin(np.arange(100.0))
    assert vaf_interval(y, y, 10) == (100.0, 100.0)
    with pytest.raises(DataError, match="constant"):
        vaf_interval(np.ones(10), np.ones(10), 3)


def test_intervals_in_the_table_of_scores():
    trial = simulate(seed=1, duration=20.0)
    table = evaluate(trial, identify(trial, "pr-moesp"), intervals=True)
    assert ((table["low"] < table["vaf"]) & (table["vaf"] < table["high"])).all()


@pytest.fixture(scope="module")
def bootstrap():
    return block_bootstrap(simulate(seed=3, duration=40.0), "riv", repetitions=40, seed=1)


def test_the_bootstrap_checks_the_asymptotic_intervals(bootstrap):
    asymptotic = bootstrap.estimate.diagnostics["standard_errors"]
    for name, error in bootstrap.standard_errors().items():
        if name in asymptotic:
            assert 0.6 < error / asymptotic[name] < 1.6, name
    assert bootstrap.failed == 0
    for name, (low, high) in bootstrap.intervals().items():
        assert low <= high
        if name in asymptotic:
            found = (bootstrap.estimate.stiffness | bootstrap.estimate.reflex)[name]
            assert low < found < high, name
    low, high = bootstrap.intervals()["vaf_net"]
    assert 85 < low < high < 99


def test_the_bootstrap_serves_methods_without_intervals():
    found = block_bootstrap(simulate(seed=3, duration=25.0), "parallel-cascade", repetitions=5, block=1.0)
    assert list(found.samples)[:3] == ["K", "B", "I"]
    assert (found.samples.std() > 0).drop("delay").all()


def test_the_bootstrap_repeats_itself_and_refuses_short_records():
    trial = simulate(seed=3, duration=22.0)
    first, second = (block_bootstrap(trial, "riv", repetitions=2, seed=5).samples for _ in range(2))
    assert first.equals(second)
    with pytest.raises(DataError, match="less than ten blocks of 4 s"):
        block_bootstrap(trial, "riv", block=4.0)
    with pytest.raises(ValueError, match="repetitions must be at least 2"):
        block_bootstrap(trial, "riv", repetitions=1)
