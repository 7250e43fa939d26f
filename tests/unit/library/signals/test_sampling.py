"""Sampling rates of times."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import DataError
from ankleloop.signals.sampling import compute_rate, fit_clock


def first_fault(time, rate):
    """The first sample that is not finite, or not one step behind the one before, one by one."""
    for sample, value in enumerate(time):
        if not np.isfinite(value):
            return f"x: time is not finite at sample {sample}: repair it"
        step = value - time[sample - 1] if sample else 1.0 / rate
        if step <= 0 or abs(step * rate - 1.0) > 0.0101:
            return f"x: time is irregular at sample {sample} ("
    return None


_fault = st.tuples(
    st.integers(0, 39), st.sampled_from([np.nan, np.inf, -np.inf, 0.004, -0.004, 0.5, 1e307, 2e-5])
)


@settings(max_examples=100, deadline=None)
@given(
    size=st.integers(12, 40),
    faults=st.lists(_fault, max_size=2),
    gap=st.integers(12, 39),
    rate=st.sampled_from([100.0, 333.3, 1000.0]),
)
def test_the_first_fault_is_named(size, faults, gap, rate):
    time = np.arange(size) / rate
    time[gap:] += 0.05 * (gap % 2)
    for sample, value in faults:
        with np.errstate(invalid="ignore"):  # of two infinite faults
            time[sample % size] += value
    fault = first_fault(time.tolist(), rate)
    if fault is None:
        assert compute_rate(time, source="x") == pytest.approx(rate, rel=0.002)
    else:
        with pytest.raises(DataError) as error:
            compute_rate(time, source="x")
        assert str(error.value).startswith(fault)


def test_a_single_time_has_no_rate():
    with pytest.raises(DataError, match="x: t has 1 sample: a trial needs at least 2"):
        compute_rate(np.zeros(1), source="x", name="t")


@pytest.mark.parametrize("jitter", [0.05, 0.2, 0.45])
@pytest.mark.parametrize("missing", [0, 1, 10, -8000])
def test_a_shift_that_lasts_is_told_from_jitter(jitter, missing):
    rng = np.random.default_rng(3)
    for place in (2000, 9950, 17000):
        samples = np.arange(20000.0)
        samples[place:] += missing
        clock = fit_clock((samples + jitter * rng.standard_normal(samples.size)) / 500.0)
        if missing:
            assert clock.shift == pytest.approx(place, abs=300 if missing == 1 else 0)
        else:
            assert clock.shift is None
            assert clock.rate == pytest.approx(500.0, rel=1e-6)
            assert clock.jitter == pytest.approx(jitter, rel=0.02)


def test_samples_that_have_the_stamp_of_their_piece_jitter():
    stamps = np.repeat(np.arange(2500.0) * 8, 8) / 1000.0
    clock = fit_clock(stamps)
    assert (clock.rate, clock.shift) == (pytest.approx(1000.0, rel=1e-4), None)
    assert clock.jitter == pytest.approx(np.sqrt((8**2 - 1) / 12), rel=1e-3)


@pytest.mark.parametrize("times", [np.arange(40.0), np.zeros(100), np.r_[np.nan, np.arange(99.0)]])
def test_few_times_and_others_have_no_clock(times):
    assert fit_clock(times) is None
