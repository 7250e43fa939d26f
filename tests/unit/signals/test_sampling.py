"""Sampling rates of times that are read in parts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import DataError
from ankleloop.signals.sampling import compute_rate_of_parts


def outcome(compute):
    try:
        return compute()
    except DataError as error:
        return str(error)


_fault = st.tuples(
    st.integers(0, 39), st.sampled_from([np.nan, np.inf, -np.inf, 0.004, -0.004, 0.5, 1e307, 2e-5])
)


@settings(max_examples=100, deadline=None)
@given(
    size=st.integers(12, 40),
    faults=st.lists(_fault, max_size=2),
    gap=st.integers(12, 39),
    cuts=st.lists(st.integers(10, 39), max_size=3, unique=True),
    rate=st.sampled_from([100.0, 333.3, 1000.0]),
)
def test_parts_have_the_rate_and_the_faults_of_the_whole(size, faults, gap, cuts, rate):
    time = np.arange(size) / rate
    time[gap:] += 0.05 * (gap % 2)
    for sample, value in faults:
        with np.errstate(invalid="ignore"):  # of two infinite faults
            time[sample % size] += value
    parts = [part for part in np.split(time, sorted(cuts)) if part.size]
    in_parts = outcome(lambda: compute_rate_of_parts(parts, size, source="x"))
    assert in_parts == outcome(lambda: compute_rate_of_parts([time], time.size, source="x"))


def test_a_single_time_has_no_rate():
    with pytest.raises(DataError, match="x: t has 1 sample: a trial needs at least 2"):
        compute_rate_of_parts([np.zeros(1)], 1, source="x", name="t")


def test_two_times_have_a_rate():
    assert compute_rate_of_parts([np.array([0.0, 0.01])], 2, source="x") == 100.0
