import json

import numpy as np
import pandas as pd
import pytest
from value_comparison import assert_same_estimate, assert_same_values

from ankleloop import DataError, identify, simulate
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.regressors import TORQUES, torque_dataset
from ankleloop.methods.registry import JOINT_METHODS
from ankleloop_workflow.tables.estimate_tables import load_estimates, write_estimates


def make_estimate(seed=0, **fields):
    rng = np.random.default_rng(seed)
    time = (
        0.35 + np.arange(seed % 7, 50) / 100.0
    )  # records of several lengths, which begin at several times
    torque = torque_dataset(
        time, 100.0, **{name: rng.standard_normal(time.size) for name in TORQUES}
    )
    stiffness = {"K": 150.0 + rng.standard_normal(), "B": 0.8, "I": 0.1 + 0.2}
    return Estimate("pr-moesp", torque, stiffness, {"delay": 0.04}, **fields)


def write(index, path, precision="double", **options):
    with write_estimates(path, precision, **options) as table:
        for (point, number), estimate in index.items():
            for name in ("x", "y"):
                table.add(estimate, point=point, name=name, number=number)


def save(estimates, path, precision="double", **options):
    index = {("only", number): estimate for number, estimate in enumerate(estimates)}
    write(index, path, precision, **options)


def load(path):
    return list(load_estimates([path], "only", "x").values())


@pytest.mark.parametrize("method", JOINT_METHODS)
def test_loaded_estimates_predict(tmp_path, method):
    trials = [simulate(seed=seed, duration=15.0) for seed in (1, 2)]
    estimates = [identify(trial, method) for trial in trials]
    save(estimates, tmp_path / "estimates.nc", "single")
    for loaded, saved in zip(load(tmp_path / "estimates.nc"), estimates, strict=True):
        assert (loaded.method, loaded.stiffness, loaded.reflex) == (
            method,
            saved.stiffness,
            saved.reflex,
        )
        assert loaded.intervals == saved.intervals
        assert_same_values(loaded.diagnostics, saved.diagnostics)
        if saved.predictor is None:
            assert loaded.predictor is None
            continue
        assert loaded.predict(trials[0]).torque.identical(saved.predict(trials[0]).torque)
        assert (loaded.matrices is None) == (saved.matrices is None)


def test_the_file_is_a_plain_table(tmp_path):
    save([make_estimate(diagnostics={"order": 2})], tmp_path / "0.parquet")
    row = pd.read_parquet(tmp_path / "0.parquet").iloc[0]
    assert (row["point"], row["name"], row["number"], row["method"]) == ("only", "x", 0, "pr-moesp")
    assert json.loads(row["diagnostics"]) == {"order": 2}
    assert row["net"].size == row["time"].size


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda path: path.write_bytes(path.read_bytes()[:3000]),
            "not a readable estimate file .*: delete it",
        ),
        (
            lambda path: pd.DataFrame({"net": [1.0]}).to_parquet(path),
            "not a readable estimate file .*: delete it",
        ),
    ],
    ids=["truncated", "foreign"],
)
def test_files_that_cannot_be_read_are_named(tmp_path, change, message):
    save([make_estimate()], tmp_path / "estimates.nc")
    change(tmp_path / "estimates.nc")
    with pytest.raises(DataError, match=message):
        load(tmp_path / "estimates.nc")


def test_estimates_of_a_point_in_several_files(tmp_path):
    seeds = {"0": {("a", 0): 0, ("a", 1): 1, ("b", 0): 2}, "1": {("b", 1): 3, ("b", 2): 4}}
    for name, index in seeds.items():
        write({key: make_estimate(seed) for key, seed in index.items()}, tmp_path / name)
    paths = [tmp_path / name for name in reversed(seeds)]
    for point, expected in (("a", (0, 1)), ("b", (2, 3, 4))):
        estimates = load_estimates(paths, point, "y")
        assert list(estimates) == list(range(len(expected)))
        for loaded, seed in zip(estimates.values(), expected, strict=True):
            assert_same_estimate(loaded, make_estimate(seed))
    assert load_estimates(paths, "c", "x") == {}


def test_single_precision_rounds_the_torques_alone(tmp_path):
    saved = make_estimate(0)
    save([saved], tmp_path / "0", "single")
    (loaded,) = load(tmp_path / "0")
    assert loaded.stiffness == saved.stiffness
    assert loaded.torque["net"].dtype == np.float64
    np.testing.assert_array_equal(
        loaded.torque["net"], saved.torque["net"].values.astype(np.float32)
    )
