"""Tables of a study in which rows are missing are refused."""

import pandas as pd
import pytest

from ankleloop.errors import DataError
from ankleloop.paper.completeness import check_study

POINTS, METHODS = ["p", "q"], ["riv", "pr"]


@pytest.fixture
def tables():
    """Two chunks, one for each point: two trials of two methods, one of which fails once."""
    parameters, scores = [], []
    for point in POINTS:
        key = [{"study": "s", "point": point, "method": method, "trial": n} for method in METHODS for n in (0, 1)]
        details = pd.DataFrame(key).assign(K=150.0, failure=None)
        if point == "p":
            details.loc[1, ["K", "failure"]] = [None, "no pole"]
        estimates = details[details["failure"].isna()].drop(columns=["K", "failure"])
        rows = [estimates.assign(torque=torque, against="true", vaf=90.0) for torque in ("net", "reflex")]
        parameters.append(details)
        scores.append(pd.concat(rows).sort_values(["method", "trial"], ascending=[False, True]))
    return parameters, scores


@pytest.fixture
def check(tmp_path, tables):
    def check(trials=None):
        paths = []
        for name, chunks in zip(("parameters", "scores"), tables, strict=True):
            paths.append([tmp_path / f"{name}-{number}.csv" for number in range(len(chunks))])
            for path, table in zip(paths[-1], chunks, strict=True):
                table.to_csv(path, index=False)
        check_study(*paths, POINTS, METHODS, trials)

    return check


def test_complete_tables_with_a_failure_are_accepted(check):
    check()
    check(trials=2)


def test_an_estimate_without_its_scores_names_the_file(check, tables):
    tables[1][1] = tables[1][1].iloc[:-2]  # the last estimate of the last chunk
    with pytest.raises(DataError, match=r"scores-1\.csv: point q, method pr, trial 1: a score is missing"):
        check()


def test_scores_of_nothing_name_the_file(check, tables):
    tables[1][0] = tables[1][0].iloc[:0]
    with pytest.raises(DataError, match=r"scores-0\.csv: point p, method riv, trial 0: a score is missing"):
        check()


def test_a_chunk_that_ends_early_is_refused(check, tables):
    for kind in tables:
        kind[1] = kind[1][kind[1]["trial"] == 0]
    with pytest.raises(DataError, match=r"parameters-1\.csv: point q, method riv has 1 of 2 trials"):
        check()


def test_a_whole_study_that_ends_early_is_refused(check, tables):
    with pytest.raises(DataError, match=r"point p, method riv has 2 of 3 trials"):
        check(trials=3)


def test_a_study_without_any_estimate_says_why(check, tables):
    for number, (details, scores) in enumerate(zip(*tables, strict=True)):
        details["failure"] = "no pole"
        tables[1][number] = scores.iloc[:0]
    with pytest.raises(DataError, match=r"no trial of the study could be identified .* reason: no pole"):
        check()
