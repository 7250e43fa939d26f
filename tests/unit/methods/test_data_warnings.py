"""Data that cannot carry a conclusion: every identification says so, and good data pass without a word."""

import numpy as np
import pytest
from recording_faults import FAULTS, REFERENCE_FAULTS, UNUSABLE

from ankleloop import METHODS, DataError, identify, new_trial, segment, simulate
from ankleloop.joint.prepared import prepare
from ankleloop.methods.method import Method
from ankleloop.methods.selection import select_options

WITH_REFERENCE = ("pr-moesp", "riv", "riv-tv")


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=3, duration=20.0)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_a_warning_that_names_it(trial, fault):
    change, words = FAULTS[fault]
    estimate = identify(change(trial, np.random.default_rng(1)), "eiv-moesp")
    warnings = estimate.diagnostics["data_warnings"]
    assert set(warnings) <= set(estimate.diagnostics["warnings"])
    assert any(words in text for text in warnings), warnings
    assert estimate.fit_warnings == [text for text in estimate.diagnostics["warnings"] if text not in warnings]


@pytest.mark.parametrize("method", METHODS)
def test_every_method_has_the_warnings_of_its_data(trial, method):
    estimate = identify(trial.assign(torque=-trial["torque"]), method)
    assert any("the torque has the other sign" in text for text in estimate.diagnostics["warnings"])
    assert "data_warnings" not in identify(trial, method).diagnostics


@pytest.mark.parametrize("fault", REFERENCE_FAULTS)
@pytest.mark.parametrize("method", METHODS)
def test_a_reference_that_says_nothing_is_refused_by_methods_that_use_it(trial, method, fault):
    change, words = REFERENCE_FAULTS[fault]
    changed = change(trial, np.random.default_rng(1))
    if method in WITH_REFERENCE:
        with pytest.raises(DataError, match=words):
            identify(changed, method)
        assert identify(changed, method, reference="position").stiffness["K"] > 0
    else:
        assert identify(changed, method).torque.identical(identify(trial, method).torque)
        if "input_matrices" in METHODS[method].options.model_fields:
            with pytest.raises(DataError, match=words):
                identify(changed, method, input_matrices="instruments")


def test_a_copy_of_the_position_is_no_reference_of_a_closed_loop(trial):
    estimate = identify(trial.assign(reference=trial["position"]), "pr-moesp")
    (warning,) = estimate.diagnostics["data_warnings"]
    assert "reference is a copy of the position" in warning


@pytest.mark.parametrize("data", UNUSABLE)
@pytest.mark.parametrize("method", METHODS)
def test_what_cannot_be_computed_with_is_refused(trial, method, data):
    with pytest.raises(DataError):
        identify(UNUSABLE[data](trial), method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", [1, 2])
def test_noise_never_gives_an_estimate_without_a_warning(method, seed):
    rng = np.random.default_rng(seed)
    position, torque, reference = rng.standard_normal((3, 15_000)) * [[0.002], [1.0], [0.02]]
    try:
        estimate = identify(new_trial(position, torque, 1000.0, reference=reference), method)
    except DataError:
        return
    assert estimate.diagnostics["data_warnings"]
    assert np.isfinite([*estimate.stiffness.values(), *estimate.reflex.values()]).all()


def test_a_velocity_that_is_never_positive_has_no_reflex():
    t = np.arange(20_000) / 1000.0
    position = -0.01 * t + 1e-5 * np.sin(9 * t) / 9
    torque = np.random.default_rng(1).standard_normal(t.size)
    with pytest.raises(DataError, match="velocity is never positive"):
        identify(new_trial(position, torque, 1000.0), "parallel-cascade")


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_a_parameter_that_no_joint_has_is_a_warning(trial, value):
    method = METHODS["parallel-cascade"]

    def identify_wrongly(prepared, options):
        estimate = method.identify(prepared, options)
        estimate.stiffness["I"] = value
        return estimate

    estimate = Method("wrong", method.options, identify_wrongly)(trial)
    *_, warning = estimate.diagnostics["warnings"]
    assert ("I = -1 kg·m² is negative" if value < 0 else "I could not be computed") in warning


def test_the_warning_names_the_merged_trial():
    trials = [simulate(seed=seed, duration=8.0) for seed in range(3)]
    for estimate in identify(trials, "pr-moesp"):
        assert "data_warnings" not in estimate.diagnostics
    trials[1] = trials[1].assign(torque=-trials[1]["torque"])
    estimates = identify(trials, "pr-moesp")
    for estimate in estimates:
        (warning,) = estimate.diagnostics["data_warnings"]
        assert warning.startswith("trial 2 of 3: a second-order model")
    trials = [simulate(seed=seed, duration=16.0) for seed in range(2)]
    trials[1] = trials[1].assign(reference=trials[0]["reference"])
    with pytest.raises(DataError, match="too weak an instrument"):
        identify(trials, "pr-moesp")


def test_sinusoids_of_merged_trials_excite_together():
    """Alone each of them excites two directions; together they excite what the model needs."""
    t = np.arange(10_000) / 1000.0
    trials = []
    for k in range(16):
        omega = 2 * np.pi * (0.8 + 2.1 * k)
        position = 0.02 / (1 + k) * np.sin(omega * t)
        velocity, acceleration = np.gradient(position, t), -(omega**2) * position
        trials.append(new_trial(position, 150 * position + 0.8 * velocity + 0.015 * acceleration, 1000.0))
    for count, expected in ((1, True), (16, False)):
        estimates = identify(trials[:count], "moesp", basis="rectifier")
        texts = estimates[0].diagnostics.get("data_warnings", ())
        assert any("excites" in text for text in texts) == expected


def test_a_warning_about_the_data_does_not_hide_one_about_a_fit(trial):
    """Both candidates have the first one; only the fit without the second one is chosen."""
    clipped = trial.assign(torque=trial["torque"].clip(max=float(trial["torque"].quantile(0.8))))

    def fit(part, order):
        estimate = identify(part, "eiv-moesp", order=2)
        if order == 1:
            estimate.diagnostics["warnings"].append("not converged")
        return estimate

    selection = select_options(clipped, fit, {"order": [1, 2]})
    assert [row["warnings"] for row in selection.candidates] == [["not converged"], []]
    assert selection.chosen == {"order": 2}


def test_each_check_is_made_once_for_all_methods(trial, monkeypatch):
    from ankleloop.checks import data as data_checks

    calls = []

    def count(*values, check=data_checks.check_signals):
        calls.append(1)
        return check(*values)

    monkeypatch.setattr(data_checks, "check_signals", count)
    prepared = prepare(segment(trial, 0.0, 10.0))
    for method in ("pr-moesp", "eiv-moesp", "parallel-cascade", "riv"):
        identify(prepared, method)
    assert len(calls) == 1
