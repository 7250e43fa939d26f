"""Conclusions follow the evidence: each is given evidence for every verdict, and none, and has to change its words."""

import numpy as np
import pandas as pd
import pytest

from ankleloop.paper.assumptions import explain_assumptions
from ankleloop.paper.comparisons import compare_sizes, format_mean
from ankleloop.paper.conclusions import CONCLUSIONS, draw_conclusions
from ankleloop.paper.costs import describe_costs
from ankleloop.paper.judgement import CONTRADICTION, NOT_REPRODUCED, OPEN, REPRODUCED
from ankleloop.paper.ledger import CONDITIONAL
from ankleloop.paper.omissions import COMPLETE
from ankleloop.paper.verdicts import count_verdicts, describe_claim, describe_claims
from ankleloop.simulation.settings import SimulationSettings

LABELS = {
    "pr-moesp": "PR",
    "pr-moesp-instruments": "PR, instruments",
    "parallel-cascade-one-pass": "one pass",
    "parallel-cascade": "converged",
    "riv": "RIV",
}
CLAIMS = {  # of each conclusion
    "table1": ["table1/pr-moesp/net", "table1/eiv-moesp/reflex"],
    "figure4": ["figure4-pr", "figure4-cascade-falls"],
    "cause": ["figure4-cause"],
    "bias": ["pr-unbiased", "eiv-unbiased"],
    "economy": ["economy-time"],
}
JUDGED = (REPRODUCED, CONDITIONAL, NOT_REPRODUCED, OPEN)
NO_TABLES = {}


def ledger_with(claims, verdict, ours=91.0):
    return pd.DataFrame(
        {
            "id": claims,
            "statement": [f"statement of {claim}" for claim in claims],
            "paper": 92.0,
            "ours": ours,
            "uncertainty": 0.5,
            "verdict": verdict,
            "reason": "because of this.",
            "conditions": "load assumed",
        }
    )


EMPTY = ledger_with(["figure4-cause"], OPEN).iloc[:0]


def conclude(name, tables=NO_TABLES, ledger=EMPTY):
    conclusion = CONCLUSIONS[name](ledger, tables)
    return None if conclusion is None else conclusion.text


def stiffness_table(errors, sd=1.0, n=10, **columns):
    """Rows of a table of the notebook `comparison`, from errors of K [%] by method."""
    rows = []
    for method, error in errors.items():
        bias = 1.5 * error  # of K = 150
        values = {"K_bias": bias, "K_mean": 150.0 + bias, "K_std": sd, "K_count": n}
        rows.append({"method": method, "label": LABELS[method], **values, **columns})
    return pd.DataFrame(rows)


def test_every_conclusion_is_left_out_without_evidence():
    assert draw_conclusions(EMPTY, NO_TABLES) == []
    claims = [claim for claims in CLAIMS.values() for claim in claims]
    assert draw_conclusions(ledger_with(claims, OPEN, ours=np.nan), NO_TABLES) == []


@pytest.mark.parametrize("name", CLAIMS)
def test_conclusions_from_claims_turn_with_the_verdict(name):
    texts = {verdict: conclude(name, ledger=ledger_with(CLAIMS[name], verdict)) for verdict in JUDGED}
    assert len(set(texts.values())) == len(JUDGED)
    assert "not reproduced" in texts[NOT_REPRODUCED].lower()
    assert "cannot be judged" in texts[OPEN].lower()
    for verdict in (REPRODUCED, CONDITIONAL):
        assert "reproduced" in texts[verdict].lower()
        assert "not reproduced" not in texts[verdict].lower()
    assert "load assumed" in texts[CONDITIONAL] or "stated condition" in texts[CONDITIONAL]
    assert "load assumed" not in texts[REPRODUCED]


def test_numbers_of_table1_are_counted_by_verdict():
    claims = [f"table1/m/{number}" for number in range(4)]
    ledger = ledger_with(claims, [CONDITIONAL, REPRODUCED, NOT_REPRODUCED, OPEN])
    text = conclude("table1", ledger=ledger)
    assert text.startswith("Reproduced: 2 of the 4 numbers of Table 1 (load assumed).")
    assert "Not reproduced: statement of table1/m/2, 91.00 ± 0.50 % where the paper has 92 %." in text
    assert "Cannot be judged: statement of table1/m/3" in text


