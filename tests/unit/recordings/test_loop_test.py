"""The test for closed loop: correct in nearly every trial, also with a servo that does not follow its command."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import DataError, new_trial, simulate
from ankleloop.joint.prepared import prepare
from ankleloop.recordings.loop_test import feedback_test

LOADS = {"assumed": (1.1, 7.1, 250.0), "light": (0.1, 10.0, 100.0), "stiff": (11.0, 71.0, 2500.0)}


def run_feedback_test(trial):
    r = prepare(trial).regressors(delay=0.04, basis="rectifier", identification_rate=100.0, reference="reference")
    return feedback_test(r.inputs[:, 0], r.torque, r.reference, r.rate)


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("closed", [True, False])
def test_loops_are_recognised(load, closed):
    tests = [run_feedback_test(simulate(seed=seed, load=LOADS[load], closed_loop=closed)) for seed in range(8)]
    assert [test.loop for test in tests] == ["closed" if closed else "open"] * 8
    if closed:
        assert max(test.p_value for test in tests) < 1e-20
        assert min(test.work for test in tests) > 0.1


def test_frequency_of_false_alarms():
    """Independent coloured residuals: the p-value is uniform."""
    rng = np.random.default_rng(1)
    p = []
    for _ in range(400):
        r = rng.standard_normal(3000)
        e, v = (sps.lfilter([1.0], [1.0, -0.95], rng.standard_normal(3000)) for _ in range(2))
        p.append(feedback_test(r + 0.1 * e, r + v, r, 100.0).p_value)
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.09
    assert 0.4 < np.mean(p) < 0.6


@pytest.mark.parametrize("seed", [1, 2])
def test_a_servo_that_does_not_follow_is_not_feedback(seed):
    """The torque follows a movement that the reference does not explain, but the servo does work on the joint."""
    trial = simulate(seed=seed, closed_loop=False)
    low_pass = sps.butter(2, 8.0, fs=1000.0, output="sos")
    movement = 0.05 * sps.sosfiltfilt(low_pass, np.random.default_rng(seed).standard_normal(trial.sizes["time"]))
    velocity = np.gradient(movement, 1e-3)
    torque = 150.0 * movement + 0.8 * velocity + 0.015 * np.gradient(velocity, 1e-3)
    test = run_feedback_test(
        new_trial(trial["position"] + movement, trial["torque"] + torque, 1000.0, trial["reference"])
    )
    assert test.p_value < 1e-6
    assert test.work < 0
    assert test.loop == "open"


def test_a_short_record_is_refused():
    with pytest.raises(DataError, match="too short for a response"):
        run_feedback_test(simulate(seed=1, duration=3.0))
