"""Trajectories with units and names, and what files keep of them."""

import numpy as np
import pytest
import xarray as xr

from ankleloop import load_estimate, save_estimate
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import EstimateTable, load_estimates
from ankleloop.joint.regressors import torque_dataset
from ankleloop.joint.time_varying_course import trajectory_dataset

PLACES = np.linspace(-0.1, 0.2, 11)
VALUES = {name + end: np.linspace(1.0, 2.0, 11) for name in "KBG" for end in ("", "_low", "_high")}
SCHEDULE = {"variable": "ankle_angle", "variable_unit": "rad"}


def make_estimate(dimension="schedule", **names):
    torques = dict.fromkeys(("net", "intrinsic", "reflex"), np.zeros(20))
    curves = trajectory_dataset(dimension, PLACES, VALUES, **names)
    torque = torque_dataset(np.arange(20) / 100, 100.0, **torques)
    return Estimate("riv-tv", torque, None, {"K": 1.0}, {"G": 1.0, "delay": 0.04}, trajectories=curves)


@pytest.mark.parametrize("names", [SCHEDULE, {"variable": "emg"}, {}])
@pytest.mark.parametrize("suffix", [".nc", ".mat", ".parquet"])
def test_files_keep_name_and_unit_of_the_schedule(tmp_path, suffix, names):
    estimate = make_estimate(**names)
    path = tmp_path / f"a{suffix}"
    if suffix == ".parquet":
        table = EstimateTable()
        table.add(estimate, point="only", name="riv-tv", number=0)
        table.write(path)
        loaded = load_estimates([path], "only", "riv-tv")[0]
    else:
        save_estimate(estimate, path)
        loaded = load_estimate(path)
    xr.testing.assert_identical(loaded.trajectories, estimate.trajectories)
    coordinate = loaded.trajectories["schedule"]
    assert coordinate.attrs["units"] == names.get("variable_unit", "")
    assert coordinate.attrs["long_name"] == names.get("variable", "scheduling variable")
