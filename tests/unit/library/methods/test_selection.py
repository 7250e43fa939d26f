"""Selection on data that the fit has not seen: the truth is preferred, also where the net VAF prefers another model."""

import pytest

from ankleloop import METHODS, DataError, identify, segment, simulate
from ankleloop.methods import registry
from ankleloop.methods.selection import select_options


@pytest.fixture(scope="module")
def trial(clean):
    return clean[13.0]


def choose(trial, method, **options):
    return identify(trial, method, **options).diagnostics["selection"]


@pytest.mark.parametrize("criterion", ["instrumental", "cross-validation"])
def test_the_true_order_is_chosen(trial, criterion):
    estimate = identify(
        trial, "pr-moesp", basis="rectifier", select={"order": [1, 2, 3, 4]}, criterion=criterion
    )
    assert estimate.diagnostics["order"] == 2
    selection = estimate.diagnostics["selection"]
    assert (selection["criterion"], selection["chosen"]) == (criterion, {"order": 2})
    assert [row["order"] for row in selection["candidates"]] == [1, 2, 3, 4]
    first, second = (row["scores"] for row in selection["candidates"][:2])
    assert first[criterion] < 99.5 < 99.99 < second[criterion]
    assert set(first) == {"instrumental", "cross-validation"}


def test_the_true_basis_is_chosen_and_a_superfluous_pole_seldom(trial):
    """It has to be better by more than a standard error, and the record has to show it."""
    assert choose(trial, "riv", select={"basis": ["chebyshev", "rectifier"]})["chosen"] == {
        "basis": "rectifier"
    }
    chosen = [
        choose(simulate(seed=seed), "riv", select={"order": [2, 3]})["chosen"]["order"]
        for seed in range(6)
    ]
    assert chosen.count(2) >= 4


@pytest.mark.parametrize(("warned", "best"), [((), 2), ((2,), 1), ((1, 2), 2)])
def test_a_candidate_with_a_warning_is_chosen_only_if_all_have_one(trial, warned, best):
    def fit(part, order):
        estimate = METHODS["pr-moesp"](part, basis="rectifier", order=order)
        estimate.diagnostics["warnings"] = ["a warning"] * (order in warned)
        return estimate

    selection = select_options(segment(trial, 0.0, 24.0), fit, {"order": [1, 2]})
    assert selection["chosen"] == {"order": best}
    warnings = [row["warnings"] for row in selection["candidates"]]
    assert warnings == [["a warning"] * (order in warned) for order in (1, 2)]


def test_the_instrumental_criterion_prefers_the_truth_where_the_net_vaf_does_not():
    trial, scores = simulate(seed=5, load=(0.1, 10.0, 100.0), reflex_gain=25.0, voluntary=0.3), {}

    def fit(part, method):
        return METHODS[method](part, basis="rectifier")

    for criterion, best in (("instrumental", "riv"), ("cross-validation", "pr-moesp")):
        selection = select_options(trial, fit, {"method": ["pr-moesp", "riv"]}, criterion=criterion)
        scores[criterion] = [row["scores"][criterion] for row in selection["candidates"]]
        assert selection["chosen"] == {"method": best}
    assert scores["instrumental"][1] > scores["instrumental"][0] + 0.5
    assert scores["cross-validation"][1] < scores["cross-validation"][0]


def test_without_a_reference_the_criterion_is_cross_validation(trial):
    bare = trial.drop_vars("reference")
    selection = choose(bare, "pi-moesp", basis="rectifier", select={"order": [1, 2]})
    assert (selection["criterion"], selection["chosen"]) == ("cross-validation", {"order": 2})
    assert set(selection["candidates"][0]["scores"]) == {"cross-validation"}
    with pytest.raises(DataError, match="instrumental criterion needs a reference"):
        identify(bare, "pi-moesp", select={"order": [1]}, criterion="instrumental")


def test_candidates_that_fail_are_reported(trial):
    options = {
        "basis": "rectifier",
        "projection": "correlation",
        "select": {"instrument_rows": [10, None]},
    }
    first, second = choose(trial, "pr-moesp", **options)["candidates"]
    assert first["scores"] == {}
    assert "instrument" in first["error"]
    assert second["scores"]["instrumental"] > 99
    with pytest.raises(DataError, match="no candidate could be fitted"):
        identify(trial, "real-time", select={"memory": [5.0]})
    with pytest.raises(DataError, match="no variable 'gait' for cycle_onsets") as e:
        identify(trial, "riv-tv", cycle_onsets="gait", select={"delay": [0.04, 0.05]})
    assert e.value.remedy == {"variables": None}


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"select": {"ordre": [1]}}, TypeError, "has no option 'ordre'"),
        (
            {"select": {"order": [1, 2]}, "order": 2},
            TypeError,
            "'order' is given, and to be selected as well",
        ),
        ({"select": {"order": []}}, ValueError, "at least one value"),
        (
            {"select": {"order": [1]}, "criterion": "vaf"},
            ValueError,
            "criterion must be one of 'instrum.*'vaf'",
        ),
        (
            {"select": {"identification_rate": [100.0, 50.0]}},
            ValueError,
            "and not of identification_rate",
        ),
        (
            {"select": {"basis": ["rectifier", "spline"], "degree": [5, 3]}},
            ValueError,
            "^select: method 'pr-moesp': degree: a spline basis needs a degree of at least 4",
        ),
        (
            {"select": {"order": [2, 6]}, "block_rows": 5},
            ValueError,
            r"^select: method 'pr-moesp': block_rows must be larger than the order \(6\), got 5",
        ),
    ],
)
def test_invalid_selections_are_refused_before_any_fit(trial, options, error, message, monkeypatch):
    monkeypatch.setattr(registry, "select_options", None)
    with pytest.raises(error, match=message):
        identify(trial, "pr-moesp", **options)


def test_halves_that_cannot_be_compared_are_refused():
    with pytest.raises(DataError, match=r"the record of 7 s is too short: a selection needs 8 s"):
        identify(simulate(seed=1, duration=7.0), "riv", select={"order": [2, 3]})
    trial = simulate(seed=1, variation="time", stiffness_variation=0.4, duration=30.0)
    with pytest.raises(DataError, match="those of one half are not those of the other"):
        identify(trial, "riv-tv", select={"order": [2]})


def test_candidates_whose_estimates_begin_at_different_times_are_compared():
    candidates = {"delay": [0.04, 0.9], "basis": ["rectifier"]}
    assert (
        choose(simulate(seed=1, duration=31.0), "pr-moesp", select=candidates)["chosen"]["delay"]
        == 0.04
    )
