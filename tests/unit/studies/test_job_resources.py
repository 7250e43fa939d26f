"""Time that jobs ask for, against what their chunks hold."""

import pytest

from ankleloop import METHODS
from ankleloop.studies import resources
from ankleloop.studies.study import read_studies


def make_study(**changes):
    study = {
        "kind": "simulation",
        "notebook": None,
        "trials": 40,
        "seed": 1,
        "trials_per_chunk": 1000,
        "simulation": {"duration": 20.0},
        "points": {"reflex_gain": [13.0]},
        "methods": {"pr-moesp": {"method": "pr-moesp"}, "riv": {"method": "riv"}},
    }
    _, studies = read_studies({"run": ["study"], "studies": {"study": study | changes}})
    return studies["study"]


def simulation_time(**changes):
    study = make_study(**changes)
    return study.simulation_seconds(study.trial_chunks[0])


def identification_time(**changes):
    study = make_study(**changes)
    return study.identification_seconds(study.chunks[0])


@pytest.mark.parametrize("time", [simulation_time, identification_time])
def test_time_beyond_the_start_is_proportional_to_the_trials(time):
    few, many = (time(trials=trials) - resources.START_SECONDS for trials in (40, 400))
    assert many == pytest.approx(10 * few)


def test_a_method_that_was_not_measured_counts_as_the_slowest():
    times = {name: resources.identification_seconds(50_000, [{"method": name}]) for name in [*METHODS, "a new one"]}
    assert times["a new one"] == max(times.values())


def test_a_sweep_takes_the_time_of_both_jobs_with_one_start():
    both = simulation_time() + identification_time() - resources.START_SECONDS
    assert identification_time(keep="scores") == pytest.approx(both)
