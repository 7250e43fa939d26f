"""Every method by its public face: valid estimates, and refusals that name the fault."""

import control
import numpy as np
import pytest

import ankleloop
from ankleloop import METHODS, evaluate, identify
from ankleloop.joint.estimate_files import EstimateTable, load_estimates
from ankleloop.methods.moesp import MEMBERS

WITHOUT_REFERENCE = ("eiv-moesp", "pi-moesp", "po-moesp", "moesp", "parallel-cascade")


def evaluate_vaf(trial, estimate):
    return evaluate(trial, estimate).set_index(["torque", "against"])["vaf"]


@pytest.mark.parametrize("method", METHODS)
def test_every_method_returns_a_valid_estimate(noisy, method, tmp_path):
    before = noisy.copy(deep=True)
    estimate = identify(noisy, method)
    assert noisy.identical(before)
    assert isinstance(estimate, ankleloop.Estimate)
    assert estimate.method == method

    torque = estimate.torque
    assert set(torque.data_vars) == {"net", "intrinsic", "reflex"}
    assert torque.attrs["identification_rate"] == 100.0
    assert torque["time"].attrs["units"] == "s"
    np.testing.assert_allclose(np.diff(torque["time"]), 0.01, rtol=1e-9)
    assert torque["time"][0] >= 0
    assert torque["time"][-1] < 20.0
    assert torque.sizes["time"] > 1800
    for variable in torque.data_vars.values():
        assert variable.dims == ("time",)
        assert variable.dtype == np.float64
        assert variable.attrs["units"] == "N·m"
        assert np.all(np.isfinite(variable))
    np.testing.assert_allclose(torque["net"], torque["intrinsic"] + torque["reflex"], atol=1e-12)

    assert set(estimate.stiffness) == {"K", "B", "I"}
    assert np.all(np.isfinite(list(estimate.stiffness.values())))
    # A PRBS biases the real-time algorithm.
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.6 if method == "real-time" else 0.25)
    assert estimate.reflex["delay"] == (0.04 if method != "riv" else pytest.approx(0.04, abs=0.005))
    assert all(isinstance(value, float) and np.isfinite(value) for value in estimate.reflex.values())
    assert isinstance(estimate.diagnostics["warnings"], list)
    assert method in repr(estimate)
    assert "N·m/rad" in repr(estimate)
    table = EstimateTable()
    table.add(estimate, point="only", name=method, number=0)
    table.write(tmp_path / "0.parquet")
    assert load_estimates([tmp_path / "0.parquet"], "only", method)[0].stiffness == estimate.stiffness

    result = evaluate_vaf(noisy, estimate)
    assert result["net", "measured"] > 85.0
    assert result["net", "true"] > 95.0


@pytest.mark.parametrize("method", METHODS)
def test_models_are_named_and_in_physical_units(noisy, method):
    model = identify(noisy, method).model
    if model is None:
        assert method not in MEMBERS
        return
    assert isinstance(model, control.StateSpace)
    assert model.dt == pytest.approx(0.01)
    assert model.output_labels == ["torque"]
    assert model.input_labels[:3] == ["position", "velocity", "acceleration"]
    assert model.ninputs == len(model.input_labels) > 3


@pytest.mark.parametrize("method", METHODS)
def test_torques_are_deviations_from_their_means(noisy, method):
    for name, torque in identify(noisy, method).torque.items():
        assert abs(float(torque.mean())) < 1e-9, name


def test_defaults_of_the_method_of_the_paper(noisy):
    diagnostics = identify(noisy, "pr-moesp").diagnostics
    assert diagnostics["instruments"] == "past-reference"
    assert diagnostics["projection"] == "ordinary"
    assert diagnostics["input_matrices"] == "least-squares"
    assert diagnostics["order"] == 2
    assert diagnostics["instrument_rows"] == 15


@pytest.mark.parametrize("method", WITHOUT_REFERENCE)
def test_other_methods_need_no_reference(noisy, method):
    without = identify(noisy.drop_vars("reference"), method)
    np.testing.assert_array_equal(without.torque["net"], identify(noisy, method).torque["net"])
    assert "reference" not in without.diagnostics


@pytest.mark.parametrize("method", METHODS)
def test_an_unknown_option_is_refused_with_the_known_ones(noisy, method):
    with pytest.raises(TypeError, match=f"method '{method}' has no option 'ordre'.*; it has ") as e:
        identify(noisy, method, ordre=3)
    for name in ankleloop.method_options(method):
        assert name in str(e.value)
    assert "method" not in ankleloop.method_options(method)


def test_an_unknown_method_is_refused_with_the_known_ones(noisy):
    for call in (lambda: identify(noisy, "magic"), lambda: ankleloop.method_options("magic")):
        with pytest.raises(ValueError, match="unknown method 'magic'; known: ") as e:
            call()
        for name in METHODS:
            assert name in str(e.value)


def test_the_registry_cannot_be_changed():
    with pytest.raises(TypeError):
        METHODS["magic"] = None


def test_a_method_called_by_itself_is_identify(noisy):
    for name, method in METHODS.items():
        assert method.name == name
        assert method(noisy).torque.identical(identify(noisy, name).torque)
