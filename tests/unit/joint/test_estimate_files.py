import json

import numpy as np
import pytest
import xarray as xr
from value_comparison import assert_same_values

from ankleloop import METHODS, DataError, identify, simulate
from ankleloop.joint.estimate import TORQUES, Estimate, torque_dataset
from ankleloop.joint.estimate_files import EstimateCollection, load_estimates, load_estimates_of, save_estimates


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


def save(estimates, path, precision="double", **options):
    save_estimates({"pr-moesp": EstimateCollection(estimates, precision)}, path, **options)


def load(path):
    return load_estimates(path, "pr-moesp")


def test_estimates_whose_records_begin_at_different_samples(tmp_path):
    estimates = [make_estimate(seed, samples=60 - abs(shift)) for seed, shift in enumerate((0, 2, -1))]
    for estimate, first in zip(estimates, (0, 2, 0), strict=True):
        estimate.torque["time"] = 0.35 + np.arange(first, first + estimate.torque.sizes["time"]) / 100.0
        estimate.torque["time"].attrs = {"units": "s", "long_name": "time"}
    save(estimates, tmp_path / "0.nc")
    for loaded, saved in zip(load(tmp_path / "0.nc"), estimates, strict=True):
        assert_same_torque(loaded, saved)


def test_trials_with_an_estimated_delay(tmp_path):
    estimates = [identify(simulate(seed=1, duration=20.0, delay=delay), "riv", delay=None) for delay in (0.03, 0.07)]
    assert len({estimate.torque.sizes["time"] for estimate in estimates}) == 2
    save(estimates, tmp_path / "0.nc")
    for loaded, saved in zip(load(tmp_path / "0.nc"), estimates, strict=True):
        assert_same_torque(loaded, saved)


@pytest.mark.parametrize("method", METHODS)
def test_loaded_estimates_predict(tmp_path, method):
    trials = [simulate(seed=seed, duration=15.0) for seed in (1, 2)]
    options = {"memory": 2.0} if method == "real-time" else {}
    estimates = [identify(trial, method, **options) for trial in trials]
    save(estimates, tmp_path / "estimates.nc", "single")
    for loaded, saved in zip(load(tmp_path / "estimates.nc"), estimates, strict=True):
        assert (loaded.method, loaded.stiffness, loaded.reflex) == (method, saved.stiffness, saved.reflex)
        assert loaded.intervals == saved.intervals
        assert_same_values(loaded.diagnostics, saved.diagnostics)
        if method == "real-time":
            assert loaded.predictor is None
            continue
        assert loaded.predict(trials[0]).torque.identical(saved.predict(trials[0]).torque)
        assert (loaded.matrices is None) == (saved.matrices is None)


def test_reflex_parameters_that_one_trial_lacks(tmp_path):
    with_gain, without = (make_estimate(reflex=reflex) for reflex in ({"delay": 0.04, "G": 13.0}, {"delay": 0.05}))
    for estimates in ([with_gain, without], [without, with_gain]):
        save(estimates, tmp_path / "estimates.nc", overwrite=True)
        assert [e.reflex for e in load(tmp_path / "estimates.nc")] == [e.reflex for e in estimates]


def test_the_file_is_plain_netcdf_with_units(tmp_path):
    save([make_estimate(diagnostics={"order": 2})], tmp_path / "estimates.nc")
    with xr.open_dataset(tmp_path / "estimates.nc", engine="h5netcdf", group="pr-moesp") as data:
        assert data["net"].dims == ("trial", "time")
        assert data["net"].attrs["units"] == "N·m"
        assert data["stiffness"].attrs["units"] == "N·m/rad, N·m·s/rad, kg·m²"
        assert data["parameter"].values.tolist() == ["K", "B", "I"]
        assert json.loads(data["diagnostics"].values[0]) == {"order": 2}
        assert data.attrs["method"] == "pr-moesp"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda path: path.unlink(), r"estimates.nc: there is no such file"),
        (
            lambda path: path.write_bytes(path.read_bytes()[:3000]),
            r"estimates.nc: not a readable estimate file \(.*: delete it",
        ),
        (lambda path: path.write_text("torques"), r"estimates.nc: not a readable estimate file \(.*: delete it"),
        (
            lambda path: xr.Dataset({"net": 1.0}).to_netcdf(path, group="pr-moesp", engine="h5netcdf"),
            r"estimates.nc: there is no variable 'diagnostics': identify again, or load another file",
        ),
    ],
    ids=["missing", "truncated", "text", "foreign"],
)
def test_files_that_cannot_be_read_are_named(tmp_path, change, message):
    save([make_estimate()], tmp_path / "estimates.nc")
    change(tmp_path / "estimates.nc")
    with pytest.raises(DataError, match=message):
        load(tmp_path / "estimates.nc")
    with pytest.raises(DataError, match=message):
        load_estimates_of([tmp_path / "estimates.nc"], "only", "pr-moesp")


def test_another_group_is_refused(tmp_path):
    save([make_estimate()], tmp_path / "estimates.nc")
    with pytest.raises(DataError, match=r"estimates.nc: there is no group 'riv'; it has pr-moesp"):
        load_estimates(tmp_path / "estimates.nc", "riv")


def collect(index, precision="double"):
    collection = EstimateCollection(precision=precision)
    for seed, (point, number) in index.items():
        collection.add(make_estimate(seed), point, number)
    return collection


def test_estimates_of_a_point_in_several_files(tmp_path):
    files_of_study = {"0.nc": {0: ("a", 0), 1: ("a", 1), 2: ("b", 0)}, "1.nc": {3: ("b", 1), 4: ("b", 2)}}
    for name, index in files_of_study.items():
        save_estimates({"x": collect(index), "y": collect(index)}, tmp_path / name)
    paths = [tmp_path / name for name in reversed(files_of_study)]
    for point, seeds in (("a", (0, 1)), ("b", (2, 3, 4))):
        for loaded, seed in zip(load_estimates_of(paths, point, "y"), seeds, strict=True):
            assert_same_torque(loaded, make_estimate(seed))
    with pytest.raises(DataError, match="no estimate file has the point 'c'"):
        load_estimates_of(paths, "c", "x")
    with pytest.raises(DataError, match="there are no estimates to save"):
        save_estimates({"x": EstimateCollection()}, tmp_path / "none.nc")
    assert not (tmp_path / "none.nc").exists()


def test_single_precision_rounds_the_torques_alone(tmp_path):
    save_estimates({"x": collect({0: ("a", 0)}, "single")}, tmp_path / "0.nc")
    (loaded,), saved = load_estimates_of([tmp_path / "0.nc"], "a", "x"), make_estimate(0)
    assert loaded.stiffness == saved.stiffness
    assert loaded.torque["net"].dtype == np.float64
    np.testing.assert_array_equal(loaded.torque["net"], saved.torque["net"].values.astype(np.float32))
    with pytest.raises(ValueError, match="unknown precision 'half'"):
        EstimateCollection(precision="half")


def test_the_same_estimates_give_the_same_file(tmp_path):
    for name in ("a.nc", "b.nc"):
        save([make_estimate(diagnostics={"order": 2})], tmp_path / name)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()
