"""Counts of trials that a mean holds, leaves out, or holds with a warning."""

import numpy as np
import pandas as pd
import pytest

from ankleloop.paper.results import (
    COUNTS,
    count_outcomes,
    summarise_scores,
)


@pytest.fixture
def parameters():
    """Three trials of two methods at two points; the first method fails once and warns once at the first point."""
    rows = [
        {"point": point, "gain": gain, "method": method, "trial": trial}
        for point, gain in (("p", 2.0), ("q", 5.0))
        for method in ("riv", "pr")
        for trial in range(3)
    ]
    table = pd.DataFrame(rows).assign(failure=None, warnings=None)
    table.loc[0, "failure"] = "no pole"
    table.loc[1, "warnings"] = "unstable"
    table.loc[2, "warnings"] = ""  # no text: no warning
    table.loc[3, "warnings"] = "unstable"  # another method, the same trial as the failure
    table["G"] = 10.0
    table.loc[[0, 1], "G"] = np.nan  # the first one failed
    return table


def test_counts_of_each_method_at_each_point(parameters):
    counts = count_outcomes(parameters, ["point", "method"])
    assert counts.values.tolist() == [
        ["p", "riv", 3, 1, 1, 1],
        ["p", "pr", 3, 0, 1, 0],
        ["q", "riv", 3, 0, 0, 0],
        ["q", "pr", 3, 0, 0, 0],
    ]


def test_a_trial_of_several_methods_is_one_trial(parameters):
    assert count_outcomes(parameters, ["gain"]).values.tolist() == [
        [2.0, 3, 1, 2, 1],
        [5.0, 3, 0, 0, 0],
    ]
    assert count_outcomes(parameters, ["method"]).values.tolist() == [
        ["riv", 6, 1, 1, 1],
        ["pr", 6, 0, 1, 0],
    ]


def test_means_of_scores_keep_their_order_and_say_what_they_leave_out(parameters):
    """The rows of a method that failed in every trial stand without a mean."""
    parameters.loc[parameters["method"].eq("pr") & parameters["point"].eq("q"), "failure"] = (
        "no pole"
    )
    vaf = np.where(parameters["failure"].isna(), np.arange(12.0), np.nan)
    parameters = parameters.assign(vaf_net_true=vaf, vaf_reflex_true=vaf + 5)
    table = summarise_scores(parameters, ["point", "method"])
    assert table[["point", "method", "torque"]].values.tolist()[:3] == [
        ["p", "riv", "net"], ["p", "riv", "reflex"], ["p", "pr", "net"]
    ]  # fmt: skip
    assert table["mean"].tolist()[:6] == [1.5, 6.5, 4.0, 9.0, 7.0, 12.0]
    assert table["mean"].isna().tolist() == [False] * 6 + [True] * 2
    assert table[["n", *COUNTS]].values.tolist()[:2] == [[2, 3, 1, 1, 1]] * 2
    assert table[["n", *COUNTS]].values.tolist()[-1] == [0, 3, 3, 0, 0]