def figure4_table(one_pass, converged):
    rows = [
        {"reflex_gain": gain, "method": method, "torque": torque, "mean": value, "margin": 0.1}
        for gain, factor in ((10.0, 0.5), (30.0, 1.0))
        for method, value in (("parallel-cascade-one-pass", one_pass * factor), ("parallel-cascade", converged))
        for torque in ("net", "intrinsic")
    ]
    return {"figure4": pd.DataFrame(rows)}


def test_the_cause_has_the_numbers_of_the_highest_gain():
    for verdict, phrase in ((REPRODUCED, "is reproduced"), (NOT_REPRODUCED, "is not reproduced")):
        text = conclude("cause", figure4_table(-50.0, 42.0), ledger_with(["figure4-cause"], verdict))
        assert f"{phrase}: at gain 30" in text
        assert "-50.00 ± 0.10 % after one pass and 42.00 ± 0.10 % after convergence" in text
    text = conclude("cause", figure4_table(-50.0, 42.0), ledger_with(["figure4-cause"], OPEN))
    assert text.endswith("cannot be judged: because of this.")


def test_passes_are_those_of_the_table():
    rows = {"reflex_gain": 10.0, "torque": "net", "passes": [1, 4], "mean": [90.0, 99.5], "sd": 0.1, "n": 10}
    table = pd.concat([pd.DataFrame(rows), pd.DataFrame(rows | {"reflex_gain": 30.0, "mean": [10.0, 98.0]})])
    assert conclude("passes", {"passes": table}).endswith("net torque 4 at gain 10 and over 4 at gain 30.")
    wide = table.assign(sd=10.0)  # the interval of 99.5 % reaches below 99 %
    assert "over 4 at gain 10" in conclude("passes", {"passes": wide})


@pytest.mark.parametrize(
    ("error", "sd", "group"),
    [(-60.0, 1.0, "Above 5 %: PR."), (1.0, 1.0, "Within 5 %: PR."), (4.0, 20.0, "Left open by the 95 % interval: PR.")],
)
def test_errors_with_voluntary_torque_and_load_turn_with_their_intervals(error, sd, group):
    points = [
        stiffness_table({"pr-moesp": value}, sd, voluntary=level, closed_loop=True)
        for level, value in ((0.0, 0.5), (1.0, error))
    ]
    text = conclude("feedback", {"voluntary": pd.concat(points)})
    assert "with voluntary torque of 100 %" in text
    assert group in text
    assert "open loop" not in text
    points = [stiffness_table({"pr-moesp": value}, sd, load_stiffness=k) for k, value in ((250.0, 0.5), (25.0, error))]
    text = conclude("load", {"load": pd.concat(points)})
    assert "(25 N·m/rad)" in text
    assert group in text
    assert ("grows for: PR" in text) == (error == -60.0)


def test_a_single_trial_shows_no_error():
    table = stiffness_table({"pr-moesp": -60.0}, np.nan, 1, voluntary=1.0, closed_loop=True)
    assert "Left open by the 95 % interval: PR." in conclude("feedback", {"voluntary": table})


def test_errors_fall_grow_or_are_not_shown_to_change():
    first = stiffness_table({"pr-moesp": 1.0, "riv": -40.0, "parallel-cascade": 3.0}, voluntary=0.0, closed_loop=True)
    last = stiffness_table({"pr-moesp": -40.0, "riv": 1.0, "parallel-cascade": -3.1}, voluntary=1.0, closed_loop=True)
    opened = stiffness_table({"pr-moesp": 2.0}, voluntary=1.0, closed_loop=False)
    text = conclude("feedback", {"voluntary": pd.concat([first, last, opened])})
    assert "grows for: PR; falls for: RIV; is not shown to change for: converged." in text
    assert "In open loop at the same level: PR +2.00 ± 0.48 %." in text


@pytest.mark.parametrize(("instruments", "word"), [(1.0, "smaller"), (-90.0, "larger"), (61.0, "not shown to differ")])
def test_instruments_for_b_and_d_are_compared_with_least_squares(instruments, word):
    errors = {"pr-moesp": -60.0, "pr-moesp-instruments": instruments}
    tables = {"voluntary": stiffness_table(errors, 10.0, voluntary=1.0, closed_loop=True)}
    text = conclude("instruments", tables)
    assert text.endswith(f"its size is {word}.")
    assert "with least squares -60.0 ± 4.8 %" in text
    assert conclude("instruments", {"voluntary": tables["voluntary"].query("method == 'pr-moesp'")}) is None


