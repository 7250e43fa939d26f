"""The method that is recommended for a recording, its reason and its condition."""

import numpy as np
import pandas as pd
import pytest

from ankleloop.recordings.analysis import Analysis
from ankleloop.recordings.checks import Check, Finding
from ankleloop.recordings.recommendation import (
    Recommendation,
    format_with_interval,
    recommend,
    select_valid_methods,
)

ROWS = [
    {"label": "PR", "method": "pr-moesp", "valid": True, "vaf_unseen": 91.26, "K": 149.0},
    {"label": "RIV", "method": "riv", "valid": True, "vaf_unseen": 90.0, "K": 151.23, "K_low": 149.5, "K_high": 153.0},
    {"label": "PI", "method": "pi-moesp", "valid": False, "vaf_unseen": np.nan, "K": np.nan},
]
FED_BACK = "the loop is closed, and torque that is fed back does not bias it"


def make_analysis(loop, rows):
    return Analysis(Check([Finding("loop", "ok", "")], loop, {}), {}, {}, pd.DataFrame(rows))


def test_closed_loop_takes_riv():
    assert recommend(make_analysis("closed", ROWS)) == Recommendation(
        label="RIV",
        reason=FED_BACK,
        condition="",
        text=f"take RIV: {FED_BACK}. K = 151.2 (149.5 … 153) N·m/rad.",
    )


def test_closed_loop_without_riv_takes_the_first_valid_method():
    recommendation = recommend(make_analysis("closed", [ROWS[2], ROWS[0]]))
    assert (recommendation.label, recommendation.reason) == ("PR", FED_BACK)


@pytest.mark.parametrize(
    ("loop", "condition", "start"),
    [("open", "", "take PR: "), ("undecided", "If the loop was open", "If the loop was open: take PR: ")],
)
def test_open_loop_takes_the_largest_vaf_of_the_unseen_half(loop, condition, start):
    recommendation = recommend(make_analysis(loop, ROWS))
    assert recommendation.label == "PR"
    assert recommendation.reason == "it explains most of the half that was not fitted (91.3 %)"
    assert recommendation.condition == condition
    assert recommendation.text == f"{start}{recommendation.reason}. K = 149 N·m/rad."


@pytest.mark.parametrize("loop", ["closed", "open", "undecided"])
@pytest.mark.parametrize("rows", [[{"verdict": "refused", "reasons": "too short."}], [ROWS[2]]])
def test_no_recommendation_without_a_valid_method(loop, rows):
    recommendation = recommend(make_analysis(loop, rows))
    assert recommendation.label is None
    assert recommendation.condition == ""
    assert recommendation.text == "Nothing can be concluded from this recording."


def test_no_recommendation_without_a_score_of_the_unseen_half():
    row = {**ROWS[0], "vaf_unseen": np.nan}
    recommendation = recommend(make_analysis("open", [row]))
    assert recommendation.label is None
    assert "not fitted" in recommendation.reason
    assert recommend(make_analysis("closed", [row])).label == "PR"


def test_valid_rows_of_an_analysis():
    assert select_valid_methods(pd.DataFrame(ROWS))["label"].tolist() == ["PR", "RIV"]
    assert select_valid_methods(pd.DataFrame([{"verdict": "refused"}])).empty


@pytest.mark.parametrize(
    ("name", "text"),
    [("K", "151.2 (149.5 … 153)"), ("vaf_unseen", "90"), ("label", "RIV"), ("B", "–"), ("zeta", "–")],
)
def test_values_with_intervals(name, text):
    assert format_with_interval(pd.Series({**ROWS[1], "zeta": np.nan}), name) == text
