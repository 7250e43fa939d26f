"""Envelopes hold every peak of a signal."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ankleloop.plotting.envelopes import envelope

SIGNALS = arrays(np.float32, st.integers(1, 200), elements=st.floats(-1e3, 1e3, width=32))


@given(values=SIGNALS, width=st.integers(1, 50))
def test_no_peak_is_lost_and_none_is_added(values, width):
    low, high = envelope(values, width)
    assert low.size == high.size == -(-values.size // width)
    for number in range(low.size):
        inside = values[number * width : (number + 1) * width + 1]
        assert low[number] == inside.min()
        assert high[number] == inside.max()
    assert high.max() == values.max()
    assert low.min() == values.min()


@given(values=SIGNALS, width=st.integers(1, 20))
def test_neighbours_touch_each_other(values, width):
    low, high = envelope(values, width)
    assert (np.maximum(low[:-1], low[1:]) <= np.minimum(high[:-1], high[1:])).all()


def test_no_samples_have_no_bins():
    low, high = envelope(np.zeros(0), 5)
    assert low.size == high.size == 0


def test_a_bin_has_a_sample_at_least():
    with pytest.raises(ValueError, match="width"):
        envelope(np.zeros(10), 0)
