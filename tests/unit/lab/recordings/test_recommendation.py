"""The method that is recommended for a recording, its reason and its condition; nothing is that has a warning."""

import numpy as np
import pandas as pd
import pytest

from ankleloop.joint.regressors import torque_dataset
from ankleloop_lab.recordings.analysis import Analysis
from ankleloop_lab.recordings.checks import Check, Finding
from ankleloop_lab.recordings.recommendation import Recommendation, recommend

FED_BACK = "the loop is closed, and torque that is fed back does not bias it"
RIV = {
    "label": "RIV",
    "method": "riv",
    "valid": True,
    "trusted": True,
    "vaf_unseen": 90.0,
    "K": 151.23,
}
RIV |= {"K_low": 149.5, "K_high": 153.0, "intervals": "robust"}
PR = {
    "label": "PR",
    "method": "pr-moesp",
    "valid": True,
    "trusted": True,
    "vaf_unseen": 91.26,
    "K": 149.0,
}
CASCADE = {**PR, "label": "cascade", "method": "parallel-cascade", "vaf_unseen": 91.0}
INVALID = {
    "label": "PI",
    "method": "pi-moesp",
    "valid": False,
    "trusted": False,
    "vaf_unseen": np.nan,
    "K": np.nan,
}
ROWS = [PR, RIV, INVALID]


def warned(row, text="not converged"):
    return {**row, "trusted": False, "warnings": text, "K_low": np.nan, "K_high": np.nan}


def residual(size, seed, samples=6000):
    """Torque of the unseen half, predicted but for a residual of a size [%] of its variance."""
    y = np.random.default_rng(0).standard_normal(samples)
    e = np.random.default_rng(seed).standard_normal(samples)
    return [
        torque_dataset(np.arange(samples) / 100, 100.0, measured=y, net=y - np.sqrt(size / 100) * e)
    ]


def make_analysis(loop, rows, *, unseen=None, reference=True):
    check = Check([Finding("loop", "ok", "")], loop, {}, reference=reference)
    return Analysis(check, {}, {}, pd.DataFrame(rows), unseen or {})


def test_closed_loop_takes_riv():
    text = f"take RIV: {FED_BACK}. K = 151.2 (149.5 … 153) N·m/rad, robust 95 % interval."
    assert recommend(make_analysis("closed", ROWS)) == Recommendation("RIV", text)
    other = recommend(make_analysis("undecided", ROWS))
    assert other.label == "RIV"
    assert other.text.startswith("take RIV: feedback is not excluded")


@pytest.mark.parametrize("riv", [INVALID, warned(RIV)])
def test_closed_loop_without_a_riv_to_be_trusted_takes_another_valid_method_with_its_caution(riv):
    row = {**PR, "caution": "its poles are biased."}
    recommendation = recommend(make_analysis("closed", [riv, row]))
    assert recommendation.label == "PR"
    assert ("riv has a warning" if riv["valid"] else "there is no valid riv") in recommendation.text
    assert "does not bias it" not in recommendation.text
    assert "Caution: its poles are biased." in recommendation.text
    assert ("Left out because of a warning" in recommendation.text) == riv["valid"]
    assert "K = 149 N·m/rad, without an interval." in recommendation.text


@pytest.mark.parametrize(
    ("loop", "reference", "start"),
    [("open", True, "take PR: "), ("undecided", False, "If the loop was open: take PR: ")],
)
def test_open_loop_takes_what_explains_most_if_the_difference_is_certain(loop, reference, start):
    unseen = {"PR": residual(5.0, 1), "RIV": residual(10.0, 2)}
    recommendation = recommend(make_analysis(loop, ROWS, unseen=unseen, reference=reference))
    assert recommendation.label == "PR"
    assert recommendation.text.startswith(
        f"{start}it explains most (91.3 % of the half that was not fitted), with a confidence of 95 %."
    )


def test_what_is_not_told_apart_is_named():
    short = {"PR": residual(40.0, 1, 1200), "RIV": residual(42.0, 2, 1200)}
    recommendation = recommend(make_analysis("open", ROWS, unseen=short))
    assert recommendation.label == "RIV"
    assert "; the others there: PR." in recommendation.text
    too_short = {"PR": residual(10.0, 1, 500), "RIV": residual(90.0, 2, 500)}
    assert (
        "; the others there: PR." in recommend(make_analysis("open", ROWS, unseen=too_short)).text
    )


@pytest.mark.parametrize("loop", ["closed", "open", "undecided"])
@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([INVALID], "Nothing can be concluded from this recording: no method is valid for it."),
        (
            [warned(RIV), warned(PR)],
            "No method is recommended: every method that was fitted has a warning (RIV, PR), so a parameter may be "
            "off by more than the tolerance. The warnings say which, and what to do.",
        ),
    ],
)
def test_no_recommendation_without_a_method_to_be_trusted(loop, rows, reason):
    assert recommend(make_analysis(loop, rows)) == Recommendation(None, reason)


def test_a_warning_keeps_the_best_score_from_being_recommended():
    unseen = {"PR": residual(1.0, 1), "RIV": residual(10.0, 2)}
    for row in (
        warned(PR),
        {**PR, "unseen_warnings": "not converged"},
        {**PR, "vaf_unseen": np.nan},
    ):
        recommendation = recommend(make_analysis("open", [row, RIV], unseen=unseen))
        assert recommendation.label == "RIV"
        assert "without a score of the unseen half: PR." in recommendation.text


def test_a_method_without_a_caution_comes_before_one_with_a_caution():
    rows = [
        {**PR, "label": "EIV", "method": "eiv-moesp", "caution": "it assumes white noise."},
        CASCADE,
    ]
    unseen = {"EIV": residual(9.0, 1), "cascade": residual(9.1, 2)}
    assert recommend(make_analysis("open", rows, unseen=unseen)).label == "cascade"


def test_no_recommendation_without_a_score_of_the_unseen_half():
    row = {**PR, "vaf_unseen": np.nan}
    recommendation = recommend(make_analysis("open", [row]))
    assert recommendation.label is None
    assert "not fitted" in recommendation.text
    assert recommend(make_analysis("closed", [row])).label == "PR"
