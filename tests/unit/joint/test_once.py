import numpy as np

from ankleloop import evaluate, identify, simulate
from ankleloop.joint.once import made_once, once
from ankleloop.joint.regressors import build_regressors


def test_nothing_is_kept_outside():
    made = []
    for _ in range(2):
        once("trial", "key", lambda: made.append(1))
    with made_once():
        for _ in range(2):
            once("trial", "key", lambda: made.append(2))
    once("trial", "key", lambda: made.append(3))
    assert made == [1, 1, 2, 3]


def test_methods_that_share_give_what_they_give_alone():
    trials = [simulate(seed=seed, duration=12.0) for seed in (1, 2)]
    methods = ["pr-moesp", "eiv-moesp", "parallel-cascade", "riv", "real-time"]
    for trial in trials:
        alone = {name: identify(trial, name, **({"memory": 2.0} if name == "real-time" else {})) for name in methods}
        with made_once():
            for name, expected in alone.items():
                found = identify(trial, name, **({"memory": 2.0} if name == "real-time" else {}))
                assert found.torque.identical(expected.torque)
                assert found.stiffness == expected.stiffness
                assert evaluate(trial, found).equals(evaluate(trial, expected))


def test_a_trial_may_change_between_two_identifications():
    trial = simulate(seed=1, duration=8.0)
    options = {"delay": 0.04, "basis": "rectifier", "identification_rate": 100.0}
    before = build_regressors(trial, **options).torque
    trial["torque"] = 2.0 * trial["torque"]
    np.testing.assert_allclose(build_regressors(trial, **options).torque, 2.0 * before)
