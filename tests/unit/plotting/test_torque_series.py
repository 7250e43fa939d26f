"""Series of torques agree with the estimates and with the trial, and stay within their numbers."""

import numpy as np
import pytest

import ankleloop
from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import TORQUES
from ankleloop.plotting.torque_series import TorqueSeries, Trace, centre_torques, limit_values, torque_series

METHODS = ("riv", "parallel-cascade")


@pytest.fixture(scope="module")
def trial():
    return ankleloop.simulate(seed=1, duration=20.0)


@pytest.fixture(scope="module")
def estimates(trial):
    return {name: ankleloop.identify(trial, name) for name in METHODS}


def series_of(trial, estimates):
    return {item.label: item for item in torque_series(trial, estimates)}


def test_estimates_are_centred_and_residuals_are_what_they_leave(trial, estimates):
    series = series_of(trial, estimates)
    true = series["true (simulated)"].traces
    for name in METHODS:
        estimate, residual = series[name], series[f"residual of {name}"]
        for torque in TORQUES:
            values = estimates[name].torque[torque].values
            np.testing.assert_allclose(estimate.traces[torque].low, values - values.mean(), atol=1e-5)
        if estimate.traces["net"].low.size == true["net"].low.size:
            for torque in ("intrinsic", "reflex"):
                total = estimate.traces[torque].low + residual.traces[torque].low
                np.testing.assert_allclose(total, true[torque].low, atol=1e-4)
            total = estimate.traces["net"].low + residual.traces["net"].low
            np.testing.assert_allclose(total, series["measured"].traces["net"].low, atol=1e-4)
        assert estimate.traces["net"].start == pytest.approx(float(estimates[name].torque["time"][0]))


def test_torques_have_no_mean_and_are_those_of_the_trial(trial, estimates):
    prepared, estimate = prepare(trial), estimates["riv"]
    torques = centre_torques(prepared, estimate)
    for values in (torques.measured, *torques.true.values(), *torques.estimated.values()):
        assert values.shape == torques.time.shape
        assert abs(values.mean()) < 1e-9
    time, rate = estimate.torque["time"].values, estimate.torque.attrs["identification_rate"]
    for channel, values in (("torque", torques.measured), ("torque_reflex", torques.true["reflex"])):
        expected = prepared.channel_at(channel, time, rate)
        np.testing.assert_allclose(values, expected - expected.mean(), atol=1e-12)
    assert centre_torques(prepare(trial.drop_vars(["torque_intrinsic", "torque_reflex"])), estimate).true == {}


def test_the_true_net_torque_is_the_sum_of_its_parts(trial, estimates):
    traces = series_of(trial, estimates)["true (simulated)"].traces
    np.testing.assert_allclose(traces["net"].low, traces["intrinsic"].low + traces["reflex"].low, atol=1e-4)


def test_a_recording_has_no_true_torques_and_a_residual_of_the_net_torque_alone(trial, estimates):
    recording = trial.drop_vars([name for name in trial.data_vars if str(name).startswith("torque_")])
    series = series_of(recording, estimates)
    assert [item.kind for item in series.values()] == ["measured", *["estimate"] * 2, *["residual"] * 2]
    assert list(series["residual of riv"].traces) == ["net"]


@pytest.mark.parametrize("most", [100, 999, 5000])
@pytest.mark.parametrize("size", [1, 400, 1001])
def test_numbers_are_limited_and_peaks_stay(size, most):
    samples = np.random.default_rng(1).normal(size=size).astype(np.float32)
    series = [
        TorqueSeries(str(n), "estimate", "#000000", {"net": Trace(1.0, 0.01, samples, samples)}) for n in range(4)
    ]
    limited = limit_values(series, most)
    traces = [item.traces["net"] for item in limited]
    assert sum(trace.values for trace in traces) <= most
    for trace in traces:
        assert trace.start == 1.0
        assert trace.high.max() == samples.max()
        assert trace.low.min() == samples.min()
        assert trace.sampled == (4 * size <= most)
        width = round(trace.step / 0.01)
        assert trace.low.size == -(-size // width) if not trace.sampled else width == 1
