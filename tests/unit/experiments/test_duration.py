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
        plan_duration(pilot, {"K": size}).seconds - 0.66 for size in (width, factor * width)
    )
    assert narrow == pytest.approx(factor**2 * wide, rel=1e-9)


def test_the_parameter_that_takes_longest_decides(pilot):
    plan = plan_duration(pilot, {"K": 0.05, "B": 0.05, "G": 0.3})
    assert plan.parameter == "B"
    assert plan.seconds == plan.needed["B"] == max(plan.needed.values())
    assert plan.interval[0] < plan.seconds < plan.interval[1]


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
        trial = simulate(seed=seed, **{**JOINT, "duration": round(plan.seconds, 3)})
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
