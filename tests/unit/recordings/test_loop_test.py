"""The test for closed loop: right in nearly every trial, and not deceived by a servo that does not follow."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import DataError, new_trial, simulate
from ankleloop.joint.regressors import build_regressors
from ankleloop.recordings.loop_test import feedback_test

LOADS = {"assumed": (1.1, 7.1, 250.0), "light": (0.1, 10.0, 100.0), "stiff": (11.0, 71.0, 2500.0)}


def outcome(trial):
    r = build_regressors(trial, delay=0.04, basis="rectifier", identification_rate=100.0, reference="reference")
    return feedback_test(r.inputs[:, 0], r.torque, r.reference, r.rate)


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("closed", [True, False])
def test_loops_are_recognised(load, closed):
    found = [outcome(simulate(seed=seed, load=LOADS[load], closed_loop=closed)) for seed in range(8)]
    assert [f.loop for f in found] == ["closed" if closed else "open"] * 8
    if closed:
        assert max(f.p_value for f in found) < 1e-20
        assert min(f.work for f in found) > 0.1


def test_false_alarms_are_as_rare_as_they_say():
    """Independent coloured remainders: the p-value is uniform, so small ones come as often as they should."""
    rng = np.random.default_rng(1)
    p = []
    for _ in range(400):
        r = rng.standard_normal(3000)
        e, v = (sps.lfilter([1.0], [1.0, -0.95], rng.standard_normal(3000)) for _ in range(2))
        p.append(feedback_test(r + 0.1 * e, r + v, r, 100.0).p_value)
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.09
    assert 0.4 < np.mean(p) < 0.6


@pytest.mark.parametrize("seed", [1, 2])
def test_a_servo_that_does_not_follow_is_no_feedback(seed):
    """Here the torque follows an unexplained movement: coherent, but the work is done on the joint."""
    trial = simulate(seed=seed, closed_loop=False)
    low_pass = sps.butter(2, 8.0, fs=1000.0, output="sos")
    moved = 0.05 * sps.sosfiltfilt(low_pass, np.random.default_rng(seed).standard_normal(trial.sizes["time"]))
    velocity = np.gradient(moved, 1e-3)
    torque = 150.0 * moved + 0.8 * velocity + 0.015 * np.gradient(velocity, 1e-3)
    found = outcome(new_trial(trial["position"] + moved, trial["torque"] + torque, 1000.0, trial["reference"]))
    assert found.p_value < 1e-6
    assert found.work < 0
    assert found.loop == "open"


def test_a_short_record_is_refused():
    with pytest.raises(DataError, match="too short for a response"):
        outcome(simulate(seed=1, duration=3.0))
