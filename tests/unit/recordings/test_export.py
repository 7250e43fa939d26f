"""Round trips: another program reads the numbers of the estimate."""

import numpy as np
import pandas as pd
import pytest
import scipy.io
import xarray as xr

from ankleloop import DataError, identify, simulate
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
    assert (exported["K"], exported["B_viscosity"], exported["I"]) == tuple(estimate.stiffness[name] for name in "KBI")
    assert exported["G"] == estimate.reflex["G"]
    for name in ("net", "intrinsic", "reflex"):
        np.testing.assert_array_equal(exported["torque"][name], estimate.torque[name])
    np.testing.assert_array_equal(exported["time"], estimate.torque["time"])
    for name, (low, high) in estimate.intervals.items():
        name = {"B": "B_viscosity"}.get(name, name)
        assert (exported[f"{name}_low"], exported[f"{name}_high"]) == (low, high)
    if estimate.matrices is None:
        assert exported["model"].size == 0
    else:
        for name in "ABCD":
            shape = getattr(estimate.matrices, name).shape
            np.testing.assert_array_equal(np.reshape(exported["model"][name], shape), getattr(estimate.matrices, name))
        assert list(exported["model"]["inputs"])[:3] == ["position", "velocity", "acceleration"]
        assert exported["model"]["dt"] == 0.01


def test_netcdf(estimate, tmp_path):
    export_estimate(estimate, tmp_path / "e.nc")
    with xr.open_dataset(tmp_path / "e.nc") as exported:
        assert exported.attrs["method"] == estimate.method
        assert float(exported["K"]) == estimate.stiffness["K"]
        np.testing.assert_array_equal(exported["reflex"], estimate.torque["reflex"])
        assert exported["net"].attrs["units"] == "N·m"
        if estimate.matrices is not None:
            np.testing.assert_array_equal(exported["D"].sel(input="position"), estimate.stiffness["K"])
            np.testing.assert_array_equal(exported["A"], estimate.matrices.A)


def test_csv_and_other_suffixes(estimate, tmp_path):
    export_estimate(estimate, tmp_path / "e.csv")
    exported = pd.read_csv(tmp_path / "e.csv")
    assert list(exported) == ["time_s", "torque_net_nm", "torque_intrinsic_nm", "torque_reflex_nm"]
    np.testing.assert_allclose(exported["torque_reflex_nm"], estimate.torque["reflex"], rtol=1e-12)
    with pytest.raises(DataError, match=r"e.xlsx: estimates are exported as .nc, .mat, .csv; got .xlsx"):
        export_estimate(estimate, tmp_path / "e.xlsx")
    assert [path.name for path in tmp_path.iterdir()] == ["e.csv"]
