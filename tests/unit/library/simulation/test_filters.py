import numpy as np
import pytest
from scipy import signal as sps

from ankleloop.simulation.filters import antialias, bessel_denominator, draw_slow_noise
from ankleloop.simulation.settings import SimulationSettings


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_the_antialiasing_filter_against_scipy(hold):
    settings = SimulationSettings()
    x = np.random.default_rng(0).standard_normal(400)
    a = bessel_denominator(4, 2 * np.pi * settings.antialias_cutoff)
    rate = settings.recording_rate
    numerator, denominator, _ = sps.cont2discrete(([a[-1]], a), 1.0 / rate, method=hold)
    expected = sps.lfilter(numerator.ravel(), denominator, x)
    np.testing.assert_allclose(antialias(x, settings, hold), expected, atol=1e-10)


@pytest.mark.parametrize("order", [2, 4])
def test_the_bessel_filters_are_those_of_scipy(order):
    _, expected = sps.bessel(order, 30.0, analog=True, norm="mag")
    np.testing.assert_allclose(bessel_denominator(order, 30.0), expected, rtol=1e-12)


def test_slow_noise_is_white_noise_behind_the_digital_filter_of_scipy():
    warmup = 250  # five periods of 2 Hz
    noise = draw_slow_noise(np.random.default_rng(1), 400_000, 100.0, 2.0)
    assert noise.std() == pytest.approx(1.0, abs=0.02)
    white = np.random.default_rng(1).standard_normal(warmup + 400_000)
    sections = sps.bessel(2, 2.0, fs=100.0, norm="mag", output="sos")
    slow = sps.sosfilt(sections, white)[warmup:]
    np.testing.assert_allclose(noise, slow * (noise[0] / slow[0]), atol=1e-10)
