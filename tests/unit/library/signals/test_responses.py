"""Response to leads and lags of another signal."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import DataError
from ankleloop.signals.responses import fit_finite_response, predict_decimated


def test_a_finite_response_in_coloured_noise():
    rng = np.random.default_rng(4)
    x = sps.lfilter([1.0], [1.0, -0.8], rng.standard_normal(20_000))
    truth = np.array([0.0, 0.2, 1.0, 0.5, -0.3, 0.1])  # from one sample of lead to four of lag
    y = np.convolve(x, truth)[1 : 1 + x.size] + 10 * sps.lfilter(
        [0.02], [1.0, -0.98], rng.standard_normal(20_000)
    )
    taps = fit_finite_response([y], [x], 100.0, leads=0.01, lags=0.04)
    np.testing.assert_allclose(taps, truth, atol=0.1)
    with pytest.raises(DataError, match="too short for a response"):
        fit_finite_response([y[:20]], [x[:20]], 100.0)


def test_the_prediction_keeps_the_delay_of_the_signal():
    rng = np.random.default_rng(5)
    source = sps.sosfiltfilt(
        sps.butter(4, 10.0, fs=1000.0, output="sos"), rng.standard_normal(40_000)
    )
    delayed = np.roll(source, 70)
    grid = (10, 500, 3800)
    (prediction,) = predict_decimated([delayed[500:38_500:10]], [source], [grid], 1000.0)
    middle = slice(2000, -3000)
    assert np.std((prediction - delayed + delayed.mean())[middle]) < 0.02 * np.std(delayed)
