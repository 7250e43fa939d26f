import numpy as np
import pytest
from scipy import signal as sps

from ankleloop.simulation.filters import antialias, bessel_denominator, voluntary_filter
from ankleloop.simulation.settings import SimulationSettings


@pytest.mark.parametrize("order", [2, 4])
def test_bessel_denominator_against_scipy(order):
    cutoff = 2 * np.pi * 80.0
    b, a = sps.bessel(order, cutoff, analog=True, norm="mag")
    np.testing.assert_allclose(bessel_denominator(order, cutoff), a / a[0], rtol=1e-8)
    assert np.abs(sps.freqs(b, a, [cutoff])[1][0]) == pytest.approx(np.sqrt(0.5), rel=1e-8)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_the_antialiasing_filter_against_scipy(hold):
    settings = SimulationSettings()
    x = np.random.default_rng(0).standard_normal(400)
    a = bessel_denominator(4, 2 * np.pi * settings.antialias_cutoff)
    rate = settings.recording_rate
    numerator, denominator, _ = sps.cont2discrete(([a[-1]], a), 1.0 / rate, method=hold)
    expected = sps.lfilter(numerator.ravel(), denominator, x)
    np.testing.assert_allclose(antialias(x, settings, hold), expected, atol=1e-10)


def test_the_filter_of_the_voluntary_torque_against_scipy():
    system, warmup, deviation = voluntary_filter(1000.0, 2.0)
    x = np.random.default_rng(1).standard_normal(3000)
    sos = sps.bessel(2, 2.0, fs=1000.0, norm="mag", output="sos")
    np.testing.assert_allclose(system.run(x), sps.sosfilt(sos, x), atol=1e-9)
    response = sps.sosfilt(sos, np.eye(1, 2 * warmup + 1)[0])
    assert deviation == pytest.approx(np.linalg.norm(response), rel=1e-8)
