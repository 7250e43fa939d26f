"""The interval of the difference of two VAFs on the same unseen torque."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import vaf
from ankleloop.joint.regressors import torque_dataset
from ankleloop_lab.recordings.analysis import compare_unseen


def part(y, residual, start=0):
    return torque_dataset(
        np.arange(start, start + y.size) / 100, 100.0, measured=y, net=y - residual
    )


def coloured(rng, size):
    return sps.lfilter([1.0], [1.0, -0.9], rng.standard_normal(size + 500))[500:]


@pytest.mark.parametrize("trials", [1, 4])
def test_intervals_hold_the_true_difference(trials):
    """Two residuals with a common part; the true VAFs are known from the variances."""
    rng = np.random.default_rng(1)
    truth = 100 * ((0.09 + 0.16) - (0.09 + 0.07))  # residuals' variances over that of the torque
    hits, widths = [], []
    for _ in range(300):
        pairs = []
        for _ in range(trials):
            y, common, a, b = (coloured(rng, 4000 // trials) for _ in range(4))
            pairs.append(
                (part(y, 0.3 * common + np.sqrt(0.07) * a), part(y, 0.3 * common + 0.4 * b))
            )
        difference = compare_unseen([first for first, _ in pairs], [second for _, second in pairs])
        hits.append(difference.low < truth < difference.high)
        widths.append(difference.high - difference.low)
    assert np.mean(hits) == pytest.approx(0.95, abs=0.035)
    assert np.mean(widths) < 2 * truth


def test_a_common_difficulty_cancels():
    """The residual of both is large and irregular; their difference is small and certain."""
    rng = np.random.default_rng(2)
    y, hard, extra = (coloured(rng, 4000) for _ in range(3))
    parts = [part(y, 0.5 * hard), part(y, 0.5 * hard + 0.1 * extra)]
    difference = compare_unseen([parts[0]], [parts[1]])
    assert difference.difference == pytest.approx(
        vaf(y, y - 0.5 * hard) - vaf(y, y - 0.5 * hard - 0.1 * extra)
    )
    assert difference.high - difference.low < 3
    swapped = compare_unseen([parts[1]], [parts[0]])
    assert (swapped.low, swapped.high) == pytest.approx((-difference.high, -difference.low))


def test_only_common_samples_count():
    y, e = np.random.default_rng(3).standard_normal((2, 3000))
    whole, late = part(y, 0.3 * e), part(y[200:], 0.4 * e[200:], start=200)
    expected = compare_unseen([part(y[200:], 0.3 * e[200:], start=200)], [late])
    assert compare_unseen([whole], [late]) == expected


def test_too_little_is_not_judged():
    y, e = np.random.default_rng(4).standard_normal((2, 700))
    assert compare_unseen([part(y, e)], [part(y, 2 * e)]) is None
