"""Intervals of the VAF against its value on a long record, and of parameters by the bootstrap."""

import itertools

import numpy as np
import pandas as pd
import pytest
from scipy import signal as sps

from ankleloop import DataError, block_bootstrap, identify, simulate
from ankleloop.assessment.bootstrap import Bootstrap, _draw_blocks
from ankleloop.joint.prepared import prepare
from ankleloop.signals.vaf import vaf_with_interval


def draw_autoregression(rng, samples, pole):
    return sps.lfilter([np.sqrt(1 - pole**2)], [1.0, -pole], rng.standard_normal(samples + 500))[
        500:
    ]


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_intervals_of_the_vaf_hold_its_value_on_a_long_record(pole):
    rng = np.random.default_rng(2)
    truth, covered = 100.0 * (1 - 0.25 / 1.25), 0
    for _ in range(300):
        y, e = draw_autoregression(rng, 4000, pole), 0.5 * draw_autoregression(rng, 4000, 0.5)
        _, low, high = vaf_with_interval(y + e, y, 100)
        assert low < high < 100
        covered += low < truth < high
    assert 0.91 < covered / 300 < 0.985


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
            assert low < (bootstrap.estimate.stiffness | bootstrap.estimate.reflex)[name] < high, (
                name
            )
    low, high = bootstrap.intervals()["vaf_net"]
    assert 85 < low < high < 99


def test_the_bootstrap_is_reproducible():
    trial = simulate(seed=3, duration=22.0)
    first, second = (block_bootstrap(trial, "riv", repetitions=2, seed=5).samples for _ in range(2))
    assert first.equals(second)
    assert first.equals(block_bootstrap(prepare(trial), "riv", repetitions=2, seed=5).samples)
    with pytest.raises(ValueError, match="repetitions must be between 2 and 100000, got 1"):
        block_bootstrap(trial, "riv", repetitions=1)


@pytest.fixture
def fail_at(monkeypatch):
    """Make the identification of some repetitions fail: those with these numbers, the record itself being 0."""

    def fail(numbers, error):
        count = itertools.count()

        def identify_or_fail(*args, **options):
            if next(count) in numbers:
                raise error
            return identify(*args, **options)

        monkeypatch.setattr("ankleloop.assessment.bootstrap.identify", identify_or_fail)

    return fail


def test_a_tenth_of_the_repetitions_may_fail(fail_at):
    error = np.linalg.LinAlgError("no fit")
    trial = simulate(seed=3, duration=22.0)
    fail_at({4, 9}, error)
    bootstrap = block_bootstrap(trial, "riv", repetitions=20)
    assert (bootstrap.failed, len(bootstrap.samples)) == (2, 18)
    fail_at({4, 9, 10}, error)
    message = (
        r"riv failed on 3 of 20 resampled records, .* 90% of them. The last one failed with: no fit"
    )
    with pytest.raises(DataError, match=message):
        block_bootstrap(trial, "riv", repetitions=20)


def test_an_interval_needs_a_sample_in_each_tail():
    samples = pd.DataFrame({"K": np.arange(40.0)})
    assert Bootstrap(None, samples, 0).intervals() == {
        "K": (pytest.approx(0.975), pytest.approx(38.025))
    }
    with pytest.raises(ValueError, match=r"level 0.95 needs at least 40 samples, .*; there are 39"):
        Bootstrap(None, samples[:39], 0).intervals()
    assert Bootstrap(None, samples[:4], 0).intervals(level=0.5)["K"] == (0.75, 2.25)
    with pytest.raises(ValueError, match=r"level must be above 0 and below 1, got 1\.0"):
        Bootstrap(None, samples, 0).intervals(level=1.0)


def test_blocks_come_from_all_of_the_residual():
    """Every sample is drawn equally often, those at both ends as well."""
    residual = np.arange(400.0)
    rng = np.random.default_rng(1)
    draws = [_draw_blocks(residual, 20, rng) for _ in range(2000)]
    spans = [draw.max() - draw.min() for draw in draws]
    assert np.mean(spans) > 0.9 * np.ptp(residual)
    # Of blocks of a part of the residual the variance would be smaller.
    assert np.mean([draw.var() for draw in draws]) == pytest.approx(residual.var(), rel=0.1)
