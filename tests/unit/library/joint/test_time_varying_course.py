"""Onsets of cycles and scheduling variables: what is refused, and with which words."""

import numpy as np
import pytest

from ankleloop import DataError, new_trial
from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import Grid, decimation_grid
from ankleloop.joint.time_varying_course import find_onsets, make_course

RATE = 100.0
TIME = np.arange(6000) / RATE
ONSETS = 0.3 + 1.4 * np.arange(43)
RNG = np.random.default_rng(1)


@pytest.fixture(scope="module")
def trial():
    phase = np.mod((TIME - ONSETS[0]) / 1.4, 1.0)
    signals = np.cumsum(RNG.standard_normal((2, TIME.size)), axis=1) * 1e-3
    return prepare(
        new_trial(*signals, RATE, phase=phase, still=np.ones(TIME.size), percent=100.0 * phase)
    )


def change(onsets, number, value):
    onsets = onsets.copy()
    onsets[number] = value
    return onsets


def test_onsets_from_a_phase_are_those_of_the_cycles(trial):
    onsets = find_onsets(trial, "phase")
    np.testing.assert_allclose(onsets, ONSETS[: onsets.size], atol=1e-6)
    np.testing.assert_array_equal(find_onsets(trial, ONSETS.tolist()), ONSETS)


@pytest.mark.parametrize(
    ("onsets", "message"),
    [
        (change(ONSETS, 5, np.nan), "onset 6 of 43 .nan s. is not after the one before"),
        (np.sort(np.append(ONSETS, ONSETS[3])), "leave out those that are there twice"),
        (
            np.delete(ONSETS, 10),
            r"the cycle that begins at 12.9 s lasts 2.8 s, .* 1.4 s: is an onset missing there",
        ),
        (
            np.sort(np.append(ONSETS, ONSETS[3] + 0.05)),
            r"begins at 4.5 s lasts 0.05 s, .* or one too many",
        ),
        (
            ONSETS + 100.0,
            "go from 100.3 to 159.1 s, the record from 0 to 59.99 s: give them in seconds",
        ),
        (ONSETS[:1], "fewer than two onsets"),
        ("percent", "goes from 0 to 100, and the phase of a cycle goes from 0 to 1"),
    ],
)
def test_wrong_onsets_are_refused_with_what_to_do(trial, onsets, message):
    with pytest.raises(DataError, match=message):
        find_onsets(trial, onsets)


@pytest.mark.parametrize(
    ("onsets", "schedule", "message"),
    [
        (None, "emg", "no variable 'emg' for schedule; it has .* Name one of these"),
        (None, "still", "still does not vary between its 2nd and 98th percentile"),
    ],
)
def test_records_without_a_course_are_refused(trial, onsets, schedule, message):
    grid = decimation_grid(TIME.size, RATE, 50.0, 0.04)
    with pytest.raises(DataError, match=message):
        make_course([trial], [grid], onsets, schedule)


@pytest.mark.parametrize(
    ("share", "refused"), [(1.0, True), (0.8, True), (0.3, False), (0.0, False)]
)
def test_a_schedule_that_holds_the_perturbation_is_refused(share, refused):
    """The measured angle holds it; its slow part, or another variable, does not, however far the joint moves."""
    slow, fast, other = np.sin(0.4 * np.pi * TIME), *(0.02 * RNG.standard_normal((2, TIME.size)))
    schedule = slow + np.sqrt(share) * fast + np.sqrt(1.0 - share) * other
    trial = prepare(
        new_trial(slow + fast, RNG.standard_normal(TIME.size), RATE, angle=schedule, slow=slow)
    )
    grid = decimation_grid(TIME.size, RATE, 50.0, 0.04)
    assert make_course([trial], [grid], None, "slow").dimension == "schedule"
    if refused:
        with pytest.raises(
            DataError, match=r"angle follows the perturbation: .* Give its slow part"
        ):
            make_course([trial], [grid], None, "angle")
    else:
        assert make_course([trial], [grid], None, "angle").dimension == "schedule"


def test_a_record_without_cycles_may_be_as_short_as_the_refusal_says(trial):
    assert make_course([trial], [Grid(1, 0, 950)], None, None).segments == 8
    with pytest.raises(
        DataError, match=r"the record is too short: riv-tv without cycles needs 9.5 s"
    ):
        make_course([trial], [Grid(1, 0, 949)], None, None)
