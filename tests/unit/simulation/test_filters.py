import numpy as np
import pytest
from scipy import signal as sps

from ankleloop.simulation import Simulation, simulate, simulate_trials
from ankleloop.simulation.filters import antialias, bessel_denominator, run_filter, voluntary_filter


@pytest.mark.parametrize("order", [1, 2, 3, 4, 6])
def test_the_bessel_filter_of_the_textbook(order):
    cutoff = 2 * np.pi * 80.0
    b, a = sps.bessel(order, cutoff, analog=True, norm="mag")
    np.testing.assert_allclose(bessel_denominator(order, cutoff), a / a[0], rtol=1e-8)
    assert np.abs(sps.freqs(b, a, [cutoff])[1][0]) == pytest.approx(np.sqrt(0.5), rel=1e-8)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_the_recorder_is_discretised_exactly(hold):
    simulation = Simulation.from_flat()
    x = np.random.default_rng(0).standard_normal((3, 400))
    a = bessel_denominator(4, 2 * np.pi * simulation.recorder.antialias_cutoff)
    rate = simulation.recorder.recording_rate
    numerator, denominator, _ = sps.cont2discrete(([a[-1]], a), 1.0 / rate, method=hold)
    expected = sps.lfilter(numerator.ravel(), denominator, x)
    np.testing.assert_allclose(antialias(x, simulation, hold), expected, atol=1e-10)
    np.testing.assert_array_equal(antialias(x[1], simulation, hold), antialias(x, simulation, hold)[1])


def test_the_filter_of_the_voluntary_torque():
    *system, warmup, deviation = voluntary_filter(1000.0, 2.0)
    x = np.random.default_rng(1).standard_normal((2, 3000))
    sos = sps.bessel(2, 2.0, fs=1000.0, norm="mag", output="sos")
    np.testing.assert_allclose(run_filter(*system, x), sps.sosfilt(sos, x), atol=1e-9)
    response = sps.sosfilt(sos, np.eye(1, 2 * warmup + 1)[0])
    assert deviation == pytest.approx(np.linalg.norm(response), rel=1e-8)


def test_many_trials_in_one_pass_are_the_trials_one_by_one():
    given = {"duration": 3.0, "reflex_gain": 5.0}
    for seed, trial in zip((4, 9, 11), simulate_trials([4, 9, 11], **given), strict=True):
        alone = simulate(seed=seed, **given)
        assert trial.identical(alone)
