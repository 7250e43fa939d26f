import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ankleloop import DataError, vaf
from ankleloop.signals.vaf import vaf_with_interval

numbers = st.floats(-1e3, 1e3).map(lambda x: round(x, 6))
signals = hnp.arrays(float, st.integers(2, 40), elements=numbers).filter(lambda x: np.std(x) > 1e-3)


@given(st.data(), numbers, numbers)
def test_offsets_do_not_change_the_vaf(data, measured_offset, estimated_offset):
    measured = data.draw(signals)
    estimated = data.draw(hnp.arrays(float, measured.size, elements=numbers))
    expected = vaf(measured, estimated)
    # Rounding of the sums counts against the variance of the measured signal.
    assert vaf(measured + measured_offset, estimated + estimated_offset) == pytest.approx(
        expected, rel=1e-6, abs=1e-4
    )


@given(signals, st.floats(0.01, 100), st.floats(0.0, 3.0))
def test_a_common_scale_does_not_change_the_vaf_and_a_gain_does(signal, scale, gain):
    assert vaf(scale * signal, scale * gain * signal) == pytest.approx(
        vaf(signal, gain * signal), abs=1e-6
    )
    assert vaf(signal, gain * signal) == pytest.approx(100 * (1 - (1 - gain) ** 2), abs=1e-6)


@pytest.mark.parametrize(
    ("measured", "estimated", "message"),
    [
        ([1.0, 2.0], [1.0], "equal length"),
        ([[1.0, 2.0]], [[1.0, 2.0]], "1-D"),
        ([1.0, np.nan], [1.0, 2.0], "measured signal is not finite at sample 1"),
        ([1.0, 2.0], [np.inf, 2.0], "estimated signal is not finite at sample 0"),
        ([0.1, 0.1, 0.1], [1.0, 2.0, 3.0], "constant"),
        ([], [], "2 samples or more"),
    ],
)
def test_signals_without_a_vaf(measured, estimated, message):
    with pytest.raises(DataError, match=message):
        vaf(measured, estimated)


@given(st.data(), st.integers(1, 60))
def test_the_interval_holds_the_value(data, lags):
    measured = data.draw(signals)
    estimated = data.draw(hnp.arrays(float, measured.size, elements=numbers))
    value, low, high = vaf_with_interval(measured, estimated, lags)
    assert value == vaf(measured, estimated)
    assert low <= value <= high


def test_a_perfect_estimate_has_no_interval():
    measured = np.array([0.0, 1.0, 3.0])
    assert vaf_with_interval(measured, measured + 2.0, 5) == (100.0, 100.0, 100.0)


@pytest.mark.parametrize("signal", ["no", [True, False], [1j, 2.0], [[1.0], [1.0, 2.0]], None])
def test_a_vaf_needs_real_numbers(signal):
    with pytest.raises(DataError, match="the measured signal must be an array of real numbers"):
        vaf(signal, [1.0, 2.0])
