"""Memory and time that jobs ask for, against what their chunks hold."""

import pytest

from ankleloop import METHODS
from ankleloop.studies import resources
from ankleloop.studies.job_resources import JobResources, describe_chunk, describe_tables
from ankleloop.studies.study import read_studies


def make_study(**changes):
    study = {
        "kind": "simulation",
        "notebook": None,
        "trials": 40,
        "seed": 1,
        "points_per_chunk": 1,
        "simulation": {"duration": 20.0},
        "points": {"reflex_gain": [13.0]},
        "methods": {"pr-moesp": {"method": "pr-moesp"}, "riv": {"method": "riv"}},
    }
    _, studies = read_studies({"run": ["study"], "studies": {"study": study | changes}})
    return studies["study"]


@pytest.mark.parametrize("rule", ["simulate", "identify", "sweep"])
def test_time_beyond_the_start_is_proportional_to_the_trials(rule):
    keep = "scores" if rule == "sweep" else "everything"
    few, many = (describe_chunk(make_study(trials=trials, keep=keep), rule, 0).seconds for trials in (40, 400))
    assert many - resources.START_SECONDS == pytest.approx(10 * (few - resources.START_SECONDS))


def test_a_method_that_was_not_measured_counts_as_the_slowest():
    times = {
        name: resources.identification_seconds(50_000, {"m": {"method": name}}) for name in [*METHODS, "a new one"]
    }
    assert times["a new one"] == max(times.values())


def test_a_sweep_takes_the_time_of_both_jobs_with_one_start():
    everything, scores = make_study(), make_study(keep="scores")
    parts = [describe_chunk(everything, rule, 0).seconds for rule in ("simulate", "identify")]
    assert describe_chunk(scores, "sweep", 0).seconds == pytest.approx(sum(parts) - resources.START_SECONDS)


def test_without_files_memory_does_not_grow_with_the_trials():
    few, many = (describe_chunk(make_study(trials=trials, keep="scores"), "sweep", 0) for trials in (25, 25_000))
    assert few.memory == many.memory


@pytest.mark.parametrize(
    "changes",
    [
        {"simulation": {"duration": 60.0}},
        {"simulation": {"duration": 20.0, "recording_rate": 2000.0}},
        {"methods": {name: {"method": name} for name in METHODS}},
        {"points": {"reflex_gain": [13.0, 2.0]}, "points_per_chunk": 2},
        {"points": {"reflex_gain": [13.0], "pr-moesp.block_rows": [15, 20]}},
        {"points": {"reflex_gain": [13.0], "pr-moesp.block_rows": [30]}},
    ],
)
def test_more_in_a_chunk_takes_more_time(changes):
    assert (
        describe_chunk(make_study(**changes), "identify", 0).seconds
        > describe_chunk(make_study(), "identify", 0).seconds
    )


def test_tables_take_memory_and_time_with_their_rows():
    small, large = (describe_tables([make_study(trials=trials)]) for trials in (10, 100_000))
    assert large.memory > small.memory
    assert large.seconds > small.seconds


def test_each_attempt_asks_for_twice_as_much():
    job = JobResources(memory=400.0, seconds=120.0)
    assert job.mem_mb(1) > 400
    assert job.runtime(1) > 2
    assert [job.mem_mb(attempt) for attempt in (2, 3)] == [2 * job.mem_mb(1), 4 * job.mem_mb(1)]
    assert [job.runtime(attempt) for attempt in (2, 3)] == [2 * job.runtime(1), 4 * job.runtime(1)]
