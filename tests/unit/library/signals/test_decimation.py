import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ankleloop.errors import DataError
from ankleloop.signals.decimation import (
    decimate,
    decimation_factor,
    decimation_margin,
    usual_rate,
)

RATE, FACTOR = 1000.0, 10
TIME = np.arange(5000) / RATE
FIRST, COUNT = 1000, 200
DECIMATED_TIME = TIME[FIRST : FIRST + FACTOR * COUNT : FACTOR]


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize("frequency", [0.5, 3.0, 12.3, 25.0, 37.0])
def test_sinusoids_in_the_band_and_their_derivatives_are_exact(frequency, derivative):
    w = 2 * np.pi * frequency
    output = decimate(
        np.sin(w * TIME + 0.3), FACTOR, FIRST, COUNT, rate=RATE, derivative=derivative
    )
    expected = w**derivative * np.sin(w * DECIMATED_TIME + 0.3 + derivative * np.pi / 2)
    np.testing.assert_allclose(output, expected, rtol=0, atol=1e-4 * w**derivative)


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize("frequency", [50.5, 62.0, 70.0, 130.0, 449.0])
def test_sinusoids_that_would_alias_are_removed(frequency, derivative):
    w = 2 * np.pi * frequency
    output = decimate(np.sin(w * TIME), FACTOR, FIRST, COUNT, rate=RATE, derivative=derivative)
    assert np.max(np.abs(output)) < 1e-4 * w**derivative


def test_the_margin_is_sufficient_and_necessary():
    margin = decimation_margin(FACTOR)
    x = np.random.default_rng(0).standard_normal(2 * margin + 1)
    for derivative in range(3):
        assert decimate(x, FACTOR, margin, 1, derivative=derivative).shape == (1,)
    with pytest.raises(DataError, match=r"too short.*Record longer"):
        decimate(x, FACTOR, margin + 1, 1, derivative=1)
    with pytest.raises(DataError, match="too short"):
        decimate(x, FACTOR, margin - 1, 1, derivative=1)


@settings(deadline=None)
@given(st.sampled_from([200.0, 999.9, 1000.0, 1024.0, 44100.0]), st.integers(1, 400).map(float))
@example(1000.0, 150.0)
@example(100.0, 1000.0)
def test_the_suggested_rate_divides_the_sampling_rate(rate, identification_rate):
    try:
        assert decimation_factor(rate, identification_rate) * identification_rate == pytest.approx(
            rate
        )
    except DataError as error:
        message = str(error)
        assert f"({rate:g} Hz)" in message
        assert f"({identification_rate:g} Hz)" in message
        suggestion = float(message.split("for example ")[1].split(" Hz")[0])
        assert decimation_factor(rate, suggestion) >= 1


@pytest.mark.parametrize(
    ("sampling_rate", "expected"),
    [
        (1000.0, 100.0),
        (2000.0, 100.0),
        (1024.0, 102.4),
        (256.0, 256.0 / 3),
        (128.0, 128.0),
        (140.0, 70.0),
        (50.0, 50.0),
        (999.999999999, 100.0),
    ],
)
def test_the_usual_rate_divides_the_sampling_rate(sampling_rate, expected):
    assert usual_rate(sampling_rate) == pytest.approx(expected)
    assert decimation_factor(sampling_rate, usual_rate(sampling_rate)) >= 1
