"""Properties of public functions that hold for every input: whatever is true of one record is true of its parts."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import (
    check_trial,
    identify,
    method_options,
    new_trial,
    segment,
    simulate,
)
from ankleloop.methods.registry import JOINT_METHODS

RATE = 500.0
SAMPLES = 400

few = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def draw_signals(seed, channels=3, samples=SAMPLES):
    """Signals of a slow random walk, which no check refuses."""
    return (
        np.cumsum(np.random.default_rng(seed).standard_normal((channels, samples)), axis=1) * 1e-3
    )


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=1, duration=15.0)


# --- new_trial and segment


@few
@given(
    seeds,
    st.sampled_from(["f8", "f4", "i2"]),
    st.sampled_from(["list", "row", "column", "masked", "series"]),
)
def test_a_trial_has_the_numbers_of_its_arrays_whatever_holds_them(seed, kind, holder):
    position, torque, reference = draw_signals(seed)
    # Counts of a converter; a position of a radian from one sample to the next would be refused.
    torque, reference = (1e5 * torque).astype(kind), (1e5 * reference).astype(kind)
    holders = {
        "list": np.ndarray.tolist,
        "row": lambda x: x[None],
        "column": lambda x: x[:, None],
        "masked": np.ma.masked_array,
        "series": pd.Series,
    }
    hold = holders[holder]
    trial = new_trial(hold(position), hold(torque), RATE, hold(reference))
    for name, signal in (("position", position), ("torque", torque), ("reference", reference)):
        assert trial[name].dtype == np.float64
        np.testing.assert_array_equal(trial[name], signal.astype(float))


@few
@given(seeds)
def test_a_trial_does_not_change_with_the_arrays_that_it_was_made_of(seed):
    position, torque, reference = draw_signals(seed)
    trial = new_trial(position, torque, RATE, reference)
    copy = trial.copy(deep=True)
    for signal in (position, torque, reference):
        signal += 1.0
    assert trial.identical(copy)


@few
@given(seeds, st.tuples(*[st.integers(0, SAMPLES)] * 3).map(sorted))
def test_segments_side_by_side_are_the_segment_of_both(seed, edges):
    first, middle, last = (edge + 5 * k for k, edge in enumerate(edges))
    position, torque = draw_signals(seed, 2, SAMPLES + 10)
    trial = new_trial(position, torque, RATE)
    whole = segment(trial, first / RATE, last / RATE)
    parts = [
        segment(trial, *(edge / RATE for edge in ends))
        for ends in ((first, middle), (middle, last))
    ]
    assert xr.concat(parts, dim="time").equals(whole)
    assert segment(whole, middle / RATE, 1e9).equals(parts[1])


# --- files


# --- identification and scores


@pytest.mark.parametrize("method", JOINT_METHODS)
def test_an_identification_changes_nothing_and_options_have_their_defaults(trial, method):
    copy = trial.copy(deep=True)
    first, second = (identify(trial, method, **options) for options in ({}, method_options(method)))
    assert trial.identical(copy)
    assert first.torque.identical(second.torque)
    assert (first.stiffness, first.reflex) == (second.stiffness, second.reflex)


def test_the_order_of_merged_trials_does_not_change_the_verdict():
    trials = [simulate(seed=seed, duration=10.0) for seed in (1, 2, 3)]
    check, expected = check_trial(trials[::-1]), check_trial(trials)
    assert (check.verdict, check.loop, check.methods) == (
        expected.verdict,
        expected.loop,
        expected.methods,
    )
