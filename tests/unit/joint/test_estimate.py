import json
import os

import numpy as np
import pytest
import xarray as xr

from ankleloop import DataError, identify, simulate
from ankleloop.joint.estimate import TORQUES, Estimate, load_estimates, save_estimates, torque_dataset
from ankleloop.records import files as storage_module


def make_estimate(seed=0, samples=50, reflex=None, **fields):
    rng = np.random.default_rng(seed)
    torque = torque_dataset(
        0.35 + np.arange(samples) / 100.0, 100.0, **{name: rng.standard_normal(samples) for name in TORQUES}
    )
    stiffness = {"K": 150.0 + rng.standard_normal(), "B": 0.8, "I": 0.1 + 0.2}
    return Estimate("pr-moesp", torque, None, stiffness, {"delay": 0.04} if reflex is None else reflex, **fields)


def assert_same_torque(loaded, saved):
    assert set(loaded.torque.variables) == {"time", *TORQUES}
    for name in ("time", *TORQUES):
        assert loaded.torque[name].dims == ("time",)
        assert loaded.torque[name].dtype == np.float64
        assert loaded.torque[name].values.tobytes() == saved.torque[name].values.tobytes()
        assert loaded.torque[name].attrs == saved.torque[name].attrs
    assert loaded.torque.attrs["identification_rate"] == saved.torque.attrs["identification_rate"]


# --- the estimate


def test_torques_carry_units_and_names():
    torque = make_estimate().torque
    assert torque.attrs == {"identification_rate": 100.0}
    assert torque["time"].attrs == {"units": "s", "long_name": "time"}
    for name in TORQUES:
        assert torque[name].attrs == {"units": "N·m", "long_name": f"estimated {name} torque"}


def test_repr_says_what_was_found():
    estimate = make_estimate(diagnostics={"warnings": ["unstable", "short"]})
    first, *rest = repr(estimate).splitlines()
    assert (
        first == f"<Estimate by pr-moesp: K = {estimate.stiffness['K']:.4g} N·m/rad, B = 0.8 N·m·s/rad, I = 0.3 kg·m²>"
    )
    assert rest == ["  warning: unstable", "  warning: short"]


# --- files


def test_round_trip_of_a_batch(tmp_path):
    estimates = [make_estimate(seed, diagnostics={"trial": seed}) for seed in range(3)]
    save_estimates(estimates, tmp_path / "batch.nc")
    loaded = load_estimates(tmp_path / "batch.nc")
    assert len(loaded) == 3
    for one, other in zip(loaded, estimates, strict=True):
        assert one.method == "pr-moesp"
        assert one.model is None
        assert one.stiffness == other.stiffness
        assert list(one.stiffness) == ["K", "B", "I"]
        assert one.reflex == other.reflex
        assert one.diagnostics == other.diagnostics
        assert_same_torque(one, other)


def test_special_values_keep_their_bits(tmp_path):
    estimate = make_estimate()
    special = [-0.0, 5e-324, 1.7976931348623157e308, np.nan, np.inf, -np.inf, 0.1 + 0.2]
    estimate.torque["reflex"][: len(special)] = special
    save_estimates([estimate], str(tmp_path / "one.nc"))
    (loaded,) = load_estimates(str(tmp_path / "one.nc"))
    assert_same_torque(loaded, estimate)


def test_diagnostics_become_json(tmp_path):
    diagnostics = {
        "poles": np.array([0.7 + 0.1j, 0.7 - 0.1j]),
        "real_poles": np.array([0.5, 0.25]),
        "singular_values": np.array([3.0, 0.1 + 0.2, 1e-300]),
        "pole": np.complex128(1 - 2j),
        "matrix": np.arange(4).reshape(2, 2),
        "complex_matrix": np.array([[1j]]),
        "rank": np.int64(7),
        "stable": np.bool_(True),
        "condition": np.float32(0.5),
        "passes": 3,
        "none": None,
        "warnings": ["σ is 2 × too large", 'a "quoted" one'],
        "nested": {"history": (1.0, 2.0)},
    }
    save_estimates([make_estimate(diagnostics=diagnostics)], tmp_path / "one.nc")
    (loaded,) = load_estimates(tmp_path / "one.nc")
    assert loaded.diagnostics == {
        "poles": [[0.7, 0.1], [0.7, -0.1]],
        "real_poles": [0.5, 0.25],
        "singular_values": [3.0, 0.1 + 0.2, 1e-300],
        "pole": [1.0, -2.0],
        "matrix": [[0, 1], [2, 3]],
        "complex_matrix": [[[0.0, 1.0]]],
        "rank": 7,
        "stable": True,
        "condition": 0.5,
        "passes": 3,
        "none": None,
        "warnings": ["σ is 2 × too large", 'a "quoted" one'],
        "nested": {"history": [1.0, 2.0]},
    }


