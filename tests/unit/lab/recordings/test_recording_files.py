import numpy as np
import pandas as pd
import pytest

import ankleloop
from ankleloop_lab.recordings import files
from ankleloop_lab.recordings.analysis import analyse

MAPPING = {"position": "angle", "torque": "moment", "position_unit": "deg", "torque_sign": -1}
MAPPING |= {"subject": "S1", "condition": "rest", "trial": 2, "session": ""}
METHODS = {"PR-MOESP": {"method": "pr-moesp", "options": {"reference": "position"}}}


@pytest.fixture(scope="module")
def simulated():
    return ankleloop.simulate(seed=1, duration=12.0, closed_loop=False)


@pytest.fixture(scope="module")
def path(simulated, tmp_path_factory):
    """A trial in degrees, with the sign of a motor, and with drift."""
    path = tmp_path_factory.mktemp("laboratory") / "trial.csv"
    time = simulated["time"].values
    columns = {
        "t": time,
        "angle": np.degrees(simulated["position"]),
        "moment": -simulated["torque"] - 2.0 * time,
    }
    pd.DataFrame({name: np.asarray(values) for name, values in columns.items()}).to_csv(
        path, index=False
    )
    return path


def test_recording_is_read_by_its_mapping(path, simulated):
    trial = files.load_recording(path, MAPPING)
    np.testing.assert_allclose(trial["position"], simulated["position"], atol=1e-12)
    np.testing.assert_allclose(
        trial["torque"], simulated["torque"] + 2.0 * simulated["time"].values, atol=1e-9
    )
    level = files.load_recording(path, {**MAPPING, "drift": 1})["torque"]
    assert abs(np.polyfit(simulated["time"], level, 1)[0]) < 1e-9
    for start, stop, ends in (
        (2.0, 5.0, (2.0, 5.0)),
        (None, 5.0, (0.0, 5.0)),
        (2.0, None, (2.0, 11.999)),
    ):
        time = files.load_recording(path, {**MAPPING, "start": start, "stop": stop})["time"].values
        assert (time[0], time[-1]) == pytest.approx(ends, abs=2e-3)


def test_an_estimate_of_merged_trials_has_their_numbers(path, tmp_path):
    halves = [
        files.load_recording(path, MAPPING | part) for part in ({"stop": 6.0}, {"start": 6.0})
    ]
    analysis = analyse(halves, METHODS)
    files.export_estimates({"pr-moesp": analysis.estimates["PR-MOESP"]}, tmp_path / "M1")
    table = pd.read_csv(tmp_path / "M1" / "pr-moesp.csv")
    assert table.groupby("trial")["time_s"].max().round().tolist() == [6.0, 12.0]
    loaded = ankleloop.load_estimate(tmp_path / "M1" / "pr-moesp.nc")
    assert loaded == analysis.estimates["PR-MOESP"]


def test_other_programs_read_the_numbers_of_an_export(simulated, tmp_path):
    estimate = ankleloop.identify(simulated, "pr-moesp")
    files.export_estimate(estimate, tmp_path / "e.csv")
    exported = pd.read_csv(tmp_path / "e.csv")
    assert list(exported) == ["time_s", "torque_net_nm", "torque_intrinsic_nm", "torque_reflex_nm"]
    np.testing.assert_allclose(exported["torque_reflex_nm"], estimate.torque["reflex"], rtol=1e-12)
