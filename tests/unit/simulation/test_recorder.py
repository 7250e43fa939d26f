"""A recorder without an anti-aliasing filter samples the signals of the loop as they are."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import simulate

RATE = 1000.0


def test_a_trial_has_steps_that_a_filter_would_smooth():
    trial = simulate(seed=1, duration=5.0, voluntary=0.0, antialias_cutoff=None)
    assert set(np.unique(trial["reference"].values)) == {-0.02, 0.02}
    noise = trial["torque_noise"].values.reshape(-1, 10)
    np.testing.assert_array_equal(noise, noise[:, :1] * np.ones(10))  # held between its draws
    parts = sum(trial[f"torque_{part}"].values for part in ("intrinsic", "reflex", "voluntary", "noise"))
    np.testing.assert_allclose(trial["torque"].values, parts, rtol=0, atol=1e-12)
    assert "antialias_cutoff" not in trial.attrs


def test_the_noise_has_its_level_without_a_filter():
    settings = {"duration": 200.0, "voluntary": 0.0, "antialias_cutoff": None}
    clean = simulate(seed=1, **settings, snr_db=None)["torque"].values
    noise = simulate(seed=1, **settings, snr_db=10.0)["torque_noise"].values
    assert np.var(noise) / np.var(clean) == pytest.approx(0.1, rel=0.05)


def test_a_reflex_is_that_of_a_filtered_record_up_to_the_filter():
    """The filter delays slow signals by its group delay; it does not act back on the loop."""
    settings = {"duration": 5.0, "voluntary": 0.0, "snr_db": None}
    plain = simulate(seed=1, **settings, antialias_cutoff=None)["torque_reflex"].values
    wide = simulate(seed=1, **settings, antialias_cutoff=5000.0)["torque_reflex"].values
    _, a = sps.bessel(4, 2 * np.pi * 5000.0, analog=True, norm="mag")
    delay = a[-2] / a[-1]  # of the Bessel low-pass at low frequencies
    time = np.arange(plain.size) / RATE
    delayed = np.interp(time - delay, time, plain)
    assert np.abs(delayed - wide)[10:].max() < 1e-3 * np.abs(plain).max()
