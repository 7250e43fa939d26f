"""Identification chunk by chunk against identification in memory."""

import h5py
import numpy as np
import pytest

import ankleloop
from ankleloop import DataError, LongRecord, identify_file
from ankleloop.joint.prepared import prepare


@pytest.fixture(scope="module")
def trial():
    return ankleloop.simulate(seed=3, duration=30.0)


@pytest.fixture
def saved(trial, tmp_path):
    ankleloop.save_trial(trial, tmp_path / "trial.nc")
    return tmp_path / "trial.nc"


@pytest.mark.parametrize("chunk", [333, 50_000])
@pytest.mark.parametrize("method", ["pr-moesp", "eiv-moesp"])
def test_the_estimate_is_that_in_memory(trial, saved, tmp_path, method, chunk):
    whole = ankleloop.identify(trial, method, basis="rectifier")
    passes = []
    estimate = identify_file(
        LongRecord(saved),
        tmp_path / "torques.nc",
        method,
        basis="rectifier",
        chunk=chunk,
        progress=lambda name, share: passes.append(name) if share == 1 else None,
    )
    assert passes == ["basis", "pass 1", "pass 2", "torques"]
    for name, value in whole.stiffness.items():
        assert estimate.stiffness[name] == pytest.approx(value, rel=1e-5)
    for name, value in whole.reflex.items():
        assert estimate.reflex[name] == pytest.approx(value, rel=1e-4)
    np.testing.assert_allclose(estimate.torque["time"], whole.torque["time"], atol=1e-9)
    for name in ("net", "intrinsic", "reflex"):
        size = float(np.abs(whole.torque[name]).max())
        np.testing.assert_allclose(estimate.torque[name], whole.torque[name], atol=1e-5 * size)
        assert estimate.torque[name].attrs["units"] == "N·m"
    measured = prepare(trial).channel_at("torque", whole.torque["time"].values, 100.0)
    assert estimate.diagnostics["vaf"] == pytest.approx(ankleloop.vaf(measured, whole.torque["net"].values), abs=1e-4)
    assert not estimate.torque.indexes  # an index of the time would be in memory as a whole
    estimate.torque.close()


def test_a_record_in_degrees_with_other_names_and_another_sign_of_the_torque(trial, tmp_path):
    path = tmp_path / "long.h5"
    with h5py.File(path, "w") as file:
        file["angle"], file["moment"] = np.degrees(trial["position"].values), -trial["torque"].values
        file["command"] = np.degrees(trial["reference"].values)
    names = {"position": "angle", "torque": "moment", "reference": "command"}
    record = LongRecord(path, 1000.0, **names, position_unit="deg", torque_sign=-1)
    estimate = identify_file(record, tmp_path / "torques.nc", chunk=1000)
    estimate.torque.close()
    assert estimate.stiffness["K"] == pytest.approx(ankleloop.identify(trial).stiffness["K"], rel=1e-5)


def write_record(path, trial, **variables):
    with h5py.File(path, "w") as file:
        for name in ("position", "torque", "reference"):
            file[name] = variables.get(name, trial[name].values)


def test_invalid_records_are_refused(trial, saved, tmp_path):
    with pytest.raises(DataError, match="there is no variable 'angle'"):
        LongRecord(saved, position="angle")
    with pytest.raises(DataError, match=r"read from \.h5, \.hdf5, \.nc; convert it first"):
        LongRecord(tmp_path / "trial.csv")
    path = tmp_path / "broken.h5"
    write_record(path, trial, torque=np.zeros(5))
    with pytest.raises(DataError, match=r"torque has shape \(5,\)"):
        LongRecord(path, 1000.0)
    with pytest.raises(DataError, match="states no sampling_rate"):
        LongRecord(path, torque="position")
    with pytest.raises(DataError, match="position_sign must be one of 1 or -1; got 2"):
        LongRecord(saved, position_sign=2)


def test_methods_and_options_without_use_for_long_records_are_refused(saved, tmp_path):
    torques = tmp_path / "torques.nc"
    with pytest.raises(DataError, match=r"long records are identified by pr-moesp, .*, not by 'riv'"):
        identify_file(LongRecord(saved), torques, "riv")
    with pytest.raises(DataError, match="needs a reference"):
        identify_file(LongRecord(saved, reference=None), torques)
    with pytest.raises(TypeError, match="method 'pr-moesp' of long records has no option 'free_b'; it has order, "):
        identify_file(LongRecord(saved), torques, free_b=True)
    with pytest.raises(ValueError, match=r"^block_rows must be at least 3 samples, got 2\.$"):
        identify_file(LongRecord(saved), torques, block_rows=2)
    assert not list(tmp_path.glob("*torques*"))


def test_invalid_samples_are_refused_wherever_they_are(trial, tmp_path):
    path, torques = tmp_path / "broken.h5", tmp_path / "torques.nc"
    torque, position = trial["torque"].values.copy(), trial["position"].values.copy()
    torque[20_345] = np.nan
    write_record(path, trial, torque=torque)
    with pytest.raises(DataError, match="torque is not finite at sample 20345"):
        identify_file(LongRecord(path, 1000.0), torques, chunk=500)
    position[20_345] += np.pi
    write_record(path, trial, position=position)
    with pytest.raises(DataError, match=r"^broken.h5: position moves at .* rad/s at sample 2\d{4} .* in degrees"):
        identify_file(LongRecord(path, 1000.0), torques, chunk=500)
    assert not list(tmp_path.glob("*torques*"))


def test_a_part_of_a_record(trial, saved):
    record = LongRecord(saved)
    assert (record.sampling_rate, record.rate, record.samples) == (1000.0, 1000.0, trial.sizes["time"])
    part = record.read(100, 200, ["torque"])
    assert list(part.data_vars) == ["torque"]
    np.testing.assert_array_equal(part["torque"], trial["torque"][100:200])
    np.testing.assert_allclose(part["time"], trial["time"][100:200], atol=1e-12)
    assert set(record.read(29_990, 30_100).data_vars) == {"position", "torque", "reference"}
    assert record.read(29_990, 30_100).sizes["time"] == 10
