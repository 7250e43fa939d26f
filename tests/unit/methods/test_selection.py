"""Selection on data that the fit has not seen: the truth is preferred, also where the net VAF prefers another model."""

import numpy as np
import pytest

from ankleloop import METHODS, DataError, evaluate, identify, segment, simulate
from ankleloop.joint.prepared import prepare
from ankleloop.methods.selection import select_options


@pytest.fixture(scope="module")
def clean():
    return simulate(seed=1, snr_db=None, voluntary=0.0)


@pytest.mark.parametrize("criterion", ["instrumental", "cross-validation"])
def test_the_true_order_is_chosen(clean, criterion):
    estimate = identify(clean, "pr-moesp", basis="rectifier", select={"order": [1, 2, 3, 4]}, criterion=criterion)
    assert estimate.diagnostics["order"] == 2
    selection = estimate.diagnostics["selection"]
    assert selection["criterion"] == criterion
    assert selection["chosen"] == {"order": 2}
    assert [row["order"] for row in selection["candidates"]] == [1, 2, 3, 4]
    assert (
        selection["candidates"][0]["scores"][criterion] < 99.5 < 99.99 < selection["candidates"][1]["scores"][criterion]
    )
    assert set(selection["candidates"][0]["scores"]) == {"instrumental", "cross-validation"}


def test_the_true_basis_is_chosen(clean):
    estimate = identify(clean, "riv", select={"basis": ["chebyshev", "rectifier"]})
    assert estimate.diagnostics["selection"]["chosen"] == {"basis": "rectifier"}
    assert estimate.reflex["G"] == pytest.approx(13.0, rel=0.01)


def test_a_superfluous_pole_is_seldom_chosen():
    """It has to be better by more than a standard error, and the record has to show it."""
    chosen = [
        identify(simulate(seed=seed), "riv", select={"order": [2, 3]}).diagnostics["selection"]["chosen"]["order"]
        for seed in range(6)
    ]
    assert chosen.count(2) >= 4


def test_a_candidate_with_a_warning_is_chosen_only_if_all_have_one():
    def fit(part, order):
        estimate = METHODS["pr-moesp"](part, basis="rectifier", order=order)
        estimate.diagnostics["warnings"] = ["a warning"] if order in warned else []
        return estimate

    trial = simulate(seed=4, duration=24.0, snr_db=None, voluntary=0.0)
    warned = ()
    assert select_options(trial, fit, {"order": [1, 2]}).chosen == {"order": 2}
    warned = (2,)
    selection = select_options(trial, fit, {"order": [1, 2]})
    assert selection.chosen == {"order": 1}
    assert [row["warnings"] for row in selection.candidates] == [[], ["a warning"]]
    warned = (1, 2)
    assert select_options(trial, fit, {"order": [1, 2]}).chosen == {"order": 2}


def test_the_instrumental_criterion_prefers_the_truth_where_the_net_vaf_does_not():
    trial = simulate(seed=5, load=(0.1, 10.0, 100.0), reflex_gain=25.0, voluntary=0.3)

    def fit(part, method):
        return METHODS[method](part, basis="rectifier")

    scores = {}
    for criterion in ("instrumental", "cross-validation"):
        selection = select_options(trial, fit, {"method": ["pr-moesp", "riv"]}, criterion=criterion)
        scores[criterion] = [row["scores"][criterion] for row in selection.candidates]
        assert selection.chosen == {"method": "riv" if criterion == "instrumental" else "pr-moesp"}
    assert scores["instrumental"][1] > scores["instrumental"][0] + 0.5
    assert scores["cross-validation"][1] < scores["cross-validation"][0]


def test_without_a_reference_the_criterion_is_cross_validation(clean):
    estimate = identify(clean.drop_vars("reference"), "pi-moesp", basis="rectifier", select={"order": [1, 2]})
    assert estimate.diagnostics["selection"]["criterion"] == "cross-validation"
    assert set(estimate.diagnostics["selection"]["candidates"][0]["scores"]) == {"cross-validation"}
    with pytest.raises(DataError, match="instrumental criterion needs a reference"):
        identify(clean.drop_vars("reference"), "pi-moesp", select={"order": [1]}, criterion="instrumental")
    assert estimate.diagnostics["selection"]["chosen"] == {"order": 2}


