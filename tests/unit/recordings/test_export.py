"""Round trips: another program reads the numbers of the estimate."""

import numpy as np
import pandas as pd
import pytest
import scipy.io
import xarray as xr

from ankleloop import DataError, identify, load_estimate, simulate
from ankleloop.recordings.export import export_estimate


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=1, duration=20.0)


@pytest.fixture(scope="module", params=["riv", "pr-moesp", "parallel-cascade"])
def estimate(request, trial):
    return identify(trial, request.param, basis="rectifier")


def test_matlab(estimate, tmp_path):
    export_estimate(estimate, tmp_path / "e.mat")
    exported = scipy.io.loadmat(tmp_path / "e.mat", simplify_cells=True)["estimate"]
    assert exported["method"] == estimate.method
    assert exported["stiffness"] == estimate.stiffness
    assert exported["reflex"] == estimate.reflex
    for name in ("time", "net", "intrinsic", "reflex"):
        np.testing.assert_array_equal(exported["torque"][name], estimate.torque[name])
    for name, ends in estimate.intervals.items():
        np.testing.assert_array_equal(exported["intervals"][name], ends)
    if estimate.matrices is None:
        np.testing.assert_array_equal(
            exported["model"]["intrinsic_response"], estimate.diagnostics["intrinsic_response"]
        )
        np.testing.assert_array_equal(exported["model"]["reflex_lag"], estimate.diagnostics["reflex_lags"])
    else:
        for name in "ABCD":
            shape = getattr(estimate.matrices, name).shape
            np.testing.assert_array_equal(np.reshape(exported["model"][name], shape), getattr(estimate.matrices, name))
        assert list(exported["model"]["input"])[:3] == ["position", "velocity", "acceleration"]
    assert exported["model"]["identification_rate"] == 100.0


def test_netcdf(estimate, tmp_path):
    export_estimate(estimate, tmp_path / "e.nc")
    with xr.open_datatree(tmp_path / "e.nc") as exported:
        assert exported.attrs["method"] == estimate.method
        assert float(exported["stiffness/K"]) == estimate.stiffness["K"]
        assert exported["stiffness/K"].attrs["units"] == "N·m/rad"
        np.testing.assert_array_equal(exported["torque/reflex"], estimate.torque["reflex"])
        assert exported["torque/net"].attrs["units"] == "N·m"
        if estimate.matrices is not None:
            np.testing.assert_array_equal(exported["model/D"].sel(input="position"), estimate.stiffness["K"])
            np.testing.assert_array_equal(exported["model/A"], estimate.matrices.A)


def test_exports_are_the_files_of_save_estimate(estimate, trial, tmp_path):
    for suffix in (".nc", ".mat"):
        export_estimate(estimate, tmp_path / f"e{suffix}")
        loaded = load_estimate(tmp_path / f"e{suffix}")
        assert loaded.predict(trial).torque.identical(estimate.predict(trial).torque)


def test_csv_and_other_suffixes(estimate, tmp_path):
    export_estimate(estimate, tmp_path / "e.csv")
    exported = pd.read_csv(tmp_path / "e.csv")
    assert list(exported) == ["time_s", "torque_net_nm", "torque_intrinsic_nm", "torque_reflex_nm"]
    np.testing.assert_allclose(exported["torque_reflex_nm"], estimate.torque["reflex"], rtol=1e-12)
    with pytest.raises(DataError, match=r"e.xlsx: estimates are exported as .nc, .mat, .csv; got .xlsx"):
        export_estimate(estimate, tmp_path / "e.xlsx")
    assert [path.name for path in tmp_path.iterdir()] == ["e.csv"]
