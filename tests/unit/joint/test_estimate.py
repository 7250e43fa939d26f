"""The result of an identification."""

import numpy as np
import pytest

from ankleloop import evaluate, identify, simulate
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.regressors import TORQUES, torque_dataset


def make_estimate(**fields):
    torques = np.random.default_rng(0).standard_normal((3, 50))
    torque = torque_dataset(
        0.35 + np.arange(50) / 100.0, 100.0, **dict(zip(TORQUES, torques, strict=True))
    )
    stiffness = {"K": 150.125, "B": 0.8, "I": 0.1 + 0.2}
    return Estimate("pr-moesp", torque, stiffness, {"delay": 0.04}, **fields)


def test_torques_have_units_and_names():
    torque = make_estimate().torque
    assert torque.attrs == {"identification_rate": 100.0}
    assert torque["time"].attrs == {"units": "s", "long_name": "time"}
    for name in TORQUES:
        assert torque[name].dims == ("time",)
        assert torque[name].attrs == {"units": "N·m", "long_name": f"estimated {name} torque"}


def test_repr_has_intervals_and_warnings():
    intervals, warnings = {"K": (140.0, 160.25), "G": (12.0, 14.0)}, ["unstable", "short"]
    lines = repr(
        make_estimate(intervals=intervals, diagnostics={"warnings": warnings})
    ).splitlines()
    assert lines[0] == "<Estimate by pr-moesp>"
    rows = [line.split() for line in lines[1:6]]
    assert rows[:3] == [
        ["value", "low", "high", "unit"],
        ["K", "150.1", "140", "160.2", "N·m/rad"],
        ["B", "0.8", "–", "–", "N·m·s/rad"],
    ]
    assert lines[6:] == ["  reflex delay: assumed", "  warning: unstable", "  warning: short"]


def test_the_summary_has_a_row_for_each_parameter():
    table = make_estimate(intervals={"K": (140.0, 160.25)}).summary()
    assert table.index.tolist() == ["K", "B", "I", "delay"]
    assert table.loc["K"].tolist() == [150.125, 140.0, 160.25, "N·m/rad"]
    assert table.loc["delay", ["value", "unit"]].tolist() == [0.04, "s"]
    assert table.loc["B", ["low", "high"]].isna().all()


def test_the_measured_torque_stands_beside_the_estimated_ones():
    trial, other = (simulate(seed=seed, duration=12.0) for seed in (1, 2))
    estimate = identify(trial, "riv")
    for each, record in ((estimate, trial), (estimate.predict(other), other)):
        measured = each.torque["measured"]
        assert (measured.attrs["units"], measured.attrs["long_name"]) == ("N·m", "measured torque")
        scores = evaluate(record, each).set_index(["torque", "against"])["vaf"]
        assert each.vaf_net == pytest.approx(scores["net", "measured"], abs=1e-9)
        assert f"net VAF: {each.vaf_net:.1f} %; reflex delay: estimated" in repr(each)
    assert make_estimate().vaf_net is None


def test_the_model_is_a_state_space_of_control():
    estimate = identify(simulate(seed=1, duration=12.0), "pr-moesp", basis="rectifier")
    assert estimate.model is estimate.model
    assert estimate.model.dt == 0.01
    assert estimate.model.input_labels == [
        "position",
        "velocity",
        "acceleration",
        "rectified_velocity",
    ]
    np.testing.assert_array_equal(estimate.model.A, estimate.matrices.A)
    assert make_estimate().model is None
