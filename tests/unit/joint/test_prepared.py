"""A prepared trial: methods and scores share its values, and give exactly the results that they give alone."""

import pytest

from ankleloop import identify, simulate
from ankleloop.joint.prepared import prepare


@pytest.fixture(scope="module")
def trials():
    return [simulate(seed=seed, duration=12.0) for seed in (1, 2)]


# --- sharing


def test_options_do_not_mix(trials):
    """Values of one delay, rate, basis or reference do not serve another."""
    shared = prepare(trials[0])
    for options in (
        {},
        {"delay": 0.05},
        {"identification_rate": 50.0},
        {"basis": "rectifier"},
        {"basis": "chebyshev", "degree": 3},
        {"basis": "spline"},
        {"input_matrices": "instruments"},
        {"input_matrices": "instruments", "basis": "rectifier", "delay": 0.05},
        {},
    ):
        assert identify(shared, "pr-moesp", **options) == identify(trials[0], "pr-moesp", **options)
    for options in ({}, {"reflex_lags": 0.3}, {"intrinsic_lags": 0.02}, {}):
        cascade = {"max_passes": 2, **options}
        assert identify(shared, "parallel-cascade", **cascade) == identify(
            trials[0], "parallel-cascade", **cascade
        )
