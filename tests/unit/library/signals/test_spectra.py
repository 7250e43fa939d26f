"""Tapered spectra of records and their smoothing."""

import numpy as np
import pytest

from ankleloop.signals.spectra import Band, Bands, pass_band, pass_bands, smooth


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


# --- several records


SIZES = (700, 900)


@pytest.fixture
def records():
    """The bands of two records, and two signals of each, one after the other."""
    bands = Bands(tuple(pass_band(size, 100.0) for size in SIZES))
    return bands, np.random.default_rng(3).standard_normal((2, sum(SIZES)))


def test_what_each_time_contributes_sums_to_the_products_of_spectra(records):
    bands, signals = records
    first, second = bands.transform(signals)
    contributions = np.split(bands.contributions(first, second), SIZES[:1])
    products = np.real(first * second.conj())
    edge = bands.parts[0].frequency.size
    expected = [products[:edge].sum(), products[edge:].sum()]
    assert [part.sum() for part in contributions] == pytest.approx(expected, rel=1e-9)


def test_a_smoothed_periodogram_is_the_mean_of_those_of_equal_records():
    single = pass_band(800, 100.0)
    equal = Bands((single,) * 3)
    x = np.random.default_rng(4).standard_normal(2400)
    power = np.abs(equal.transform(x)) ** 2
    mean = np.mean([single.smooth(part, 1.0) for part in np.split(power, 3)], axis=0)
    np.testing.assert_allclose(equal.smooth(power, 1.0), np.tile(mean, 3))
    assert equal.smoothing_variance(1.0) == pytest.approx(single.smoothing_variance(1.0) / 3.0)


def test_records_weigh_in_the_noise_as_they_are_long():
    """A short quiet record beside a long loud one: the mean density is that of all samples."""
    rng = np.random.default_rng(3)
    quiet = rng.standard_normal(1000)
    loud = 3.0 * rng.standard_normal(9000)
    bands = pass_bands([1000, 9000], 100.0)
    power = np.abs(bands.transform(np.concatenate([quiet, loud]))) ** 2
    density = bands.average(power, 0.4)
    assert density.mean() == pytest.approx((0.1 * 1.0 + 0.9 * 9.0) * 2 / 100.0, rel=0.1)


def test_the_scatter_of_a_mean_density_is_that_of_records_as_they_are_long():
    """Over many draws of white noise, of a short record beside a long one."""
    rng = np.random.default_rng(4)
    bands = pass_bands([1000, 4000], 100.0)
    draws = rng.standard_normal((1000, bands.samples))
    powers = np.abs(bands.transform(draws)) ** 2
    densities = np.array([bands.average(power, 1.0) for power in powers])
    middle = densities[:, densities.shape[1] // 2]
    assert middle.var() / middle.mean() ** 2 == pytest.approx(
        bands.smoothing_variance(1.0), rel=0.15
    )
