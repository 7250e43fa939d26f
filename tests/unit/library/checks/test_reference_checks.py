"""Which references are no command of the servo: exchanged with the position, or made from the torque."""

import numpy as np
import pytest
from bad_inputs.data import lowpass

from ankleloop import identify, new_trial, simulate
from ankleloop.checks.reference import find_exchange, find_filtered_torque, find_reference_fault
from ankleloop.joint.prepared import prepare

SETTINGS = {
    "as the default": {},
    "without noise": {"snr_db": None, "voluntary": 0.0},
    "stiff load": {"load": (11.0, 71.0, 2500.0)},
    "compliant load": {"load": (0.11, 0.71, 25.0), "reflex_gain": 5.0},
    "light load": {"load": (0.1, 10.0, 100.0), "voluntary": 0.5},
    "open loop": {"closed_loop": False},
    "pulses": {"perturbation": "pulses", "switching_interval": 0.2},
}


@pytest.fixture(scope="module", params=SETTINGS)
def trial(request):
    return simulate(seed=8, duration=20.0, **SETTINGS[request.param])


def with_reference(trial, samples):
    return trial.assign(reference=trial["reference"].copy(data=samples))


def exchange(trial):
    return new_trial(trial["reference"], trial["torque"], 1000.0, reference=trial["position"])


def test_the_command_of_the_servo_is_no_fault(trial):
    assert find_reference_fault(prepare(trial), "reference") is None


def test_an_exchange_concerns_every_method(trial):
    for reference in ("reference", None):
        finding = find_reference_fault(prepare(exchange(trial)), reference)
        assert finding.text.startswith("the position is ahead of reference")


def test_a_copy_of_the_position_is_neither_early_nor_late(trial):
    for samples in (trial["position"].values, lowpass(trial["position"].values, 5)):
        assert find_reference_fault(prepare(with_reference(trial, samples)), "reference") is None


@pytest.mark.parametrize("factor", [5, 20, 50])
def test_a_filter_of_the_torque_concerns_methods_that_use_it(trial, factor):
    prepared = prepare(with_reference(trial, 1.0 - 0.01 * lowpass(trial["torque"].values, factor)))
    finding = find_reference_fault(prepared, "reference")
    assert finding.text.startswith("reference is a filter of the torque")
    assert find_reference_fault(prepared, None) is None


def test_the_lag_is_told_from_the_actuator_alone():
    """A pure delay of the position either way, without a joint or noise."""
    steps = np.repeat(np.random.default_rng(1).choice([-0.01, 0.01], 200), 100)
    command = lowpass(lowpass(steps, 25), 25)
    torque = np.random.default_rng(2).standard_normal(command.size)
    for delay, is_early in ((10, False), (0, False), (-10, True)):
        trial = prepare(new_trial(np.roll(command, delay), torque, 1000.0, reference=command))
        assert bool(find_exchange(trial, "reference", trial.grid(100.0, 0.04))) == is_early


@pytest.mark.parametrize("rate", [20.0, 50.0, 200.0, 500.0])
def test_the_rate_of_the_identification_does_not_matter(rate):
    trial = simulate(seed=8, duration=20.0, load=(0.11, 0.71, 25.0), reflex_gain=5.0)
    kinds = {}
    for name, data in (("good", trial), ("exchanged", exchange(trial))):
        warnings = identify(data, "parallel-cascade", identification_rate=rate).diagnostics[
            "warnings"
        ]
        kinds[name] = any("ahead of reference" in text for text in warnings)
    assert kinds == {"good": False, "exchanged": True}


def test_a_load_far_more_compliant_than_the_joint_is_no_filter():
    """There the torque is nearly the command times the impedance of the load: what is left of it is the position."""
    settings = {
        "load": (0.0321, 2.19, 31.4),
        "stiffness": 224.0,
        "reflex_gain": 1.8,
        "snr_db": 20.0,
        "voluntary": 0.006,
    }
    prepared = prepare(simulate(seed=8, duration=40.0, **settings))
    assert find_filtered_torque(prepared, "reference", prepared.grid(100.0, 0.04)) is None


def test_very_short_trials_say_nothing():
    trial = simulate(seed=8, duration=1.0)
    for samples in (100, 1000):
        assert (
            find_reference_fault(prepare(trial.isel(time=slice(0, samples))), "reference") is None
        )
