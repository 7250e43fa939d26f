"""Every method by its public face: valid estimates, and refusals that name the fault."""

import control
import numpy as np
import pytest
from method_options import list_one_pass

from ankleloop import evaluate, identify
from ankleloop.methods.registry import JOINT_METHODS

WITH_MODEL = ("riv", "pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp", "moesp")
WITHOUT_REFERENCE = ("eiv-moesp", "pi-moesp", "po-moesp", "moesp", "parallel-cascade")


@pytest.mark.parametrize("method", JOINT_METHODS)
def test_every_method_returns_a_valid_estimate(noisy, method):
    before = noisy.copy(deep=True)
    estimate = identify(noisy, method)
    assert noisy.identical(before)
    assert estimate.method == method
    torque = estimate.torque
    assert set(torque.data_vars) == {"net", "intrinsic", "reflex", "measured"}
    assert torque.attrs["identification_rate"] == 100.0
    assert torque["time"].attrs["units"] == "s"
    np.testing.assert_allclose(np.diff(torque["time"]), 0.01, rtol=1e-9)
    assert 0 <= torque["time"][0] < torque["time"][-1] < 20.0
    assert torque.sizes["time"] > 1800
    assert all(abs(float(variable.mean())) < 1e-9 for variable in torque.values())
    np.testing.assert_allclose(torque["net"], torque["intrinsic"] + torque["reflex"], atol=1e-12)

    assert set(estimate.stiffness) == {"K", "B", "I"}
    # A PRBS biases methods of one pass.
    error = 0.6 if method in list_one_pass() else 0.25
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=error)
    is_estimated = "delay" in estimate.intervals
    assert estimate.reflex["delay"] == pytest.approx(0.04, abs=0.005 if is_estimated else 0.0)
    values = [*estimate.stiffness.values(), *estimate.reflex.values()]
    assert all(isinstance(value, float) and np.isfinite(value) for value in values)
    scores = evaluate(noisy, estimate).set_index(["torque", "against"])["vaf"]
    assert scores["net", "measured"] > 85.0
    assert scores["net", "true"] > 95.0
    model = estimate.model
    assert model is not None or method not in WITH_MODEL
    if model is not None:
        assert isinstance(model, control.StateSpace)
        assert model.dt == pytest.approx(0.01)
        assert model.output_labels == ["torque"]
        assert model.input_labels[:3] == ["position", "velocity", "acceleration"]
        assert model.ninputs == len(model.input_labels) > 3


@pytest.mark.parametrize("method", WITHOUT_REFERENCE)
def test_other_methods_need_no_reference(noisy, method):
    without = identify(noisy.drop_vars("reference"), method)
    np.testing.assert_array_equal(without.torque["net"], identify(noisy, method).torque["net"])
    assert "reference" not in without.diagnostics