def test_candidates_that_fail_are_reported(clean):
    rows = {"instrument_rows": [10, None]}
    estimate = identify(clean, "pr-moesp", select=rows, basis="rectifier", projection="correlation")
    first, second = estimate.diagnostics["selection"]["candidates"]
    assert first["scores"] == {}
    assert "instrument" in first["error"]
    assert second["scores"]["instrumental"] > 99
    with pytest.raises(DataError, match="no candidate could be fitted"):
        identify(clean, "real-time", select={"memory": [5.0]})


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"select": {"ordre": [1]}}, TypeError, "has no option 'ordre'"),
        ({"select": {"order": [1, 2]}, "order": 2}, TypeError, "'order' is given, and to be selected as well"),
        ({"select": {"order": []}}, ValueError, "at least one value"),
        ({"select": {"order": [1]}, "criterion": "vaf"}, ValueError, "criterion must be one of 'instrum.*'vaf'"),
    ],
)
def test_invalid_selections_are_refused(clean, options, error, message):
    with pytest.raises(error, match=message):
        identify(clean, "pr-moesp", **options)


def test_a_prepared_trial_gives_the_same_selection():
    trial = simulate(seed=2, duration=20.0)
    candidates = {"basis": ["rectifier", "chebyshev"], "order": [1, 2]}
    expected, estimate = (identify(part, "pr-moesp", select=candidates) for part in (trial, prepare(trial)))
    assert estimate.torque.identical(expected.torque)
    assert estimate.diagnostics["selection"] == expected.diagnostics["selection"]
    assert len(estimate.diagnostics["selection"]["candidates"]) == 4


@pytest.mark.parametrize(
    ("method", "options", "accuracy"),
    [
        ("pr-moesp", {"basis": "rectifier"}, 99.9),
        ("eiv-moesp", {"basis": "spline", "degree": 8}, 99.5),
        ("parallel-cascade", {}, 99.9),
        ("riv", {}, 99.99),
    ],
)
def test_estimates_predict_records_that_they_have_not_seen(clean, method, options, accuracy):
    first, second = segment(clean, 0.0, 25.0), segment(clean, 25.0, 50.0)
    estimate = identify(first, method, **options)
    prediction = estimate.predict(second)
    assert prediction.torque["time"][0] >= 25.0
    assert evaluate(second, prediction).query("against == 'true'")["vaf"].min() > accuracy
    # On the record of the fit a prediction from rest is the fit, except at its beginning.
    again = estimate.predict(first).torque["net"].sel(time=estimate.torque["time"], method="nearest", tolerance=1e-6)
    late = slice(100, None)
    difference = (again - estimate.torque["net"].values).values[late]
    assert np.ptp(difference) < 1e-3 * np.ptp(again.values)


def test_methods_without_a_model_do_not_predict(clean):
    with pytest.raises(DataError, match="model to predict with"):
        identify(clean, "real-time").predict(clean)


def test_the_parts_of_a_record_are_prepared_once():
    trial, fits = simulate(seed=4, duration=24.0), []

    def fit(part, **options):
        fits.append(part)
        return METHODS["pr-moesp"](part, basis="rectifier", **options)

    select_options(trial, fit, {"order": [1, 2, 3]})
    assert len(fits) == 6
    assert fits[0] is fits[2] is fits[4]
    assert fits[1] is fits[3] is fits[5]


def test_rates_are_not_compared(clean):
    with pytest.raises(ValueError, match="identification_rate cannot be selected"):
        identify(clean, "pr-moesp", select={"identification_rate": [100.0, 50.0]})


def test_folds_that_are_too_short_are_refused():
    with pytest.raises(
        DataError, match=r"the record of 7 s makes 2 folds of 3.5 s, but a selection needs folds of 4 s"
    ):
        identify(simulate(seed=1, duration=7.0), "riv", select={"order": [2, 3]})


def test_candidates_whose_estimates_begin_at_different_times_are_compared():
    candidates = {"delay": [0.04, 0.9], "basis": ["rectifier"]}
    selection = identify(simulate(seed=1, duration=31.0), "pr-moesp", select=candidates).diagnostics["selection"]
    assert selection["chosen"]["delay"] == 0.04


@pytest.mark.parametrize("error", [np.linalg.LinAlgError("no convergence"), FloatingPointError("no convergence")])
def test_a_numerical_error_is_that_of_its_candidate(error):
    def fit(part, order):
        if order == 3:
            raise error
        return METHODS["pr-moesp"](part, basis="rectifier", order=order)

    selection = select_options(simulate(seed=4, duration=24.0), fit, {"order": [2, 3]})
    assert selection.chosen == {"order": 2}
    assert selection.candidates[1] == {"order": 3, "scores": {}, "warnings": [], "error": "no convergence"}


def test_parameters_over_time_are_not_selected_on_another_half():
    trial = simulate(seed=1, variation="time", stiffness_variation=0.4, duration=60.0)
    with pytest.raises(DataError, match="those of one half are not those of the other"):
        identify(trial, "riv-tv", select={"order": [2, 3]})
