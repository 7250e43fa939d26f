"""The table of the study on steps of the processing, from results that are made up."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from ankleloop.methods.moesp import describe_omission
from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.tables.comparisons import COMPLETE, drop_omissions, tabulate_omissions

TRIALS = 6
COMPLETE_POINTS = {
    "filter": SimulationSettings.defaults(),
    "no filter": SimulationSettings.defaults() | {"antialias_cutoff": None},
    "quiet": SimulationSettings.defaults() | {"snr_db": None, "voluntary": 0.0},
}
POINTS = {
    f"{point}{name}": settings | {"omitted_step": step}
    for point, settings in COMPLETE_POINTS.items()
    for name, step in {"": None, " without scaling": "scaling"}.items()
}
LABELS = {"pr": "PR-MOESP", "eiv": "EIV-MOESP"}
ALGORITHMS = {"pr": "pr-moesp", "eiv": "eiv-moesp"}
SCORES = {"net": "measured", "intrinsic": "true", "reflex": "true"}


@pytest.fixture
def results():
    """K and all else at random; the fourth trial of one method fails, and the second has a warning of its own."""
    rng = np.random.default_rng(1)
    rows = []
    for point in POINTS:
        for method in LABELS:
            for trial in range(TRIALS):
                key = {"point": point, "method": method, "trial": trial}
                if (point, method, trial) == ("filter without scaling", "pr", 3):
                    rows.append(key | {"failure": "no convergence"})
                    continue
                warnings = [describe_omission("scaling")] if "without" in point else []
                if trial == 1 and "without" in point and method == "pr":
                    warnings.append("unstable")
                values = dict(
                    zip(
                        ["K", "B", "I", "spectral_radius", "pole_error"],
                        rng.normal(5, 1, 5),
                        strict=True,
                    )
                )
                values |= {
                    f"vaf_{torque}_{against}": rng.normal(90, 1)
                    for torque, against in SCORES.items()
                }
                rows.append(key | values | {"warnings": " ".join(warnings) or np.nan})
    return drop_omissions(pd.DataFrame(rows))


def values_of(parameters, point, method):
    rows = parameters[(parameters["point"] == point) & (parameters["method"] == method)]
    return rows.set_index("trial")["K"].dropna()


def test_rows_are_conditions_methods_and_steps(results):
    table = tabulate_omissions(results, POINTS, LABELS, ALGORITHMS)
    scaling, filtering = "scaling", "anti-aliasing filter"
    assert table[["condition", "method", "omitted_step"]].values.tolist() == [
        *(["with noise", "PR-MOESP", step] for step in (COMPLETE, filtering, scaling)),
        *(["with noise", "EIV-MOESP", step] for step in (COMPLETE, filtering, scaling)),
        *(["without noise", "PR-MOESP", step] for step in (COMPLETE, scaling)),
        *(["without noise", "EIV-MOESP", step] for step in (COMPLETE, scaling)),
    ]
    assert table[["trials", "warnings", "failures"]].values.tolist()[:3] == [
        [6, 0, 0],
        [6, 0, 0],
        [6, 1, 1],
    ]


def test_costs_are_of_the_same_trials(results):
    row = tabulate_omissions(results, POINTS, LABELS, ALGORITHMS).iloc[2]
    with_step, without = (
        values_of(results, point, "pr") for point in ("filter", "filter without scaling")
    )
    assert row["K_mean"] == pytest.approx(without.mean())
    assert row["K_cost"] == pytest.approx((without - with_step.drop(3)).mean())
    interval = stats.ttest_rel(without, with_step.drop(3)).confidence_interval(0.95)
    assert row["K_cost_margin"] == pytest.approx((interval.high - interval.low) / 2)
    alone = stats.ttest_1samp(without, 0.0).confidence_interval(0.95)
    assert row["K_margin"] == pytest.approx((alone.high - alone.low) / 2)
    vaf = results.query("point == 'filter without scaling' and method == 'pr'")["vaf_reflex_true"]
    assert row["vaf_reflex_true_mean"] == pytest.approx(vaf.mean())


def test_the_filter_is_compared_between_other_trials(results):
    table = tabulate_omissions(results, POINTS, LABELS, ALGORITHMS)
    complete, row = table.iloc[0], table.iloc[1]
    without = values_of(results, "no filter", "pr")
    assert row["K_mean"] == pytest.approx(without.mean())
    assert row["K_cost"] == pytest.approx(row["K_mean"] - complete["K_mean"])
    interval = stats.ttest_rel(without, values_of(results, "filter", "pr")).confidence_interval()
    assert row["K_cost_margin"] == pytest.approx((interval.high - interval.low) / 2)
    assert (complete["K_cost"], complete["K_cost_margin"]) == (0.0, 0.0)


def test_a_method_without_a_step_has_no_row_of_it(results):
    """Nothing is left out there, and no change of nought is measured."""
    table = tabulate_omissions(results, POINTS, LABELS, ALGORITHMS | {"eiv": "riv"})
    steps = table[table["method"] == "EIV-MOESP"].groupby("condition", sort=False)["omitted_step"]
    assert steps.agg(list).tolist() == [[COMPLETE, "anti-aliasing filter"], [COMPLETE]]
