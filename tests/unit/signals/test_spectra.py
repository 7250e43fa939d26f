"""Tapered spectra of records and their smoothing."""

import numpy as np
import pytest

from ankleloop.signals.spectra import Band, smooth


def test_white_noise_has_the_density_of_its_variance():
    rng = np.random.default_rng(1)
    band = Band(20_000, 100.0, 1.0, 40.0)
    power = np.abs(band.transform(rng.standard_normal(20_000))) ** 2 / band.density
    assert power.mean() == pytest.approx(2 / 100.0, rel=0.03)
    assert band.frequency[0] >= 1.0
    assert band.frequency[-1] <= 40.0


def test_the_taper_prevents_leakage_of_drift():
    band = Band(5000, 100.0, 5.0, 38.0)
    drift = np.linspace(-1.0, 1.0, 5000)
    assert np.abs(band.transform(drift)).max() < 1e-3 * np.abs(np.fft.rfft(drift)).max()


def test_correlation_is_the_variance_that_the_taper_adds():
    """The variance of a mean over frequencies, measured, against the computed factor."""
    rng = np.random.default_rng(2)
    band = Band(1000, 100.0, 1.0, 40.0)
    means = [np.mean(np.abs(band.transform(rng.standard_normal(1000))) ** 2) for _ in range(2000)]
    expected = np.mean(means) ** 2 / band.frequency.size * band.correlation
    assert np.var(means) == pytest.approx(expected, rel=0.15)


def test_smoothing_keeps_levels_and_slopes():
    assert smooth(np.full(100, 3.0), 10) == pytest.approx(np.full(100, 3.0))
    line = smooth(np.arange(100.0), 10)
    assert line[20:80] == pytest.approx(np.arange(20.0, 80.0))