def test_margins_add_up_for_methods_on_the_same_trials():
    first, second = {"error": 5.0, "margin": 2.0}, {"error": 8.5, "margin": 2.0}
    assert compare_sizes(first, second) == "not shown to differ"  # but 3.5 is above the root of the sum of squares
    assert compare_sizes(first, {**second, "margin": 1.0}) == "smaller"


def choosing_table(net, instrumental):
    """Two methods, the first with the better intrinsic torque; scores are leads of the first."""
    rows = []
    for level in (0.5, 1.0):
        for method, sign in (("riv", 1), ("pr-moesp", -1)):
            values = {
                "vaf_intrinsic_true": 80 + 10 * sign,
                "vaf_net_measured": 50 + net * sign,
                "unseen_cross_validation": 50 + net * sign,
                "unseen_instrumental": 50 + instrumental * sign,
            }
            row = {"voluntary": level, "method": method, "label": LABELS[method]}
            for name, value in values.items():
                row |= {f"{name}_mean": value, f"{name}_std": 1.0, f"{name}_count": 10}
            rows.append(row)
    return {"choosing": pd.DataFrame(rows)}


def test_the_choice_of_a_method_turns_with_the_scores():
    text = conclude("net_vaf", choosing_table(net=-10, instrumental=5))
    assert "by the net VAF of the fitted record 0 of 2 times" in text
    assert "by the instrumental VAF of unseen halves 2 of 2 times" in text
    text = conclude("net_vaf", choosing_table(net=10, instrumental=0.1))  # the last lead is within its interval
    assert "by the net VAF of the fitted record 2 of 2 times" in text
    assert "by the instrumental VAF of unseen halves 0 of 0 times" in text


def projection_table(vaf, pole):
    row = {"voluntary": [0.0], "method": "pr-moesp", "label": "PR", "spectral_radius_true": 0.67}
    for name, value in (("vaf_intrinsic_true", vaf), ("spectral_radius", pole)):
        row |= {f"{name}_mean": value, f"{name}_std": 0.01, f"{name}_count": 10}
    return {"projection": pd.DataFrame(row)}


def test_wrong_poles_behind_an_accurate_torque():
    text = conclude("poles", projection_table(99.5, 0.9))
    assert "1 of these have a mean largest pole" in text
    assert "VAF does not show wrong poles" in text
    assert "0.90 where 0.67 is true (PR" in text
    for table in (projection_table(99.5, 0.68), projection_table(90.0, 0.9)):
        text = conclude("poles", table)
        assert "0 of these" in text
        assert "does not show" not in text


@pytest.mark.parametrize(
    ("covered", "word"), [(80.0, "fewer than"), (95.0, "not shown to differ from"), (100.0, "more than")]
)
def test_coverage_turns_with_the_share_of_intervals(covered, word):
    row = {"point": "a", "label": "RIV", "parameter": ["K", "B"], "ratio": [1.0, 1.4], "n": 200, "covered": covered}
    text = conclude("efficiency", {"efficiency": pd.DataFrame(row)})
    assert "RIV 1.20" in text  # median
    assert "RIV 1.00 … 1.40" in text
    assert f"{word} 95 %" in text
    without = pd.DataFrame(row).assign(covered=np.nan)
    assert "intervals" not in conclude("efficiency", {"efficiency": without})


def test_few_trials_do_not_show_a_coverage():
    row = {"point": "a", "label": "RIV", "parameter": ["K"], "ratio": [1.0], "n": 4, "covered": 75.0}
    assert "not shown to differ from 95 %" in conclude("efficiency", {"efficiency": pd.DataFrame(row)})


def test_contradictions_are_those_of_the_ledger():
    claims = ["figure4-count", "table2-text"]
    assert conclude("contradictions", ledger=ledger_with(claims, NOT_REPRODUCED)) is None
    text = conclude("contradictions", ledger=ledger_with(claims, [NOT_REPRODUCED, CONTRADICTION]))
    assert text == "Contradictions in the paper: “statement of table2-text”, but because of this."


def test_a_table_without_the_setting_of_a_conclusion_gives_none():
    table = stiffness_table({"pr-moesp": -60.0})
    assert draw_conclusions(EMPTY, {"voluntary": table, "load": table, "projection": table}) == []


