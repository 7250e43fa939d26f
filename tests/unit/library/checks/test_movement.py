"""Movement, torque and reference of a record against plain computations."""

import numpy as np
import pytest
from scipy import signal

from ankleloop import identify, new_trial, simulate
from ankleloop.checks.movement import (
    check_bandwidth,
    check_excitation,
    check_relation,
    check_scale,
    check_size,
    check_velocity,
    motion_products,
)
from ankleloop.joint.prepared import prepare


def products(trial):
    prepared = prepare(trial)
    return motion_products(prepared, prepared.grid(100.0, 0.04))


def scale_of(trial):
    return check_scale(prepare(trial), products(trial))


def test_a_torque_without_noise_is_explained():
    """Without reflex and noise K, B and I are the truth."""
    clean = prepare(simulate(seed=1, duration=20.0, reflex_gain=0.0, snr_db=None, voluntary=0.0))
    motion = products(clean)
    np.testing.assert_allclose(motion.stiffness, [150.0, 0.8, 0.015], rtol=0.01)
    assert motion.explained > 0.9999
    assert check_relation(clean, motion).verdict == check_size(motion).verdict == "ok"


@pytest.mark.parametrize("sinusoids", [1, 2, 4])
def test_q_sinusoids_excite_2q_directions(sinusoids):
    t = np.arange(3000) / 100.0
    velocity = sum(np.sin(2 * np.pi * (1.3 + 4.1 * k) * t + k) for k in range(sinusoids))
    finding = check_excitation([velocity], 2, 15)
    assert f"excites {2 * sinusoids} of 24 directions" in finding.text
    assert finding.verdict == ("refused" if sinusoids < 5 else "warning")


def test_records_excite_together():
    t = np.arange(3000) / 100.0
    parts = [np.sin(2 * np.pi * (1.0 + 2.3 * k) * t) for k in range(16)]
    assert check_excitation(parts, 2, 15).verdict == "ok"
    assert check_excitation([np.random.default_rng(1).standard_normal(3000)], 2, 15).verdict == "ok"
    assert "too few" in check_excitation([t[:60]], 2, 15).text


def test_the_scale_of_a_channel():
    trial = simulate(seed=1, duration=10.0)
    t = trial["time"].values
    above = trial.assign(torque=1e-5 * trial["torque"] + np.sin(2 * np.pi * 300.0 * t))
    tiny = trial.assign(position=1e-13 * trial["position"])
    assert scale_of(trial).verdict == "ok"
    assert "the torque has nothing below 38 Hz" in scale_of(above).text
    assert "the position has a standard deviation of" in scale_of(tiny).text


def test_dependent_movements_have_the_shortest_solution():
    """A sine shows K - I ω² and B alone."""
    t = np.arange(20_000) / 1000.0
    trial = new_trial(0.01 * np.sin(9.0 * t), np.sin(9.0 * t + 0.5), 1000.0)
    motion = products(trial)
    signals = motion.signals.T
    size = np.sqrt(np.sum(signals[:, :3] ** 2, axis=0))
    values = np.linalg.lstsq(signals[:, :3] / size, signals[:, 3], rcond=1e-6)[0] / size
    np.testing.assert_allclose(motion.stiffness, values, rtol=1e-4)
    assert motion.explained == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("noise", ["hum", "white", None])
@pytest.mark.parametrize("frequency", [20.0, 60.0])
def test_noise_of_the_position_is_told_from_a_fast_movement(noise, frequency):
    """And left out of the velocity that the reflex answers."""
    trial = simulate(seed=1, actuator_frequency=frequency)
    time = trial["time"].to_numpy()
    size = 3.0 if frequency > 20.0 else 1.0
    noises = {
        "hum": 1.5e-3 * np.sin(100 * np.pi * time),
        "white": 1.1e-3 * np.random.default_rng(1).standard_normal(time.size),
    }
    noisy = prepare(trial.assign(position=trial["position"] + size * noises.get(noise, 0.0)))
    finding = check_velocity(noisy)
    assert finding.verdict == "ok"
    assert ("which is left out of it" in finding.text) == (noise is not None)
    estimate = identify(noisy, "riv")
    assert estimate.trusted
    assert ("which is left out of it" in " ".join(estimate.remarks)) == (noise is not None)
    low, high = estimate.intervals["G"]
    assert low < 13.0 < high


def test_samples_that_were_left_out_without_a_filter_are_seen():
    trial = simulate(seed=1)
    channels = [trial[name].to_numpy() for name in ("position", "torque", "reference")]
    for thin, verdict in (
        (lambda x: x[::10], "warning"),
        (lambda x: signal.decimate(x, 10, ftype="fir"), "ok"),
    ):
        position, torque, reference = map(thin, channels)
        assert (
            check_bandwidth(prepare(new_trial(position, torque, 100.0, reference))).verdict
            == verdict
        )
