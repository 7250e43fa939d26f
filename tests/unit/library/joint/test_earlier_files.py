"""Estimates and trials that an earlier version of the library wrote have the numbers that they had.

`files/earlier` has a simulated trial of 12 s, an estimate of it with each kind of model, and in numbers.json what that
version said of them: parameters, and torques by sums and some samples, also those predicted for 0.7 of the position.
"""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from ankleloop import load_estimate, load_trial

FOLDER = Path(__file__).parent / "files" / "earlier"
NUMBERS = json.loads((FOLDER / "numbers.json").read_text(encoding="utf-8"))
ESTIMATES = (
    "pr-moesp.nc",
    "riv.nc",
    "riv.mat",
    "parallel-cascade.nc",
    "riv-tv.nc",
    "real-time.nc",
)


@pytest.fixture
def restore(tmp_path):
    """A function that gives the path of a file as it was written; NetCDF files are stored in compressed form."""

    def restore_file(name):
        path = tmp_path / name
        if path.suffix == ".nc":
            path.write_bytes(gzip.decompress((FOLDER / f"{name}.gz").read_bytes()))
        else:
            path.write_bytes((FOLDER / name).read_bytes())
        return path

    return restore_file


def assert_torques(torque, expected):
    for name, numbers in expected.items():
        part = torque[name].values
        assert part.size == numbers["size"]
        np.testing.assert_allclose(np.nansum(part), numbers["sum"], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(np.nansum(part**2), numbers["squares"], rtol=1e-9)
        np.testing.assert_allclose(
            np.nan_to_num(part[50::150]), numbers["samples"], rtol=1e-9, atol=1e-12
        )


def test_the_trial(restore):
    trial, numbers = load_trial(restore("trial.nc")), NUMBERS["trial"]
    assert trial.attrs == numbers["attrs"]
    assert list(trial.data_vars) == list(numbers["sums"])
    for name in trial.data_vars:
        np.testing.assert_allclose(trial[name].sum(), numbers["sums"][name], rtol=1e-12)
        np.testing.assert_allclose((trial[name] ** 2).sum(), numbers["squares"][name], rtol=1e-12)
    assert {name: trial[name].attrs for name in trial.variables} == numbers["units"]


@pytest.mark.parametrize("name", ESTIMATES)
def test_an_estimate(restore, name):
    path = restore(name)
    estimate, numbers = load_estimate(path), NUMBERS[path.stem]
    assert estimate.method == path.stem
    for group in ("stiffness", "reflex"):
        assert getattr(estimate, group) == pytest.approx(numbers[group], rel=1e-9)
    intervals = {key: list(ends) for key, ends in estimate.intervals.items()}
    assert intervals.keys() == numbers["intervals"].keys()
    for key, ends in intervals.items():
        assert ends == pytest.approx(numbers["intervals"][key], rel=1e-9)
    assert estimate.diagnostics["warnings"] == numbers["warnings"]
    assert_torques(estimate.torque, numbers["torque"])
    for key, values in numbers.get("trajectories", {}).items():
        np.testing.assert_allclose(estimate.trajectories[key].values[::10], values, rtol=1e-9)


@pytest.mark.parametrize("name", [name for name in ESTIMATES if name != "real-time.nc"])
def test_its_prediction(restore, name):
    estimate = load_estimate(restore(name))
    trial = load_trial(restore("trial.nc"))
    prediction = estimate.predict(trial.assign(position=0.7 * trial["position"]))
    assert_torques(prediction.torque, NUMBERS[estimate.method]["prediction"])
    assert "prediction" not in NUMBERS["real-time"]
