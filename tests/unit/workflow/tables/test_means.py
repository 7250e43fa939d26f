"""Means with their intervals, and counts of trials that a mean holds, leaves out, or holds with a warning."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from ankleloop_workflow.tables.means import COUNTS, count_outcomes, curve_means, means, widen


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


def test_means_equal_numpy_on_each_group(parameters):
    rng = np.random.default_rng(1)
    table = parameters.assign(
        K=np.where(parameters["failure"].isna(), rng.normal(150, 3, 12), np.nan)
    )
    rows = means(table, ["point", "method"], ["K", "passes"], {"low": 0.1})
    assert rows["quantity"].tolist() == ["K", "passes"] * 4
    for row in rows[rows["quantity"] == "K"].itertuples():
        values = table.query("point == @row.point and method == @row.method")["K"].dropna()
        assert (row.mean, row.sd, row.n) == pytest.approx(
            (values.mean(), values.std(), len(values))
        )
        low, high = stats.t.interval(0.95, len(values) - 1, values.mean(), stats.sem(values))
        assert (row.mean - row.margin, row.mean + row.margin) == pytest.approx((low, high))
        assert row.low == pytest.approx(np.quantile(values, 0.1))
    nothing = rows[rows["quantity"] == "passes"]  # a column that no method of the study has
    assert nothing["n"].eq(0).all()
    assert nothing[["mean", "margin"]].isna().all(axis=None)
    wide = widen(rows, ["point", "method"])
    assert list(wide.columns[:5]) == ["point", "method", "K_mean", "K_std", "K_count"]
    assert wide["K_mean"].tolist() == rows.loc[rows["quantity"] == "K", "mean"].tolist()
    assert wide[COUNTS].values.tolist() == rows.iloc[::2][COUNTS].values.tolist()


def test_curves_have_a_panel_for_each_column_and_mark_more_faults_than_usual(parameters):
    table = parameters.assign(series=parameters["method"].str.upper(), x=parameters["gain"], K=1.0)
    table.loc[table["point"].eq("q") & table["method"].eq("pr"), "failure"] = "no pole"
    curves = curve_means(table, {"first": "K", "second": "none"})
    first = curves[curves["panel"] == "first"]
    assert first[["series", "x", "marked", "failed"]].values.tolist() == [
        ["RIV", 2.0, True, False],
        ["RIV", 5.0, False, False],
        ["PR", 2.0, False, False],
        ["PR", 5.0, True, True],
    ]
    assert curves.loc[curves["panel"] == "second", "value"].isna().all()
