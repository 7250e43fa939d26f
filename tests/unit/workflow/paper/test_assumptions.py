"""Settings that are drawn: a claim holds by the means of each, and trials that chose a setting do not judge it."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from synthetic_results import CLAIMS, FINDINGS, PAPER, TABLES, build_ledger

from ankleloop_workflow.paper.assumptions import count_numbers, judge_settings, measure_assumptions
from ankleloop_workflow.paper.checks import CASCADE_ONCE, DRAWN, StudyResults
from ankleloop_workflow.paper.judgement import OPEN, REPRODUCED
from ankleloop_workflow.paper.ledger import HOLDS, claim_numbers, tabulate_ledger

NUMBERS = claim_numbers("table1", TABLES["table1"], {})
ALL_CLAIMS = pd.concat([NUMBERS, CLAIMS, FINDINGS])


def make_results(changes, trials=4, spread=0.0):
    """Results whose numbers are those of Table 1, less a change [points] by setting, method and torque."""
    rng = np.random.default_rng(1)
    rows = []
    for (method, torque), paper in PAPER.items():
        for setting, change in enumerate(changes):
            vaf = paper - change.get((method, torque), 0.0) + spread * rng.standard_normal(trials)
            name = method.replace(CASCADE_ONCE, "parallel-cascade")
            rows += [(str(setting), name, k, torque, value) for k, value in enumerate(vaf)]
    table = pd.DataFrame(rows, columns=["point", "method", "trial", "torque", "vaf"])
    table = table.pivot(index=["point", "method", "trial"], columns="torque", values="vaf")
    for against in ("measured", "true"):
        table = table.join(
            table[["net", "intrinsic", "reflex"]].add_prefix("vaf_").add_suffix(f"_{against}")
        )
    points = {str(setting): {"stiffness": 150.0} for setting in range(len(changes))}
    return StudyResults(DRAWN, points, table.assign(K=150.0).reset_index(), {})


def test_a_claim_holds_where_the_means_of_a_setting_are_accepted():
    changes = [{}, {("pr-moesp", "reflex"): 2.5}, {("pr-moesp", "intrinsic"): 43.0}]
    held = judge_settings(ALL_CLAIMS, make_results(changes))
    claims = ["similar", "cascade-net-good", "pr-accurate", "pr-above-cascade"]
    assert set(held) == {*NUMBERS["id"], *claims}
    assert held["table1/pr-moesp/reflex"].tolist() == [True, False, True]
    assert held[claims].to_numpy().tolist() == [
        [True, True, True, True],
        [False, True, True, True],
        [False, True, True, False],
    ]


def test_the_ledger_has_the_share_of_the_settings():
    changes = [{}] * 30 + [{("eiv-moesp", "net"): 3.0}] * 30
    ledger = build_ledger(studies={DRAWN: make_results(changes)})
    expected = stats.binomtest(30, 60).proportion_ci(method="wilson")
    row = ledger.loc["similar", ["holds", "holds_low", "holds_high"]].to_list()
    assert row == pytest.approx([50.0, 100 * expected.low, 100 * expected.high])
    assert ledger.loc["drawn-similar", ["verdict", "ours"]].to_list() == [REPRODUCED, 50.0]
    assert tabulate_ledger(ledger.reset_index())[HOLDS].ne("–").sum() == len(NUMBERS) + 4
    without = build_ledger()
    assert without.loc["drawn-similar", "verdict"] == OPEN
    assert set(tabulate_ledger(without.reset_index())[HOLDS]) == {"–"}


def test_the_nearest_settings_have_their_numbers_by_trials_that_did_not_choose_them():
    results = make_results([{}] * 300, spread=3.0)
    measured = measure_assumptions(ALL_CLAIMS, results).set_index("quantity")
    number = measured.loc[f"{DRAWN}/nearest"]
    by_half = [
        count_numbers(ALL_CLAIMS, StudyResults(DRAWN, results.points, part, {}))
        for _, part in results.table.groupby(results.table["trial"] % 2)
    ]
    assert by_half[0].nlargest(10).mean() > number["high"]
    assert number["low"] < by_half[1].mean() < number["high"]