def test_a_real_estimate_survives(tmp_path):
    trials = [simulate(seed=seed, duration=15.0) for seed in (1, 2)]
    for method in ("pi-moesp", "parallel-cascade"):
        estimates = [identify(trial, method, basis="rectifier") for trial in trials]
        save_estimates(estimates, tmp_path / "batch.nc")
        for loaded, saved in zip(load_estimates(tmp_path / "batch.nc"), estimates, strict=True):
            assert_same_torque(loaded, saved)
            assert (loaded.method, loaded.stiffness, loaded.reflex) == (method, saved.stiffness, saved.reflex)
            assert set(loaded.diagnostics) == set(saved.diagnostics)
            assert loaded.diagnostics["warnings"] == saved.diagnostics["warnings"]
            if method == "pi-moesp":
                poles = np.atleast_1d(saved.diagnostics["poles"]).astype(complex)
                found = [complex(*np.atleast_1d(pole)) for pole in loaded.diagnostics["poles"]]
                np.testing.assert_array_equal(found, poles)
                np.testing.assert_array_equal(
                    loaded.diagnostics["singular_values"], saved.diagnostics["singular_values"]
                )


def test_reflex_parameters_that_one_trial_lacks(tmp_path):
    with_gain, without = (make_estimate(reflex=reflex) for reflex in ({"delay": 0.04, "G": 13.0}, {"delay": 0.05}))
    for batch in ([with_gain, without], [without, with_gain]):
        save_estimates(batch, tmp_path / "batch.nc")
        assert [e.reflex for e in load_estimates(tmp_path / "batch.nc")] == [e.reflex for e in batch]


def test_intervals_survive(tmp_path):
    intervals = {"K": (140.0, 160.0), "G": (12.5, 13.5)}
    save_estimates([make_estimate(intervals=intervals)], tmp_path / "one.nc")
    (loaded,) = load_estimates(tmp_path / "one.nc")
    assert {name: tuple(bounds) for name, bounds in loaded.intervals.items()} == intervals


def test_the_file_is_plain_netcdf_with_units(tmp_path):
    save_estimates([make_estimate(diagnostics={"order": 2})], tmp_path / "one.nc")
    with xr.open_dataset(tmp_path / "one.nc", engine="h5netcdf") as batch:
        assert batch["net"].dims == ("trial", "time")
        assert batch["net"].attrs["units"] == "N·m"
        assert batch["stiffness"].attrs["units"] == "N·m/rad, N·m·s/rad, kg·m²"
        assert batch["parameter"].values.tolist() == ["K", "B", "I"]
        assert json.loads(batch["diagnostics"].values[0]) == {"order": 2}
        assert batch.attrs["method"] == "pr-moesp"


def test_the_same_estimates_give_the_same_file(tmp_path):
    for name in ("a.nc", "b.nc"):
        save_estimates([make_estimate(diagnostics={"order": 2})], tmp_path / name)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


# --- whole or not at all


def _fail(*_, **__):
    raise OSError("disk full")


def _half(dataset, path, **_):
    """What a full disk leaves: the first bytes, and an error."""
    with open(path, "wb") as file:
        file.write(b"\x89HDF\r\n")
    raise OSError("disk full")


@pytest.mark.parametrize("existing", [False, True], ids=["new", "replaced"])
@pytest.mark.parametrize("stage", ["writing", "renaming"])
def test_a_failed_save_leaves_nothing_half_written(tmp_path, monkeypatch, existing, stage):
    path = tmp_path / "batch.nc"
    if existing:
        save_estimates([make_estimate()], path)
    before = path.read_bytes() if existing else None
    with monkeypatch.context() as patch:
        if stage == "writing":
            patch.setattr(xr.Dataset, "to_netcdf", _half)
        else:
            patch.setattr(storage_module.os, "replace", _fail)
        with pytest.raises(OSError, match="disk full"):
            save_estimates([make_estimate(1)], path)
    assert os.listdir(tmp_path) == (["batch.nc"] if existing else [])
    if existing:
        assert path.read_bytes() == before


def test_diagnostics_that_json_cannot_keep(tmp_path):
    with pytest.raises(TypeError, match="object cannot be kept in diagnostics"):
        save_estimates([make_estimate(diagnostics={"thing": object()})], tmp_path / "one.nc")
    assert os.listdir(tmp_path) == []


def test_a_missing_folder(tmp_path):
    with pytest.raises(DataError, match=r"there is no folder .*: make it first"):
        save_estimates([make_estimate()], tmp_path / "none" / "one.nc")


def test_saving_replaces_and_leaves_nothing_else(tmp_path):
    (tmp_path / "batch.nc").write_text("old")
    save_estimates([make_estimate()], tmp_path / "batch.nc")
    assert os.listdir(tmp_path) == ["batch.nc"]
    assert len(load_estimates(tmp_path / "batch.nc")) == 1
