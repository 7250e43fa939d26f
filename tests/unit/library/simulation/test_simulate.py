"""Simulated trials: seeds, levels of the disturbances, parts of the torque, stability."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import simulate

RATE = 1000.0


def test_the_same_seed_gives_the_same_bits():
    first, second, other = (simulate(seed=seed, duration=5.0) for seed in (7, 7, 8))
    assert first.identical(second)
    assert simulate(seed=np.random.SeedSequence(7), duration=5.0)["torque"].identical(
        first["torque"]
    )
    assert not np.array_equal(first["reference"], other["reference"])


def test_a_seed_sequence_is_not_changed():
    seed = np.random.SeedSequence([1, 2, 3])
    assert simulate(seed=seed, duration=5.0).identical(simulate(seed=seed, duration=5.0))
    assert seed.n_children_spawned == 0
    children = [simulate(seed=child, duration=5.0)["torque"].values for child in seed.spawn(2)]
    assert not np.array_equal(*children)


def test_signals_have_separate_streams():
    clean = simulate(seed=3, duration=5.0, snr_db=None, voluntary=0.0)
    noisy = simulate(seed=3, duration=5.0, snr_db=10.0, voluntary=0.3)
    louder = simulate(seed=3, duration=5.0, snr_db=10.0, voluntary=0.6)
    np.testing.assert_array_equal(clean["reference"], noisy["reference"])
    np.testing.assert_array_equal(noisy["torque_noise"], louder["torque_noise"])
    np.testing.assert_allclose(
        louder["torque_voluntary"], 2 * noisy["torque_voluntary"], rtol=1e-12
    )
    streams = [noisy[name].values for name in ("reference", "torque_voluntary", "torque_noise")]
    assert np.max(np.abs(np.corrcoef(streams) - np.eye(3))) < 0.25
    other_joint = simulate(seed=3, duration=7.0, reflex_gain=2.0, load=(1.0, 20.0, 300.0))
    np.testing.assert_array_equal(other_joint["reference"][:5000], clean["reference"])


def test_noise_and_voluntary_torque_have_their_levels():
    levels = []
    for seed in range(10):
        clean = simulate(seed=seed, snr_db=None, voluntary=0.0)["torque"].values
        trial = simulate(seed=seed, snr_db=10.0, voluntary=0.4)
        levels.append(
            [trial[f"torque_{part}"].values.var() / clean.var() for part in ("noise", "voluntary")]
        )
    noise, voluntary = np.mean(levels, axis=0)
    assert noise == pytest.approx(0.1, rel=0.02)
    assert voluntary == pytest.approx(0.16, rel=0.15)


def test_voluntary_torque_is_slow_and_noise_is_white_below_its_rate():
    trial = simulate(seed=1, duration=200.0, voluntary=0.5)
    frequency, power = sps.welch(trial["torque_voluntary"], RATE, nperseg=8192)
    assert power[frequency > 10].sum() < 0.01 * power.sum()
    noise = trial["torque_noise"].values[9::10]
    correlation = np.correlate(noise, noise, "full")[noise.size - 1 :][1:6] / (noise @ noise)
    assert np.max(np.abs(correlation)) < 0.05


def test_in_open_loop_torque_does_not_move_the_joint():
    quiet = simulate(seed=2, duration=5.0, closed_loop=False, snr_db=None, voluntary=0.0)
    noisy = simulate(seed=2, duration=5.0, closed_loop=False, snr_db=0.0, voluntary=1.0)
    np.testing.assert_array_equal(quiet["position"], noisy["position"])
    closed = [simulate(seed=2, duration=5.0, snr_db=db)["position"].values for db in (None, 0.0)]
    assert np.std(closed[0] - closed[1]) > 0.01 * np.std(closed[0])


def test_settling_is_simulated_and_dropped():
    unsettled = simulate(seed=2, duration=10.0, settling=0.0, snr_db=None, voluntary=0.0)
    settled = simulate(seed=2, duration=5.0, settling=5.0, snr_db=None, voluntary=0.0)
    np.testing.assert_array_equal(unsettled["position"][5000:], settled["position"])
    assert float(settled["time"][0]) == 0.0


def test_without_an_antialiasing_filter_signals_are_sampled_as_they_are():
    trial = simulate(seed=1, duration=5.0, voluntary=0.0, antialias_cutoff=None)
    assert set(np.unique(trial["reference"].values)) == {-0.02, 0.02}
    noise = trial["torque_noise"].values.reshape(-1, 10)
    np.testing.assert_array_equal(noise, noise[:, :1] * np.ones(10))  # held between its draws
    parts = sum(
        trial[f"torque_{part}"].values for part in ("intrinsic", "reflex", "voluntary", "noise")
    )
    np.testing.assert_allclose(trial["torque"].values, parts, rtol=0, atol=1e-12)
    assert "antialias_cutoff" not in trial.attrs
