"""Planned durations: against the errors of records of that length, and how they scale."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ankleloop import DataError, identify, plan_duration, simulate

JOINT = {"load": (0.1, 10.0, 100.0), "voluntary": 0.3, "duration": 24.0}


@pytest.fixture(scope="module")
def pilot():
    return identify(simulate(seed=1, **{**JOINT, "duration": 15.0}), "riv", delay=0.04)


@given(width=st.floats(0.02, 1.0), factor=st.floats(1.0, 3.0))
def test_the_time_falls_with_the_square_of_the_width(pilot, width, factor):
    narrow, wide = (
        plan_duration(pilot, {"K": size}).needed["K"] - 0.66 for size in (width, factor * width)
    )
    assert narrow == pytest.approx(factor**2 * wide, rel=1e-9)


def test_the_parameter_that_takes_longest_decides(pilot):
    plan = plan_duration(pilot, {"K": 0.05, "B": 0.05, "G": 0.3})
    assert plan.parameter == "B"
    assert plan.needed["B"] == max(plan.needed.values())
    assert plan.seconds == np.ceil(plan.needed["B"])
    assert plan.interval[0] < plan.seconds < plan.interval[1]


@given(width=st.floats(0.02, 10.0))
def test_a_plan_is_a_length_that_can_be_recorded(pilot, width):
    """In whole seconds, which every sampling rate divides, and no shorter than checks ask for."""
    plan = plan_duration(pilot, {"K": width})
    assert plan.seconds == max(10.0, np.ceil(plan.needed["K"]))
    assert 10.0 <= plan.interval[0] <= plan.seconds <= plan.interval[1]


def test_plans_of_many_pilots_scatter_as_their_intervals_say():
    """Under two loads, over K, B and G: the interval of a plan holds the time that pilots give on average."""
    widths = {"K": 0.01, "B": 0.05, "G": 0.03}
    spreads, covered = [], []
    for load in ((0.1, 10.0, 100.0), (1.1, 7.1, 250.0)):
        trials = [
            simulate(seed=seed, load=load, voluntary=0.3, duration=15.0) for seed in range(25)
        ]
        pilots = [identify(trial, "riv", delay=0.04) for trial in trials]
        for name, width in widths.items():
            plans = [plan_duration(pilot, {name: width}) for pilot in pilots]
            times = np.log([plan.needed[name] - 0.66 for plan in plans])
            spreads.append(times.std(ddof=1))
            centre = np.exp(times.mean()) + 0.66
            covered += [plan.interval[0] <= centre <= plan.interval[1] for plan in plans]
    assert np.sqrt(np.mean(np.square(spreads)) * (15.0 - 0.66)) == pytest.approx(0.7, rel=0.15)
    assert 0.92 <= np.mean(covered) < 0.99


def test_a_record_of_the_planned_length_has_intervals_of_the_width(pilot):
    plans = [
        plan_duration(
            identify(simulate(seed=seed, **{**JOINT, "duration": 15.0}), "riv", delay=0.04),
            {"K": 0.06},
        )
        for seed in range(10)
    ]
    widths = []
    for seed, plan in enumerate(plans, 100):
        trial = simulate(seed=seed, **{**JOINT, "duration": plan.seconds})
        estimate = identify(trial, "riv", delay=0.04)
        widths.append(np.diff(estimate.intervals["K"])[0] / (2 * estimate.stiffness["K"]))
    assert np.median(widths) == pytest.approx(0.06, rel=0.15)
    from_settings = plan_duration(JOINT, {"K": 0.06})
    assert np.median([plan.seconds for plan in plans]) == pytest.approx(
        from_settings.seconds, rel=0.25
    )


def test_a_width_that_no_record_reaches(pilot):
    with pytest.raises(DataError, match=r"ask for (.*) % or more") as caught:
        plan_duration(pilot, {"K": 0.001})
    reached = float(str(caught.value).split("ask for ")[1].split(" %")[0])
    assert plan_duration(pilot, {"K": 1.1 * reached / 100}).seconds < 3600