def test_words_of_verdicts():
    ledger = ledger_with(["a", "b", "c"], [NOT_REPRODUCED, REPRODUCED, "partly"])
    assert count_verdicts(ledger) == "1 reproduced, 1 not reproduced, 1 partly"
    assert describe_claim(ledger, "a") == "“statement of a” **is not reproduced**: because of this."
    assert describe_claim(ledger, "d") is None
    assert describe_claims(ledger, ["b", "d"]) == "- “statement of b” **is reproduced**: because of this."
    text = describe_claim(ledger_with(["a"], CONDITIONAL), "a")
    assert "**is reproduced under a stated condition** (load assumed): because" in text


@pytest.mark.parametrize(
    ("value", "margin", "text"),
    [(1.0, 0.004, "1.00 ± 0.00"), (-0.3, 17.0, "0 ± 17"), (10.0, 45.0, "10 ± 45"), (1.0, np.inf, "1.0")],
)
def test_means_have_the_digits_of_their_intervals(value, margin, text):
    assert format_mean(value, margin) == text


# What is assumed


def table1_results(one_pass, converged):
    values = {"parallel-cascade-one-pass": one_pass, "parallel-cascade": converged}
    rows = [
        {"gain": gain, "method": method, "torque": "intrinsic", "paper": 56.0, "mean": value - gain, "sd": 1.0, "n": 4}
        for gain in (2.0, 13.0)
        for method, value in values.items()
    ]
    return {"table1": pd.DataFrame(rows)}


def test_reasons_of_assumptions_come_from_results():
    settings = SimulationSettings.defaults()
    reasons = explain_assumptions(EMPTY, NO_TABLES, settings).set_index("parameter")["why"]
    for parameter in ("reflex gain", "inertia of the load", "stop rule of the parallel cascade"):
        assert "was not run" in reasons[parameter]
    ledger = ledger_with(["eq17-gain", "table1/pr-moesp/net"], [NOT_REPRODUCED, REPRODUCED])
    tables = {**table1_results(70.0, 90.0), **figure4_table(0.0, 0.0)}
    reasons = explain_assumptions(ledger, tables, settings).set_index("parameter")["why"]
    assert "is not reproduced: because of this" in reasons["reflex gain"]
    assert "stable at all gains of Figure 4 (10 … 30); 1 of the 1 numbers" in reasons["inertia of the load"]
    assert "is 91.00 ± 0.50 %, published are 92 %" in reasons["relative voluntary torque"]
    assert "57.0 ± 1.6 % after one pass and 77.0 ± 1.6 % at convergence" in reasons["stop rule of the parallel cascade"]
    turned = explain_assumptions(ledger.assign(verdict=REPRODUCED), tables, settings).set_index("parameter")["why"]
    assert "printed is reproduced: because" in turned["reflex gain"]


# What a step of the processing costs


def omission_row(step, vaf=0.0, k_error=1.0, failures=0):
    """A row without a step: change of VAF [points], and the mean error of K [% of 150]; 1 % with all steps."""
    row = {"condition": "with noise", "method": "PR", "omitted_step": step, "trials": 10}
    row |= {"failures": failures, "K_mean": 150 + 1.5 * k_error, "K_margin": 1.5, "K_cost": 1.5 * (k_error - 1.0)}
    row["K_cost_margin"] = 1.5
    for name in ("vaf_net_measured", "vaf_intrinsic_true", "vaf_reflex_true"):
        row |= {f"{name}_cost": vaf if name == "vaf_reflex_true" else 0.0, f"{name}_cost_margin": 0.5}
    return row


def test_costs_are_in_order_and_only_losses():
    rows = [
        omission_row(COMPLETE),
        omission_row("scaling"),
        omission_row("means", vaf=2.0),
        omission_row("rank", vaf=-30),
    ]
    rows += [
        omission_row("derivatives", k_error=-9.0),
        omission_row("filter", vaf=-0.3),
        omission_row("order", failures=4),
    ]
    texts = describe_costs(pd.DataFrame(rows), {"K": 150.0})
    steps = [text.split("**")[1] for text in texts]
    assert steps[:3] == ["order", "rank", "derivatives"]
    by_step = dict(zip(steps, texts, strict=True))
    assert "4 of 10 identifications failed" in by_step["order"]
    assert "30.0 ± 0.5" in by_step["rank"].replace("30.00 ± 0.50", "30.0 ± 0.5")
    assert "reflex VAF (PR, with noise)" in by_step["rank"]
    assert "the error of K grows by 8.0 ± 2.0 % to -9.0 % (PR, with noise)" in by_step["derivatives"]
    for step in ("scaling", "means", "filter"):
        assert by_step[step].endswith("costs nothing that this study can show.")
