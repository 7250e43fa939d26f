"""Tapered spectra of records and their smoothing."""

import numpy as np
import pytest

from ankleloop.signals.spectra import Band, Bands, pass_band, smooth


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


RATE = 100.0
SIZES = (700, 900, 700)


@pytest.fixture
def bands():
    return Bands(tuple(pass_band(size, RATE) for size in SIZES))


def draw_records(rows=()):
    return np.random.default_rng(3).standard_normal((*rows, sum(SIZES)))


def transform_alone(x):
    """Spectra of tapered records less their means, by plain Fourier sums."""
    spectra = []
    for part in np.split(x, np.cumsum(SIZES)[:-1]):
        band = pass_band(part.size, RATE)
        time = np.arange(part.size) / RATE
        kernel = np.exp(-2j * np.pi * np.outer(band.frequency, time))
        spectra.append(kernel @ ((part - part.mean()) * band.taper))
    return spectra


def test_spectra_of_records_stand_side_by_side(bands):
    x = draw_records()
    np.testing.assert_allclose(bands.transform(x), np.concatenate(transform_alone(x)), atol=1e-9)
    assert bands.frequency.size == bands.transform(x).size == bands.s.size
    assert bands.samples == sum(SIZES)
    for part in np.split(bands.centre(x + 5.0), np.cumsum(SIZES)[:-1]):
        assert part.mean() == pytest.approx(0.0, abs=1e-12)
    limited = bands.signals(bands.transform(x))
    again = np.concatenate(
        [
            np.fft.rfft(part)[pass_band(part.size, RATE).bins]
            for part in np.split(limited, np.cumsum(SIZES)[:-1])
        ]
    )
    np.testing.assert_allclose(again, bands.transform(x), atol=1e-9)


def test_what_each_time_contributes_sums_to_the_products_of_spectra(bands):
    first, second = bands.transform(draw_records((2,)))
    contributions = bands.contributions(first, second)
    assert contributions.sum() == pytest.approx(np.sum(np.real(first * second.conj())), rel=1e-9)
    of_record = contributions[SIZES[0] : SIZES[0] + SIZES[1]]
    start = pass_band(SIZES[0], RATE).frequency.size
    rows = slice(start, start + pass_band(SIZES[1], RATE).frequency.size)
    expected = np.sum(np.real(first[rows] * second[rows].conj()))
    assert of_record.sum() == pytest.approx(expected, rel=1e-9)


def test_a_smoothed_periodogram_is_the_mean_of_those_of_equal_records():
    equal = Bands((pass_band(800, RATE),) * 3)
    x = np.random.default_rng(4).standard_normal((3, 800))
    power = np.abs(equal.transform(x.ravel())) ** 2
    alone = [pass_band(800, RATE).smooth(part, 1.0) for part in np.split(power, 3)]
    np.testing.assert_allclose(equal.smooth(power, 1.0), np.tile(np.mean(alone, axis=0), 3))
    single = pass_band(800, RATE)
    assert equal.smoothing_variance(1.0) == pytest.approx(single.smoothing_variance(1.0) / 3.0)
    assert equal.correlation == pytest.approx(single.correlation)


def test_unequal_records_have_one_smooth_density(bands):
    """White noise of one variance; what is drawn is small beside what the mean is over."""
    power = np.abs(bands.transform(draw_records())) ** 2
    density = bands.average(power, 2.0)
    assert density.size == pass_band(max(SIZES), RATE).frequency.size
    assert density == pytest.approx(2.0 / RATE, rel=0.7)
    assert density.mean() == pytest.approx(2.0 / RATE, rel=0.08)
    smoothed = bands.smooth(power, 2.0)
    for part in bands.parts:
        rows = np.flatnonzero(np.isin(bands.frequency, part.frequency))
        assert smoothed[rows].min() > 0.0
    spread = np.var(power) / np.mean(power) ** 2
    assert np.var(smoothed) / np.mean(smoothed) ** 2 < 3.0 * bands.smoothing_variance(2.0) < spread


def test_lagged_products_are_sums_over_records(bands):
    x = bands.transform(draw_records())
    sums = bands.correlate(np.abs(x) ** 2, 5)
    assert sums[5] == pytest.approx(np.sum(np.abs(x) ** 2), rel=1e-9)
    assert sums == pytest.approx(sums[::-1])
    assert np.abs(sums[:5]).max() < 0.2 * sums[5]
