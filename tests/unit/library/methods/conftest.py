"""Trials that the tests of several methods share; no test changes them."""

import pytest

from ankleloop import simulate


@pytest.fixture(scope="session")
def clean():
    """Trials without noise, by reflex gain."""
    return {
        gain: simulate(seed=1, reflex_gain=gain, voluntary=0.0, snr_db=None) for gain in (2.0, 13.0)
    }


@pytest.fixture(scope="session")
def noisy():
    return simulate(seed=1, duration=20.0)
