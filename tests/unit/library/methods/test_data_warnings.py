"""Data that cannot carry a conclusion: every identification says so, and good data pass without a word."""

import numpy as np
import pytest

from ankleloop import DataError, identify, new_trial, simulate
from ankleloop.methods.method import Method
from ankleloop.methods.registry import JOINT_METHODS


def change(trial, **channels):
    return trial.assign(
        {name: trial[name].copy(data=np.asarray(values)) for name, values in channels.items()}
    )


def draw(trial, scale=1.0):
    return scale * np.random.default_rng(1).standard_normal(trial.sizes["time"])


REFERENCE_FAULTS = {
    "is the torque itself": lambda trial: change(trial, reference=2 - 0.01 * trial["torque"]),
    "reference .*: it is too weak an instrument": lambda trial: change(
        trial, reference=draw(trial)
    ),
}
UNUSABLE = {
    "tiny torque": lambda trial: change(trial, torque=1e-100 * trial["torque"]),
    "huge torque": lambda trial: change(trial, torque=1e100 * trial["torque"]),
    "position out of band": lambda trial: change(
        trial, position=1e-3 * np.sin(2.5 * np.arange(trial.sizes["time"]))
    ),
    "three samples": lambda trial: trial.isel(time=slice(0, 3)),
}


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=3, duration=20.0)


@pytest.mark.parametrize("method", JOINT_METHODS)
def test_every_method_has_the_warnings_of_its_data(trial, method):
    estimate = identify(trial.assign(torque=-trial["torque"]), method)
    assert any("the torque has the other sign" in text for text in estimate.diagnostics["warnings"])
    assert not any("the other sign" in text for text in estimate.fit_warnings)
    assert "data_warnings" not in identify(trial, method).diagnostics
    for apply in UNUSABLE.values():
        with pytest.raises(DataError):
            identify(apply(trial), method)


@pytest.mark.parametrize("words", REFERENCE_FAULTS)
@pytest.mark.parametrize("method", JOINT_METHODS)
def test_a_reference_that_says_nothing_is_refused_by_methods_that_use_it(trial, method, words):
    changed = REFERENCE_FAULTS[words](trial)
    options = JOINT_METHODS[method].options()
    if JOINT_METHODS[method].reference(options) == "reference":
        with pytest.raises(DataError, match=words):
            identify(changed, method)
        assert identify(changed, method, reference="position").stiffness["K"] > 0
    else:
        assert identify(changed, method).torque.identical(identify(trial, method).torque)
        if "input_matrices" in JOINT_METHODS[method].options.model_fields:
            with pytest.raises(DataError, match=words):
                identify(changed, method, input_matrices="instruments")


def test_a_copy_of_the_position_is_no_reference_of_a_closed_loop(trial):
    estimate = identify(trial.assign(reference=trial["position"]), "pr-moesp")
    (warning,) = estimate.diagnostics["data_warnings"]
    assert "reference is a copy of the position" in warning


@pytest.mark.parametrize("method", JOINT_METHODS)
def test_noise_never_gives_an_estimate_without_a_warning(method):
    signals = np.random.default_rng(1).standard_normal((3, 15_000)) * [[0.002], [1.0], [0.02]]
    try:
        estimate = identify(new_trial(*signals[:2], 1000.0, reference=signals[2]), method)
    except DataError:
        return
    assert estimate.diagnostics["data_warnings"]
    assert np.isfinite([*estimate.stiffness.values(), *estimate.reflex.values()]).all()


def test_a_velocity_that_is_never_positive_has_no_reflex():
    t = np.arange(20_000) / 1000.0
    torque = np.random.default_rng(1).standard_normal(t.size)
    with pytest.raises(DataError, match="velocity is never positive"):
        identify(
            new_trial(-0.01 * t + 1e-5 * np.sin(9 * t) / 9, torque, 1000.0), "parallel-cascade"
        )


@pytest.mark.parametrize(
    ("value", "words"), [(np.nan, "I could not be computed"), (-1.0, "I = -1 kg·m² is negative")]
)
def test_a_parameter_that_no_joint_has_is_a_warning(trial, value, words):
    method = JOINT_METHODS["parallel-cascade"]

    def identify_wrongly(prepared, options):
        estimate = method.identify(prepared, options)
        estimate.stiffness["I"] = value
        return estimate

    estimate = Method("wrong", method.options, identify_wrongly)(trial)
    assert words in estimate.diagnostics["warnings"][-1]


def test_the_warning_names_the_merged_trial():
    trials = [simulate(seed=seed, duration=8.0) for seed in range(3)]
    assert "data_warnings" not in identify(trials, "pr-moesp").diagnostics
    trials[1] = trials[1].assign(torque=-trials[1]["torque"])
    (warning,) = identify(trials, "pr-moesp").diagnostics["data_warnings"]
    assert warning.startswith("trial 2 of 3: a second-order model")
    trials = [simulate(seed=seed, duration=16.0) for seed in range(2)]
    with pytest.raises(DataError, match="too weak an instrument"):
        identify([trials[0], trials[1].assign(reference=trials[0]["reference"])], "pr-moesp")


def test_the_sign_of_the_torque_is_not_told_where_the_reference_is_weak():
    """Least squares turn it where a subject pushes as hard as the joint does, and riv is right."""
    trial = simulate(
        seed=101,
        duration=24.0,
        load=(1.1, 7.1, 250.0),
        torque_level=5.015,
        perturbation="pulses",
        pulse_length=0.04,
        voluntary=1.0,
    )
    estimate = identify(trial, "riv")
    assert estimate.warnings == []
    low, high = estimate.intervals["K"]
    assert low < 150.0 < high
