import numpy as np
import pandas as pd
import pytest

import ankleloop
from ankleloop.recordings import files
from ankleloop.recordings.analysis import analyse

MAPPING = {"position": "angle", "torque": "moment", "position_unit": "deg", "torque_sign": -1}
MAPPING |= {"subject": "S1", "condition": "rest", "trial": 2}
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


def test_analysis_has_a_table_and_exports(path, tmp_path):
    analysis = analyse(files.load_recording(path, MAPPING), METHODS)
    table = files.tabulate_analysis("A1", MAPPING, analysis, {"PR-MOESP": "pr-moesp-position"})
    assert list(table.columns[:4]) == ["recording", "subject", "condition", "trial"]
    assert table.iloc[0, :4].tolist() == ["A1", "S1", "rest", 2]
    assert table["key"].tolist() == ["pr-moesp-position"]
    files.export_estimates({"pr-moesp-position": analysis.estimates["PR-MOESP"]}, tmp_path / "A1")
    names = sorted(file.name for file in (tmp_path / "A1").iterdir())
    assert names == [f"pr-moesp-position{suffix}" for suffix in (".csv", ".mat", ".nc")]
    estimate = ankleloop.load_estimate(tmp_path / "A1" / "pr-moesp-position.nc")
    assert estimate.stiffness == analysis.estimates["PR-MOESP"].stiffness


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


def test_unusable_file_is_refused_with_its_reason(path, tmp_path):
    table = pd.read_csv(path)
    table.loc[777, "moment"] = np.nan
    table.to_csv(tmp_path / "gap.csv", index=False)
    for name, reason in (("gap.csv", "777"), ("nowhere.csv", "nowhere.csv: there is no such file")):
        with pytest.raises(ankleloop.DataError) as error:
            files.load_recording(tmp_path / name, MAPPING)
        analysis = files.refuse_recording(error.value)
        assert analysis.check.verdict == "refused"
        assert analysis.estimates == {}
        row = files.tabulate_analysis("A2", MAPPING, analysis, {"PR-MOESP": "pr-moesp"}).iloc[0]
        assert (row["recording"], row["verdict"]) == ("A2", "refused")
        assert reason in row["reasons"]
        assert pd.isna(row["key"])


@pytest.mark.parametrize("method", ["riv", "pr-moesp", "parallel-cascade"])
def test_other_programs_read_the_numbers_of_an_export(method, tmp_path):
    trial = ankleloop.simulate(seed=1, duration=20.0)
    estimate = ankleloop.identify(trial, method, basis="rectifier")
    for suffix in (".nc", ".mat", ".csv"):
        files.export_estimate(estimate, tmp_path / f"e{suffix}")
    for suffix in (".nc", ".mat"):
        loaded = ankleloop.load_estimate(tmp_path / f"e{suffix}")
        assert loaded.predict(trial).torque.identical(estimate.predict(trial).torque)
    exported = pd.read_csv(tmp_path / "e.csv")
    assert list(exported) == ["time_s", "torque_net_nm", "torque_intrinsic_nm", "torque_reflex_nm"]
    np.testing.assert_allclose(exported["torque_reflex_nm"], estimate.torque["reflex"], rtol=1e-12)
    with pytest.raises(ankleloop.DataError, match=r"e.xlsx: "):
        files.export_estimate(estimate, tmp_path / "e.xlsx")
