"""Noise of a position above the band of a movement, and what is left without it."""

import numpy as np
import pytest

from ankleloop.signals.noise import measure_velocity_noise, remove_noise

TIME = np.arange(20_000) / 1000.0
INSIDE = slice(500, -500)


@pytest.mark.parametrize("frequency", [1.0, 10.0, 30.0])
def test_a_movement_passes(frequency):
    movement = np.sin(2.0 * np.pi * frequency * TIME)
    passed = remove_noise(movement, 1000.0)
    np.testing.assert_allclose(passed[INSIDE], movement[INSIDE], atol=1e-3)


@pytest.mark.parametrize("frequency", [50.0, 60.0, 180.0])
def test_hum_does_not(frequency):
    hum = np.sin(2.0 * np.pi * frequency * TIME)
    assert np.abs(remove_noise(hum, 1000.0)[INSIDE]).max() < 1e-3


def test_the_share_of_hum_is_that_of_its_power():
    movement = 0.01 * np.sin(2.0 * np.pi * 5.0 * TIME)
    hum = 0.0005 * np.sin(2.0 * np.pi * 50.0 * TIME + 1.0)
    noise = measure_velocity_noise(movement + hum, 150.0 * movement, 1000.0)
    share = (0.0005 * 50.0) ** 2 / ((0.0005 * 50.0) ** 2 + (0.01 * 5.0) ** 2)
    assert noise.share == pytest.approx(share, rel=0.05)
    assert noise.dominates


def test_a_short_or_slow_record_is_not_judged():
    assert measure_velocity_noise(np.zeros(3000), np.zeros(3000), 1000.0) is None
    assert measure_velocity_noise(np.zeros(20_000), np.zeros(20_000), 100.0) is None
