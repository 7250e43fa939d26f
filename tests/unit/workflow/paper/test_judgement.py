"""The rule: whole intervals within or outside what is accepted, for one comparison and for several."""

import math

import numpy as np
import pytest
from scipy import stats

from ankleloop_workflow.paper.checks import half_interval
from ankleloop_workflow.paper.judgement import (
    AT_TOLERANCE,
    LEVEL,
    NOT_REPRODUCED,
    OPEN,
    REPRODUCED,
    Comparison,
    Mean,
    Measurement,
    judge,
)


def between(low, high, accepted=(-2.0, 2.0), **options):
    return Comparison("", Measurement((low + high) / 2, low, high), accepted, **options)


@pytest.mark.parametrize(
    ("comparison", "verdict"),
    [
        (between(-1.0, 1.0), REPRODUCED),
        (between(-2.0, 2.0), REPRODUCED),
        (between(1.9, 2.1), AT_TOLERANCE),
        (between(0.5, 2.4), OPEN),
        (between(2.1, 2.2), NOT_REPRODUCED),
        (between(-9.0, -2.1), NOT_REPRODUCED),
        (between(3.0, 4.0, (3.0, np.inf)), REPRODUCED),
        (between(2.9, 4.6, (3.0, np.inf)), OPEN),
        (between(92.0, 94.0, paper=93.0), REPRODUCED),
        (between(92.0, 94.0, paper=98.0), NOT_REPRODUCED),
        (between(-6.0, -5.0, (5.0, np.inf), size=True), REPRODUCED),
        (between(-4.0, 4.9, (5.0, np.inf), size=True), NOT_REPRODUCED),
        (between(-4.0, 5.1, (5.0, np.inf), size=True), OPEN),
        (between(np.nan, np.nan), OPEN),
        (between(0.0, 0.0, (np.nan, np.nan)), OPEN),
    ],
)
def test_verdict_of_one_comparison(comparison, verdict):
    judgement = judge([comparison])
    assert judgement.verdict == verdict
    assert judgement.decisive is comparison


def test_a_trial_without_result_is_never_judged():
    judgement = judge([Comparison("", Mean.of([1.0, np.nan, 1.0]), (-2.0, 2.0))])
    assert judgement.verdict == OPEN
    assert "there is no result" in judgement.explanation


def test_several_comparisons():
    within, outside = (
        Comparison("", Mean.of([x, x + 0.1, x + 0.2]), (-2.0, 2.0)) for x in (0.0, 9.0)
    )
    single = Comparison("", Mean.of([0.0]), (-2.0, 2.0))
    assert judge([within, within]).verdict == REPRODUCED
    assert judge([within, single]).verdict == OPEN
    assert judge([within, single]).decisive is single
    assert judge([within, single, outside]).verdict == NOT_REPRODUCED
    assert judge([within, single, outside]).decisive is outside


def test_the_interval_of_a_verdict_shows_it():
    """Reproduced by intervals of 95 %, not reproduced by intervals that hold together: one that is just outside at 95 %
    decides alone, and does not decide among four."""
    sample = np.array([-0.1, 0.0, 0.1])
    margin = half_interval(Mean.of(sample))
    near = Comparison("", Mean.of(sample + 2.01 + margin), (-2.0, 2.0))
    within = Comparison("", Mean.of(sample), (-2.0, 2.0))
    assert judge([near]).verdict == NOT_REPRODUCED
    several = judge([near, within, within, within])
    assert several.verdict == OPEN
    assert several.level == pytest.approx(1.0 - 0.05 / 4)
    low, high = several.decisive.interval(several.level)
    assert low < 2.0 < high
    close = Comparison("", Mean.of(sample + 1.99 - margin), (-2.0, 2.0))
    assert judge([close, within, within, within]).verdict == REPRODUCED


def test_the_interval_of_a_mean_is_that_of_student():
    values = np.random.default_rng(1).normal(3.0, 2.0, 12)
    for level in (0.9, LEVEL, 0.99):
        expected = stats.ttest_1samp(values, 0.0).confidence_interval(level)
        assert Mean.of(values).interval(level) == pytest.approx((expected.low, expected.high))


def test_the_difference_of_means_is_that_of_welch():
    rng = np.random.default_rng(2)
    first, second = rng.normal(3.0, 2.0, 12), rng.normal(1.0, 0.5, 5)
    expected = stats.ttest_ind(first, second, equal_var=False).confidence_interval()
    assert (Mean.of(first) - Mean.of(second)).interval() == pytest.approx(
        (expected.low, expected.high)
    )
    assert all(map(math.isnan, (Mean.of(first) - Mean.of([1.0])).interval()))
