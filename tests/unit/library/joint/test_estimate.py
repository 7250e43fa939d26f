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
