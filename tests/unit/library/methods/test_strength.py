"""Whether a reference carries an estimate: the instruments decide, not the share of the torque that is explained."""

import numpy as np
import pytest

from ankleloop import DataError, check_trial, identify, simulate
from ankleloop.joint.prepared import prepare
from ankleloop.methods.riv.riv import RivOptions, find_solution
from ankleloop.methods.riv.strength import WEAK, measure_strengths

LIGHT = {"load": (0.1, 10.0, 100.0), "stiffness": 100.0, "reflex_gain": 8.0}
LOUD = {**LIGHT, "voluntary": 1.6, "voluntary_cutoff": 1.0}


def strength_of(trial):
    solution, _ = find_solution([prepare(trial)], RivOptions().at_rate(1000.0))
    return measure_strengths(solution.point)["K"]


@pytest.mark.parametrize("seed", range(4))
def test_a_subject_who_pushes_is_identified(seed):
    """Voluntary torque cancels K in the relation of torque and movement, and nothing in that to the reference."""
    trial = simulate(seed=seed, duration=40.0, **LOUD)
    assert check_trial(trial).verdict == "ok"
    estimate = identify(trial)
    assert estimate.warnings == []
    low, high = estimate.intervals["K"]
    assert low < 100.0 < high
    assert high - low < 15.0


def test_the_strength_of_an_unrelated_reference_is_that_of_chance():
    """Whatever the length of the record; where the instruments explain the movement it grows with the length."""
    for duration in (20.0, 60.0):
        trial = simulate(seed=1, duration=duration)
        other = simulate(seed=2, duration=duration)["reference"].to_numpy()
        assert strength_of(trial.assign(reference=("time", other))) < 2.0
    strengths = [strength_of(simulate(seed=1, duration=t, **LOUD)) for t in (20.0, 80.0)]
    assert 2.0 < strengths[1] / strengths[0] < 8.0


def test_weak_instruments_are_refused_by_one_rule():
    trial = simulate(seed=3, duration=20.0, voluntary=8.0, voluntary_cutoff=5.0)
    assert strength_of(trial) < WEAK
    with pytest.raises(DataError, match="too weak an instrument"):
        identify(trial)
    (finding,) = [each for each in check_trial(trial).findings if each.name == "reference"]
    assert "too weak an instrument" in finding.text


def test_a_torque_that_does_not_answer_the_reference_is_refused():
    trial = simulate(seed=1, duration=30.0)
    torque = simulate(seed=2, duration=30.0)["torque"].to_numpy()
    with pytest.raises(DataError, match="say nothing about the joint"):
        identify(trial.assign(torque=("time", torque)))


@pytest.mark.parametrize("seed", range(3))
def test_a_rotor_without_spring_has_no_sign_to_turn(seed):
    trial = simulate(seed=seed, duration=40.0, stiffness=0.0, reflex_gain=0.0)
    (finding,) = [f for f in check_trial(trial).findings if f.name == "sign of the torque"]
    assert finding.verdict == "ok"
    estimate = identify(trial)
    low, high = estimate.intervals["K"]
    assert low < 0.0 < high
    assert np.isfinite(estimate.stiffness["K"])
    assert high - low < 10.0


TIME = np.arange(40_000) / 1000.0
LOADS = ((1.1, 7.1, 250.0), (0.1, 10.0, 100.0))


@pytest.mark.parametrize("seed", range(4))
def test_what_a_triangle_does_not_show_is_missing(seed):
    """Voluntary torque excites the joint persistently, and the command does not."""
    triangle = 0.04 * np.abs(2.0 * (0.5 * TIME % 1.0) - 1.0)
    trial = simulate(seed=seed, command=triangle, load=LOADS[seed % 2], voluntary=0.5)
    estimate = identify(trial)
    assert "K" in estimate.intervals
    assert "I" not in estimate.values
    (text,) = (text for text in estimate.diagnostics["missing"] if "99 %" in text)
    assert float(text.split("the movement that reference makes lie below ")[1].split()[0]) < 2.0
    for name, truth in {"K": 150.0, "B": 0.8, "G": 13.0}.items():
        if name in estimate.values:
            low, high = estimate.intervals[name]
            assert low < truth < high or abs(estimate[name] / truth - 1.0) < 0.15
    (finding,) = [each for each in check_trial(trial).findings if each.name == "excitation"]
    assert finding.verdict == "warning"
    assert "cannot be shown: 99 % of the movement" in finding.text


@pytest.mark.parametrize("seed", range(4))
def test_a_sine_cannot_tell_stiffness_from_inertia(seed):
    sine = 0.02 * np.sin(2.0 * np.pi * TIME)
    trial = simulate(seed=seed, command=sine, load=LOADS[seed % 2], voluntary=0.3)
    with pytest.raises(
        DataError, match=r"99 % of the movement that reference makes lie below 1\.\d* Hz"
    ):
        identify(trial)


def test_a_random_command_shows_all_parameters():
    for seed in range(4):
        trial = simulate(
            seed=seed, duration=20.0, load=LOADS[seed % 2], reflex_gain=13.0 * (seed > 1)
        )
        solution, _ = find_solution([prepare(trial)], RivOptions().at_rate(1000.0))
        assert min(measure_strengths(solution.point).values()) > 2.0 * WEAK
