"""A method is an object: what is called with a name can be called with it, and nothing changes what it gives."""

import pickle
import re

import numpy as np
import pytest

from ankleloop import METHODS, DataError, block_bootstrap, identify, new_trial, simulate
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.regressors import torque_dataset
from ankleloop.methods.method import KnownDelayOptions, Method
from ankleloop.methods.registry import JOINT_METHODS, find_method, method_options
from ankleloop.methods.selection import select_options
from ankleloop_lab.recordings.analysis import analyse
from ankleloop_lab.recordings.recommendation import recommend
from ankleloop_lab.recordings.validity import (
    describe_validity,
    reason_against,
    usual_methods,
    valid_methods,
)


def identify_stiffness(trial, options):
    regressors = trial.regressors(
        delay=options.delay, basis="rectifier", identification_rate=options.identification_rate
    )
    inputs = regressors.inputs - regressors.inputs.mean(axis=0)
    parameters = np.linalg.lstsq(inputs, regressors.torque, rcond=None)[0]
    torques = {"intrinsic": inputs[:, :3] @ parameters[:3], "reflex": inputs[:, 3] * parameters[3]}
    return Estimate(
        method="stiffness",
        torque=torque_dataset(
            regressors.time, regressors.rate, net=sum(torques.values()), **torques
        ),
        stiffness=dict(zip(("K", "B", "I"), map(float, parameters), strict=False)),
        reflex={"delay": options.delay, "own": 1.0},
    )


METHOD = Method("stiffness", KnownDelayOptions, identify_stiffness)


@pytest.fixture(scope="module")
def open_loop():
    return simulate(seed=1, duration=30.0, closed_loop=False)


@pytest.mark.parametrize(("recording_rate", "rate"), [(256.0, 256 / 3), (1024.0, 102.4)])
def test_rates_that_100_hz_does_not_divide(open_loop, recording_rate, rate):
    time = np.arange(29.0 * recording_rate) / recording_rate
    channels = open_loop[["position", "torque"]].interp(time=time, method="cubic")
    trial = new_trial(channels.position, channels.torque, recording_rate, channels.position)
    for method in ("riv", METHOD):
        estimate = identify(trial, method)
        assert estimate.torque.attrs["identification_rate"] == pytest.approx(rate)
        assert estimate.stiffness["K"] == pytest.approx(
            identify(open_loop, method).stiffness["K"], rel=0.05
        )
    with pytest.raises(DataError, match="not a whole multiple") as refusal:
        identify(trial, "riv", identification_rate=100.0)
    advised = float(re.search("for example (.*) Hz", str(refusal.value))[1])
    advised_estimate = identify(trial, "riv", identification_rate=advised)
    assert advised_estimate.stiffness["K"] == pytest.approx(150, rel=0.1)


def test_a_method_is_taken_where_its_name_is(open_loop):
    assert find_method(METHODS["riv"]) is METHODS["riv"]
    assert identify(open_loop, METHODS["pr-moesp"]) == identify(open_loop, "pr-moesp")
    assert method_options(METHOD) == {"identification_rate": 100.0, "delay": 0.04}
    estimate = identify(open_loop, METHOD, delay=0.05)
    assert estimate.reflex["delay"] == 0.05
    assert estimate.stiffness["K"] == pytest.approx(150, rel=0.5)
    assert estimate.diagnostics["assumptions"][-1] == "the reflex delay is 50 ms."
    bootstrap = block_bootstrap(open_loop, METHOD, repetitions=2)
    assert list(bootstrap.samples["own"]) == [1.0, 1.0]
    with pytest.raises(TypeError, match="method 'stiffness' has no option 'order'"):
        identify(open_loop, METHOD, order=2)
    with pytest.raises(Exception, match="stiffness has no fixed model to predict with"):
        select_options(open_loop, METHOD, {"delay": [0.04, 0.05]})


def test_a_method_of_unknown_validity_is_analysed_in_open_loop_only(open_loop):
    """It is no KeyError in the middle of a job, and comes last where the data cannot tell methods apart."""
    state = (True, 0.0)
    assert reason_against(METHOD, {}, "open", *state) is None
    assert (
        reason_against(METHOD, {}, "closed", *state)
        == "it is not known to be valid in closed loop, and the loop is closed"
    )
    assert "stiffness" not in describe_validity(valid_methods("open", *state), "open", *state)
    pulses = simulate(
        seed=1, duration=40.0, closed_loop=False, perturbation="pulses", switching_interval=0.2
    )
    analysis = analyse(pulses, {"own": {"method": METHOD}, "riv": {"method": "riv"}})
    assert analysis.check.loop == "open"
    assert list(analysis.table["method"]) == ["stiffness", "riv"]
    assert analysis.table["valid"].all()
    assert recommend(analysis).label == "riv"
    closed = analyse(simulate(seed=1, duration=60.0), {"own": {"method": METHOD}})
    assert closed.table["warnings"].item().startswith("it is not known to be valid in closed loop")


@pytest.mark.parametrize("reference", [True, False])
def test_usual_methods_are_those_that_are_offered_with_options_that_they_have(reference):
    methods = usual_methods(reference=reference, changing=True)
    assert list(methods) == [name for name, method in JOINT_METHODS.items() if method.offer]
    for name, method in methods.items():
        METHODS[name].options.parse(name, **method["options"])
        assert not method["options"].keys() & method["select"].keys()
        assert ("position as reference" in method["label"]) == ("reference" in method["options"])
    assert "riv-tv" not in usual_methods(reference=reference)
    assert list(usual_methods(reference=reference, names=["riv-tv"])) == ["riv-tv"]


@pytest.mark.parametrize("name", METHODS)
def test_another_process_can_be_given_a_method(name):
    """As `identify_each` does with several jobs."""
    copy = pickle.loads(pickle.dumps(METHODS[name]))
    options = METHODS[name].options()
    assert copy.reference(options) == METHODS[name].reference(options)
