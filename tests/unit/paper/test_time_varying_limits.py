"""Errors and bands of trajectories beside the bound, the level and published errors."""

import numpy as np
import pandas as pd
import pytest

from ankleloop import simulate
from ankleloop.assessment.cramer_rao import trajectory_bound
from ankleloop.paper.time_varying_limits import compare_with_bound, count_coverage, describe_comparison

POINT = {"variation": "cycle", "duration": 42.0, "stiffness_variation": 0.4, "cycle_onsets": "phase"}


def test_efficiency_of_estimates_that_scatter_as_the_bound_says():
    """Normal errors with the deviations of the bound have an efficiency of 100 %, and its interval holds that."""
    rng, trials = np.random.default_rng(1), 400
    settings = {name: value for name, value in POINT.items() if name != "cycle_onsets"}
    bound = trajectory_bound(seed=0, **settings)
    truth = simulate(seed=0, **settings)["stiffness_true"].values[:1400].mean()
    errors = 100.0 / truth * bound["K"].values * rng.standard_normal((trials, bound.sizes["phase"]))
    means = 100.0 / truth * float(bound["K_mean"]) * rng.standard_normal(trials)
    scores = {"K_nrmse": np.sqrt((errors**2).mean(axis=1)), "K_bias": means}
    details = pd.DataFrame(scores | {f"{name}_{score}": 1.0 for name in "BG" for score in ("nrmse", "bias")})
    table = compare_with_bound(details.assign(point="p", method="m"), {"p": POINT}, "m").set_index("parameter")
    assert table.loc["K", "efficiency"] == pytest.approx(100.0, rel=0.03)
    assert table.loc["K", "mean_low"] < 100.0 < table.loc["K", "mean_high"]
    assert table.loc["K", "mean_high"] / table.loc["K", "mean_low"] < 1.4
    assert compare_with_bound(details.assign(point="p", method="m"), {"p": POINT}, "other").empty
    square = {"p": POINT | {"variation_shape": "square"}}
    assert compare_with_bound(details.assign(point="p", method="m"), square, "m").empty


def test_bands_are_counted_by_the_interval_of_their_share():
    table = pd.DataFrame(
        {
            "point": list("abcde"),
            "method": "m",
            "parameter": "K",
            "covered": [80.0, 94.0, 99.0, 91.0, np.nan],
            "covered_margin": [5.0, 1.0, 1.0, 4.0, np.nan],
        }
    )
    (row,) = count_coverage(table, {name: name.upper() for name in "abcde"}).to_dict("records")
    assert {name: row[name] for name in ("settings", "less", "more", "open")} == {
        "settings": 4, "less": 1, "more": 1, "open": 1
    }  # fmt: skip
    assert row["smallest"] == "80 ± 5 (A)"
    single = count_coverage(table.iloc[:1].assign(covered_margin=np.nan), {"a": "A"}).iloc[0]
    assert (single["open"], single["smallest"]) == (1, "80 (A)")


def test_what_is_compared_with_published_errors_follows_the_settings():
    settings = {"snr_db": None, "closed_loop": True, "cycle_duration": 1.2}
    assert describe_comparison(settings, "9 to 10").startswith(
        "Here: 9 to 10 cycles of 1.2 s, no measurement noise, closed loop."
    )
