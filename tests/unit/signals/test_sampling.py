"""Sampling rates of times that are read in parts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import DataError
from ankleloop.signals.sampling import compute_rate, compute_rate_of_parts


def outcome(compute):
    try:
        return compute()
    except DataError as error:
        return str(error)


def in_parts(time, cuts):
    ends = float(time[0]), float(time[-1])
    return outcome(lambda: compute_rate_of_parts(lambda: np.split(time, cuts), time.size, ends, source="x"))


_fault = st.tuples(st.integers(0, 39), st.sampled_from([np.nan, np.inf, -np.inf, 0.004, -0.004, 0.5, 1e308, 2e-5]))


@settings(max_examples=200, deadline=None)
@given(
    size=st.integers(2, 40),
    faults=st.lists(_fault, max_size=3),
    gap=st.integers(0, 39),
    cuts=st.lists(st.integers(0, 40), max_size=4),
    rate=st.sampled_from([100.0, 333.3, 1000.0]),
)
def test_parts_have_the_rate_and_the_faults_of_the_whole(size, faults, gap, cuts, rate):
    time = np.arange(size) / rate
    time[gap:] += 0.05 * (gap % 2)
    with np.errstate(all="ignore"):
        for sample, value in faults:
            time[sample % size] += value
        assert in_parts(time, sorted(cuts)) == outcome(lambda: compute_rate(time, source="x"))


def test_all_parts_are_read_once_where_the_times_are_regular():
    passes = []

    def parts():
        passes.append(1)
        yield from np.array_split(np.arange(1000) / 100.0, 3)

    assert compute_rate_of_parts(parts, 1000, (0.0, 9.99), source="x") == pytest.approx(100.0)
    assert len(passes) == 1
