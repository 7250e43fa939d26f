"""Identification chunk by chunk against identification in memory."""

import numpy as np
import pytest

import ankleloop
from ankleloop import DataError, LongRecord, identify_file
from ankleloop.joint.prepared import prepare
from ankleloop.methods import long_records


@pytest.fixture(scope="module")
def trial():
    return ankleloop.simulate(seed=3, duration=30.0)


@pytest.fixture(scope="module")
def saved(trial, tmp_path_factory):
    path = tmp_path_factory.mktemp("records") / "trial.nc"
    ankleloop.save_trial(trial, path)
    return path


def assert_equal(estimate, whole):
    """Parameters and torques are those of an estimate in memory; closes the file."""
    assert estimate.stiffness == pytest.approx(whole.stiffness, rel=1e-5)
    assert estimate.reflex == pytest.approx(whole.reflex, rel=1e-4)
    with estimate.torque as torque:
        np.testing.assert_allclose(torque["time"], whole.torque["time"], atol=1e-9)
        for name in ("net", "intrinsic", "reflex"):
            size = float(np.abs(whole.torque[name]).max())
            np.testing.assert_allclose(torque[name], whole.torque[name], atol=1e-5 * size)
            assert torque[name].attrs["units"] == "N·m"


@pytest.mark.parametrize(
    "chunk", [61, 50_000]
)  # the first is shorter than the margins of the filters
@pytest.mark.parametrize("method", ["pr-moesp", "eiv-moesp"])
def test_the_estimate_is_that_in_memory(trial, saved, tmp_path, method, chunk):
    whole = ankleloop.identify(trial, method, basis="rectifier")
    estimate = identify_file(
        LongRecord(saved), tmp_path / "torques.nc", method, basis="rectifier", chunk=chunk
    )
    assert not estimate.torque.indexes  # an index of the time would be in memory as a whole
    assert_equal(estimate, whole)
    measured = prepare(trial).channel_at("torque", whole.torque["time"].values, 100.0)
    assert estimate.diagnostics["vaf"] == pytest.approx(
        ankleloop.vaf(measured, whole.torque["net"].values), abs=1e-4
    )


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (
            {"method": "riv"},
            DataError,
            r"long records are identified by pr-moesp, .*, not by the method 'riv'",
        ),
        ({"free_b": True}, TypeError, "'pr-moesp' of long records has no option 'free_b'; it has "),
        ({"block_rows": 2}, ValueError, r"block_rows must be .* 3 .*samples, got 2\.$"),
        ({"chunk": 0}, ValueError, r"chunk must be .* 1 .*samples?, got 0"),
    ],
)
def test_methods_and_options_without_use_for_long_records_are_refused(
    saved, tmp_path, options, error, message
):
    with pytest.raises(error, match=message):
        identify_file(LongRecord(saved), tmp_path / "torques.nc", **options)
    assert not list(tmp_path.glob("*torques*"))


def test_records_without_use_are_refused(saved, tmp_path):
    with pytest.raises(DataError, match="needs a reference"):
        identify_file(LongRecord(saved, reference=None), tmp_path / "torques.nc")
    with pytest.raises(
        TypeError,
        match=r"record must be an ankleloop.LongRecord, got .*Path: identify takes trials",
    ):
        identify_file(saved, tmp_path / "torques.nc")


def test_faults_of_the_data_are_warnings_with_the_times_of_their_part(tmp_path, monkeypatch):
    """What identify says of a trial, a long record says of its parts."""
    monkeypatch.setattr(long_records, "CHECKED_SAMPLES", 1000)
    data = ankleloop.simulate(seed=1, duration=30.0)
    data["torque"][15_000] += 50.0 * float(data["torque"].std())
    ankleloop.save_trial(data, tmp_path / "record.nc")
    estimate = identify_file(LongRecord(tmp_path / "record.nc"), tmp_path / "torques.nc")
    (warning,) = [text for text in estimate.diagnostics["warnings"] if "spike" in text]
    first, _, last = warning.partition(" s: ")[0].split()
    assert float(first) < 15.0 < float(last) < 25.0
    assert estimate.diagnostics["data_warnings"] == estimate.diagnostics["warnings"]
