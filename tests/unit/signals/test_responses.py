"""Response to leads and lags of another signal."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import DataError
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.responses import apply_response, fit_finite_response, predict_decimated


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


def test_a_response_is_applied_with_its_leads():
    rng = np.random.default_rng(6)
    x = rng.standard_normal(50) + 3.0
    taps = np.array([0.5, 0.0, 1.0, -0.25])  # two leads, the present, one lag
    padded = np.pad(x - x.mean(), 2)
    expected = [0.5 * padded[t + 4] + padded[t + 2] - 0.25 * padded[t + 1] for t in range(50)]
    np.testing.assert_allclose(apply_response(taps, x, leads=2), expected, atol=1e-12)


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


def stack_equations(sources, signals, leads, lags):
    """Equations between a response and spectra of several records within the pass band, row below row."""
    matrices = []
    targets = []
    for source, signal in zip(sources, signals, strict=True):
        size = 2 * source.size
        inside = np.fft.rfftfreq(size) <= PASSBAND
        spectrum = np.fft.rfft(source - source.mean(), size)[inside]
        turns = 2j * np.pi * np.fft.rfftfreq(size)[inside]
        shifts = np.arange(-leads, lags + 1)
        columns = spectrum[:, None] * np.exp(-np.outer(turns, shifts)) / np.sqrt(size)
        target = np.fft.rfft(signal - signal.mean(), size)[inside] / np.sqrt(size)
        matrices += [columns.real, columns.imag]
        targets += [target.real, target.imag]
    return np.vstack(matrices), np.concatenate(targets)


def test_the_common_response_of_records_is_least_squares_on_all_of_them():
    """Noise is white here, so that weights hardly matter."""
    rng = np.random.default_rng(8)
    truth = np.array([0.3, -0.2, 1.0, 0.5, -0.4, 0.1])
    sources = []
    signals = []
    for size in (300, 500, 300, 400):
        source = sps.lfilter([1.0], [1.0, -0.5], rng.standard_normal(size))
        sources.append(source)
        response = np.convolve(source, truth)[1 : 1 + size]
        signals.append(response + 2.0 * rng.standard_normal(size))
    stacked, *_ = np.linalg.lstsq(*stack_equations(sources, signals, 1, 4), rcond=None)
    common = fit_finite_response(signals, sources, 100.0, leads=0.01, lags=0.04)
    alone = fit_finite_response(signals[:1], sources[:1], 100.0, leads=0.01, lags=0.04)
    assert np.linalg.norm(common - stacked) < 0.2 * np.linalg.norm(stacked - truth)
    assert np.linalg.norm(common - stacked) < 0.1 * np.linalg.norm(alone - stacked)
