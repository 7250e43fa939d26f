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


def test_slow_noise_has_unit_deviation_and_the_spectrum_of_the_filter():
    noise = draw_slow_noise(np.random.default_rng(1), 400_000, 100.0, 2.0)
    assert noise.std() == pytest.approx(1.0, abs=0.02)
    frequency, density = sps.welch(noise, 100.0, nperseg=1000)
    expected = (
        np.abs(
            sps.sosfreqz(
                sps.bessel(2, 2.0, fs=100.0, norm="mag", output="sos"), frequency, fs=100.0
            )[1]
        )
        ** 2
    )
    shown = (frequency > 0.2) & (frequency < 8.0)
    ratio = density[shown] / expected[shown]
    np.testing.assert_allclose(ratio / ratio.mean(), 1.0, atol=0.2)
    assert np.abs(density[frequency == 2.0] / density[frequency == 0.2]) == pytest.approx(
        0.5, rel=0.15
    )
