import numpy as np
import pytest

from ankleloop.errors import DataError
from ankleloop.signals.decimation import differentiate, differentiation_margin

RATE = 1000.0
TIME = np.arange(5000) / RATE


@pytest.mark.parametrize("delay", [0.0, 0.04, 0.0405, 0.0333])
@pytest.mark.parametrize("frequency", [1.0, 20.0, 80.0, 149.0])
def test_velocity_is_exact_to_150_hz_at_any_delay(frequency, delay):
    w = 2 * np.pi * frequency
    velocity = differentiate(np.sin(w * TIME), RATE, delay)[500:-500]
    np.testing.assert_allclose(velocity, w * np.cos(w * (TIME[500:-500] - delay)), atol=2e-4 * w)


def test_velocity_inside_its_margin_does_not_depend_on_the_edges():
    x = np.random.default_rng(0).standard_normal(1000)
    before, after = differentiation_margin(RATE, 0.04)
    # Other samples beyond the margin change nothing inside it.
    wider = np.concatenate([np.full(300, 9.0), x, np.full(300, -9.0)])
    interior = slice(before, 1000 - after)
    np.testing.assert_allclose(
        differentiate(x, RATE, 0.04)[interior],
        differentiate(wider, RATE, 0.04)[300:1300][interior],
        atol=1e-9,
    )
    with pytest.raises(DataError, match="too short to differentiate"):
        differentiate(x[:100], RATE, 0.04)
