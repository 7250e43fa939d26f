"""Conditions compared within subjects: paired intervals, order of conditions, repeatability, numbers of subjects."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from ankleloop import DataError, compare
from ankleloop_lab.recordings.comparison import (
    count_subjects,
    describe_differences,
    select_comparable,
)
from ankleloop_lab.recordings.labels import read_labels, suggest_names

SUBJECTS = list("abcdefgh")


@pytest.fixture
def table():
    """Two trials of each of eight subjects in three conditions, in the order of the names of their files."""
    rng = np.random.default_rng(1)
    rows = []
    for subject, factor in zip(SUBJECTS, 1 + 0.2 * rng.standard_normal(8), strict=True):
        for condition, value in {"10MVC": 150.0, "20MVC": 190.0, "rest": 110.0}.items():
            for noise in rng.standard_normal(2):
                row = {"subject": subject, "condition": condition, "K": factor * value + noise}
                rows.append(row)
    return pd.DataFrame(rows)


def of_kind(comparison, kind):
    rows = comparison[comparison["kind"] == kind]
    return rows.set_index(["condition", "reference"] if kind == "difference" else "condition")


def test_differences_have_the_interval_of_the_paired_test(table):
    differences = of_kind(compare(table), "difference")
    values = table.groupby(["condition", "subject"])["K"].mean()
    expected = stats.ttest_rel(values["10MVC"], values["rest"])
    row = differences.loc[("10MVC", "rest")]
    assert row["value"] == pytest.approx((values["10MVC"] - values["rest"]).mean())
    assert (row["low"], row["high"]) == pytest.approx(tuple(expected.confidence_interval()))
    percent = 100 * (values["10MVC"] / values["rest"] - 1)
    interval = stats.t.interval(0.95, 7, percent.mean(), stats.sem(percent))
    assert (row["percent_low"], row["percent_high"]) == pytest.approx(interval)


def test_remarks_are_counted_in_each_condition(table):
    """What moves the estimates of one condition alone is a difference."""
    assert "remarked" not in compare(table)
    table["remarks"] = np.where(table["condition"] == "rest", "the record shows a lag.", "")
    table.loc[table["subject"] == "a", "remarks"] = ""
    comparison = compare(table)
    means = of_kind(comparison, "mean")
    assert means["remarked"].to_dict() == {"rest": 14, "10MVC": 0, "20MVC": 0}
    text = describe_differences(comparison)
    assert "Estimates that are remarked: 14 in rest, 0 in 10MVC, 0 in 20MVC" in text


def test_means_are_over_subjects_that_count_alike(table):
    table.loc[0, "K"] = np.nan  # of a subject that has another trial in this condition
    means = of_kind(compare(table), "mean")
    values = table[table["condition"] == "10MVC"].groupby("subject")["K"].mean()
    assert means.loc["10MVC", "value"] == pytest.approx(values.mean())
    interval = stats.t.interval(0.95, 7, values.mean(), stats.sem(values))
    assert (means.loc["10MVC", "low"], means.loc["10MVC", "high"]) == pytest.approx(interval)


@pytest.mark.parametrize("kind", [bool, object])
def test_conditions_that_are_flags(kind):
    """They are labels, and select no rows or columns."""
    table = pd.DataFrame({"subject": ["A", "B"] * 2, "active": [False, False, True, True]})
    table["active"] = table["active"].astype(kind)
    table["K"] = [100.0, 120.0, 140.0, 130.0]
    result = compare(table, "active")
    assert of_kind(result, "mean")["value"].to_dict() == {"False": 110.0, "True": 135.0}
    difference = of_kind(result, "difference").loc[("True", "False")]
    assert (difference["value"], difference["subjects"]) == (25.0, 2)


@pytest.mark.parametrize(
    ("names", "order"),
    [
        (["10MVC", "20MVC", "rest"], ["rest", "10MVC", "20MVC"]),
        (["pre", "post", "late"], ["pre", "post", "late"]),
        ([20, 5, 10], [5, 10, 20]),
        ([0, 10, -10], [-10, 0, 10]),
        (["0deg", "10deg", "-10deg"], ["-10deg", "0deg", "10deg"]),
        (["MVC-10", "MVC-5", "rest"], ["rest", "MVC-5", "MVC-10"]),
    ],
)
def test_conditions_stand_by_their_numbers_or_as_they_appear(table, names, order):
    renamed = dict(zip(["10MVC", "20MVC", "rest"], names, strict=True))
    table["condition"] = table["condition"].map(renamed)
    assert list(of_kind(compare(table), "mean").index) == order


def test_a_categorical_column_has_its_own_order(table):
    order = ["20MVC", "unused", "rest", "10MVC"]
    table["condition"] = pd.Categorical(table["condition"], order)
    assert list(of_kind(compare(table), "mean").index) == ["20MVC", "rest", "10MVC"]


def test_what_cannot_be_trusted_or_paired_is_left_out(table):
    table["trusted"] = ~((table["subject"] == "a") & (table["condition"] == "rest"))
    comparison = compare(table)
    assert of_kind(comparison, "mean").loc["rest", "subjects"] == 7
    differences = of_kind(comparison, "difference")
    assert differences.loc[("10MVC", "rest"), "subjects"] == 7
    assert differences.loc[("20MVC", "10MVC"), "subjects"] == 8


def test_a_reference_of_zero_has_no_per_cent():
    table = pd.DataFrame({"subject": list("abab"), "condition": [1, 1, 2, 2]})
    table["G"] = [0.0, 1.0, 3.0, 4.5]
    (row,) = compare(table).query("kind == 'difference'").to_dict("records")
    assert row["value"] == 3.25
    assert pd.isna(row.get("percent"))


def test_repeatability_of_sessions():
    """Ratings of Shrout and Fleiss (1979), whose ICC(2,1) is 0.29 with mean squares of 11.24, 32.49 and 1.02."""
    ratings = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]
    rows = [
        {"subject": subject, "session": session, "condition": "rest", "K": float(value)}
        for subject, values in enumerate(ratings)
        for session, value in enumerate(values)
    ]
    found = compare(pd.DataFrame(rows)).set_index("kind")
    assert found.loc["ICC(2,1)", "value"] == pytest.approx(0.29, abs=0.005)
    assert found.loc["SEM", "value"] == pytest.approx(np.sqrt(1.02), abs=0.005)
    assert found.loc["MDC", "value"] == pytest.approx(1.96 * np.sqrt(2 * 1.02), abs=0.01)
    assert list(found["unit"]) == ["N·m/rad", "1", "N·m/rad", "N·m/rad"]


def test_needed_subjects_have_the_power(table):
    row = of_kind(compare(table, size=20.0), "difference").loc[("20MVC", "rest")]
    values = table.groupby(["condition", "subject"])["K"].mean()
    difference = values["20MVC"] - values["rest"]
    size = 0.2 * values["rest"].mean()
    n = int(row["needed"])
    draws = np.random.default_rng(1).normal(size, difference.std(), (4000, n))
    power = np.mean(stats.ttest_1samp(draws, 0.0, axis=1).pvalue < 0.05)
    fewer = np.mean(stats.ttest_1samp(draws[:, :-1], 0.0, axis=1).pvalue < 0.05)
    assert fewer < 0.82
    assert power > 0.78


def test_the_sentence(table):
    text = describe_differences(compare(table))
    assert text.startswith("K rises by ")
    assert " from rest to 10MVC, and K rises by " in text
    assert text.endswith(" from rest to 20MVC (8 subjects, paired 95 % intervals).")
    table["condition"] = table["condition"].map({"rest": "3", "10MVC": "2", "20MVC": "1"})
    assert "K falls by " in describe_differences(compare(table))
    table["condition"] = np.tile(["A", "B"], 24)
    assert describe_differences(compare(table)).startswith("No difference of K is shown: ")


def test_wrong_tables(table):
    with pytest.raises(DataError, match="no column 'load'; it has subject, condition, K"):
        compare(table, "load")
    with pytest.raises(DataError, match="no row has a value"):
        compare(table.assign(K=np.nan))


@pytest.mark.parametrize("labels", [("trial", "session"), ("session", "trial")])
def test_recordings_have_sessions_or_their_trials_are_sessions(table, labels):
    table = table.assign(label="riv", recommended=True, trusted=True)
    table = table.assign(**dict(zip(labels, (["1", "2"] * 24, ""), strict=True)))
    kinds = compare(select_comparable(table))["kind"]
    assert "ICC(2,1)" in set(kinds)
    table["trial"] = ""
    table["session"] = ""
    assert "ICC(2,1)" not in set(compare(select_comparable(table))["kind"])
    assert select_comparable(table.assign(subject="")) is None
    assert select_comparable(table[table["subject"] == "a"]) is None


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (["S1_rest.mat", "S1_10MVC.mat", "S2_rest.mat"], "{subject}_{condition}"),
        (["ankle-S1 a-1.h5", "ankle-S2 a-2.h5"], "ankle-{subject} a-{condition}"),
        (["S1_a_1.csv.gz", "S2_b_2.csv.gz"], "{subject}_{condition}_{trial}"),
        (["S1_a.csv", "S2.csv"], None),
        (["S1.csv", "S2.csv"], None),
    ],
)
def test_names_suggest_their_pattern(names, pattern):
    assert suggest_names(names) == pattern


@pytest.mark.parametrize(
    ("pattern", "message"),
    [
        ("{subject}-{condition}", "its name 'S1_rest' has not the form"),
        ("subject", "write the labels in braces"),
        ("{a}_{a}", "each once"),
        ("{a b}", "write the labels in braces"),
    ],
)
def test_wrong_patterns(pattern, message):
    with pytest.raises(DataError, match=message):
        read_labels("S1_rest.mat", pattern)


def test_what_is_said_without_a_difference():
    """Two groups of subjects, and a single condition."""
    table = pd.DataFrame({"subject": list("ABCD"), "condition": ["young", "young", "old", "old"]})
    table["K"] = [100.0, 120.0, 140.0, 130.0]
    sentence = describe_differences(compare(table))
    assert sentence.startswith("No subject has K both in young and in old (groups of subjects")
    sentence = describe_differences(compare(table[[True, False, True, False]], between="subject"))
    assert "cannot be judged" in sentence
    sentence = describe_differences(compare(table[:2]))
    assert sentence == "There are no two conditions with values of K."


def test_groups_of_subjects_have_the_interval_of_welch():
    """The mean of each subject first, then the test of scipy, of which the interval is the same."""
    rng = np.random.default_rng(2)
    table = pd.DataFrame({"subject": list("aabbccdddee"), "group": ["old"] * 6 + ["young"] * 5})
    table["K"] = rng.normal(100.0, 10.0, len(table))
    comparison = compare(table, "group", between="subject")
    (row,) = comparison.query("kind == 'group difference'").to_dict("records")
    subjects = table.groupby(["group", "subject"])["K"].mean()
    expected = stats.ttest_ind(subjects["young"], subjects["old"], equal_var=False)
    interval = expected.confidence_interval()
    assert row["subjects"] == 5
    np.testing.assert_allclose([row["low"], row["high"]], [interval.low, interval.high])
    assert "Welch's 95 % intervals" in describe_differences(comparison)
    with pytest.raises(DataError, match=r"c is in several groups of 'group': compare within"):
        compare(table.replace("d", "c"), "group", between="subject")


def test_needed_subjects_of_two_groups_have_the_power():
    n = int(count_subjects(8.0, 10.0, groups=2))
    draws = np.random.default_rng(1).normal(0.0, 10.0, (2, 4000, n))
    power = np.mean(stats.ttest_ind(draws[0] + 8.0, draws[1], axis=1).pvalue < 0.05)
    assert 0.78 < power < 0.82


def test_the_size_to_show_is_of_those_who_are_compared(table):
    """A subject of a single condition, however different, changes no number of subjects that are needed."""
    expected = of_kind(compare(table), "difference")["needed"]
    other = pd.DataFrame([{"subject": "z", "condition": "rest", "K": 5000.0}])
    unpaired = of_kind(compare(pd.concat([table, other])), "difference")["needed"]
    assert unpaired.to_dict() == expected.to_dict()
