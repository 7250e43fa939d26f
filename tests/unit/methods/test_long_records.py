import h5py
import numpy as np
import pytest

import ankleloop
from ankleloop.errors import DataError
from ankleloop.joint.regressors import decimated
from ankleloop.methods.long_records import LongRecord, identify_file


@pytest.fixture(scope="module")
def trial():
    return ankleloop.simulate(seed=3, duration=30.0)


@pytest.fixture
def saved(trial, tmp_path):
    ankleloop.save_trial(trial, tmp_path / "trial.nc")
    return tmp_path / "trial.nc"


@pytest.mark.parametrize("chunk", [333, 50_000])
@pytest.mark.parametrize("method", ["pr-moesp", "eiv-moesp"])
def test_the_same_as_in_memory(trial, saved, tmp_path, method, chunk):
    whole = ankleloop.identify(trial, method, basis="rectifier")
    passes = []
    found = identify_file(
        LongRecord(saved),
        tmp_path / "torques.nc",
        method,
        basis="rectifier",
        chunk=chunk,
        progress=lambda name, share: passes.append(name) if share == 1 else None,
    )
    assert passes == ["basis", "pass 1", "pass 2", "torques"]
    for name, value in whole.stiffness.items():
        assert found.stiffness[name] == pytest.approx(value, rel=1e-5)
    for name, value in whole.reflex.items():
        assert found.reflex[name] == pytest.approx(value, rel=1e-4)
    np.testing.assert_allclose(found.torque["time"], whole.torque["time"], atol=1e-9)
    for name in ("net", "intrinsic", "reflex"):
        size = float(np.abs(whole.torque[name]).max())
        np.testing.assert_allclose(found.torque[name], whole.torque[name], atol=1e-5 * size)
        assert found.torque[name].attrs["units"] == "N·m"
    measured = decimated(trial, "torque", whole.torque["time"].values, 100.0)
    assert found.diagnostics["vaf"] == pytest.approx(ankleloop.vaf(measured, whole.torque["net"].values), abs=1e-4)
    assert not found.torque.indexes  # an index of the time would be in memory, all of it
    found.torque.close()


def test_a_file_of_a_laboratory(trial, tmp_path):
    """Degrees, the torque the other way round, names of its own."""
    path = tmp_path / "long.h5"
    with h5py.File(path, "w") as file:
        file["angle"], file["moment"] = np.degrees(trial["position"].values), -trial["torque"].values
        file["command"] = np.degrees(trial["reference"].values)
    names = {"position": "angle", "torque": "moment", "reference": "command"}
    record = LongRecord(path, 1000.0, **names, position_unit="deg", torque_sign=-1)
    found = identify_file(record, tmp_path / "torques.nc", chunk=1000)
    found.torque.close()
    assert found.stiffness["K"] == pytest.approx(ankleloop.identify(trial).stiffness["K"], rel=1e-5)


def test_what_is_wrong_is_said(trial, saved, tmp_path):
    with pytest.raises(DataError, match="there is no variable 'angle'"):
        LongRecord(saved, position="angle")
    with pytest.raises(DataError, match=r"read from \.h5, \.hdf5, \.nc; convert it first"):
        LongRecord(tmp_path / "trial.csv")
    with pytest.raises(DataError, match="long records are identified by"):
        identify_file(LongRecord(saved), tmp_path / "torques.nc", "riv")
    with pytest.raises(DataError, match="needs a reference"):
        identify_file(LongRecord(saved, reference=None), tmp_path / "torques.nc")
    path = tmp_path / "broken.h5"
    with h5py.File(path, "w") as file:
        for name in ("position", "torque", "reference"):
            file[name] = trial[name].values
        file["short"] = np.zeros(5)
        file["torque"][20_345] = np.nan
    with pytest.raises(DataError, match="states no sampling_rate"):
        LongRecord(path)
    with pytest.raises(DataError, match=r"short has shape \(5,\)"):
        LongRecord(path, 1000.0, torque="short")
    with pytest.raises(DataError, match="torque is not finite at sample 20345"):
        identify_file(LongRecord(path, 1000.0), tmp_path / "torques.nc", chunk=500)
    with h5py.File(path, "r+") as file:
        file["position"][20_345] += np.pi
    with pytest.raises(DataError, match=r"^broken.h5: position moves at .* rad/s at sample 2\d{4} .* in degrees"):
        identify_file(LongRecord(path, 1000.0), tmp_path / "torques.nc", chunk=500)
    assert not list(tmp_path.glob("*torques*"))
