"""The result of an identification."""

from dataclasses import replace

import numpy as np
import pytest

from ankleloop import DataError, evaluate, identify, simulate
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


def test_values_tables_and_residual_of_an_estimate():
    trial = simulate(seed=1, duration=20.0)
    estimate = identify(trial, "riv")
    table = estimate.params
    assert estimate["K"] == estimate.stiffness["K"] == table.value["K"]
    assert estimate["omega_n"] == estimate.reflex["omega_n"]
    np.testing.assert_array_equal(table.low, [estimate.intervals[name][0] for name in table.index])
    linear = table.loc[["K", "B", "I", "G"]]
    np.testing.assert_allclose(linear.high - linear.value, 1.96 * linear.standard_error, rtol=1e-3)
    assert table.unit["B"] == "N·m·s/rad"
    with pytest.raises(KeyError, match=r"no 'omega' \(did you mean 'omega_n'\?\); there are K, B"):
        estimate["omega"]
    torques = estimate.to_dataframe()
    assert torques.index.name == "time"
    np.testing.assert_array_equal(estimate.residual, torques.measured - torques.net)
    cascade = identify(trial, "parallel-cascade").params
    assert cascade[["standard_error", "low", "high"]].isna().all(axis=None)
    stored = replace(estimate, torque=estimate.torque.drop_vars("measured"))
    with pytest.raises(DataError, match="an estimate of a study holds no measured torque"):
        _ = stored.residual
