import os

import h5py
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ankleloop.errors import DataError
from ankleloop.records import files as storage
from ankleloop.records import trial as trial_module
from ankleloop.records.trial import TRUTHS, load_trial, new_trial, save_trial, validate
from ankleloop.signals.sampling import rate_from_time

RATE = 1000.0
T = np.arange(500) / RATE
POSITION = 0.02 * np.sin(2 * np.pi * 3 * T)
TORQUE = 3.0 * np.cos(2 * np.pi * 3 * T)
REFERENCE = 0.02 * np.sign(POSITION + 1e-9)


@pytest.fixture
def trial():
    return new_trial(POSITION, TORQUE, RATE, REFERENCE, torque_reflex=TORQUE / 3, seed=7, subject="S1")


# --- new_trial


def test_new_trial_keeps_the_contract(trial):
    assert set(trial.data_vars) == {"position", "torque", "reference", "torque_reflex"}
    assert trial.attrs == {"sampling_rate": RATE, "seed": 7, "subject": "S1"}
    assert isinstance(trial.attrs["sampling_rate"], float)
    np.testing.assert_array_equal(trial.position, POSITION)
    np.testing.assert_allclose(trial.time, T, rtol=1e-15)
    for name, variable in trial.variables.items():
        assert variable.dims == ("time",), name
        assert variable.dtype == np.float64
        assert variable.attrs["long_name"]


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("position", "rad"),
        ("reference", "rad"),
        ("torque", "N·m"),
        ("time", "s"),
        ("emg", ""),
        ("torque_of_mass", "N·m"),
    ]
    + [(name, "N·m") for name in TRUTHS],
)
def test_units(name, unit):
    more = dict.fromkeys((*TRUTHS, "emg", "torque_of_mass"), TORQUE)
    assert new_trial(POSITION, TORQUE, RATE, REFERENCE, **more)[name].attrs["units"] == unit


def test_each_truth_has_its_own_long_name():
    trial = new_trial(POSITION, TORQUE, RATE, **dict.fromkeys(TRUTHS, TORQUE))
    names = [trial[name].attrs["long_name"] for name in TRUTHS]
    assert len(set(names)) == len(TRUTHS)
    assert all("true" in name for name in names)


@pytest.mark.parametrize(
    "shape",
    [lambda x: x[:, None], lambda x: x[None, :], list, pd.Series, xr.DataArray, np.float32],
    ids=["column", "row", "list", "pandas", "xarray", "float32"],
)
def test_array_kinds(shape):
    trial = new_trial(shape(POSITION), TORQUE, RATE)
    assert trial.position.shape == POSITION.shape
    np.testing.assert_allclose(trial.position, POSITION, rtol=1e-6)


def test_integers_become_floats():
    trial = new_trial(np.array([0, 1, 2], dtype=np.int16), [0, 1, 0], 1)
    assert trial.position.dtype == np.float64
    assert isinstance(trial.attrs["sampling_rate"], float)


def test_trial_does_not_share_memory_with_its_arrays():
    position = POSITION.copy()
    trial = new_trial(position, TORQUE, RATE)
    position[:] = 0.0
    np.testing.assert_array_equal(trial.position, POSITION)


def test_attributes_are_types_that_netcdf_keeps():
    trial = new_trial(POSITION, TORQUE, RATE, a=np.float32(0.5), b=np.int8(3), c=True, d=None, e=np.array(2.0), f="x")
    attributes = {name: value for name, value in trial.attrs.items() if name != "sampling_rate"}
    assert attributes == {"a": 0.5, "b": 3, "c": 1, "e": 2.0, "f": "x"}
    assert {type(value) for value in attributes.values()} == {int, float, str}


@pytest.mark.parametrize("value", [1j, {}, 2**70, b"bytes"])
def test_attributes_that_netcdf_cannot_keep_are_refused(value):
    with pytest.raises(DataError, match=r"the attribute setting is .*: pass a string, a float or a 64-bit integer"):
        new_trial(POSITION, TORQUE, RATE, setting=value)


@pytest.mark.parametrize(
    ("position", "message"),
    [
        (POSITION + 0j, "position is of type complex128, not real numbers: convert it"),
        (POSITION.astype(object), "position is of type object"),
        (POSITION > 0, "position is of type bool"),
        (POSITION.astype(str), "position is of type <U"),
        ([[1, 2], [3]], "position is of type object"),
        ([], "position is empty: record it"),
        (np.zeros((0, 1)), "position is empty"),
        (np.zeros((500, 2)), r"position has shape \(500, 2\), not one sample per time: pass a single channel"),
        (0.5, r"position has shape \(\)"),
        (None, "there is no position: pass it as a 1-D array"),
    ],
)
def test_unusable_arrays_are_refused(position, message):
    with pytest.raises(DataError, match=message):
        new_trial(position, TORQUE, RATE)


@pytest.mark.parametrize("name", ["torque", "reference", "emg"])
def test_unequal_lengths_are_refused(name):
    arrays = {"position": POSITION, "torque": TORQUE} | {name: TORQUE[:-1]}
    with pytest.raises(DataError, match=f"{name} has 499 samples but position has 500: cut all variables"):
        new_trial(**arrays, sampling_rate=RATE)


def test_masked_samples_count_as_missing():
    with pytest.raises(DataError, match=r"position is not finite at sample 40 \(0.04 s\)"):
        new_trial(np.ma.masked_array(POSITION, np.arange(500) == 40), TORQUE, RATE)


def test_a_variable_named_time_is_refused():
    with pytest.raises(DataError, match="time is made from sampling_rate: do not pass it"):
        new_trial(POSITION, TORQUE, RATE, time=T)


def test_the_source_names_the_data_in_errors():
    with pytest.raises(DataError, match=r"^monday.csv: torque is constant"):
        new_trial(POSITION, 0 * TORQUE, RATE, source="monday.csv")


# --- validate


def test_validate_returns_the_trial(trial):
    assert validate(trial) is trial


def test_a_cut_trial_is_valid(trial):
    assert validate(trial.isel(time=slice(100, 400))).time.size == 300


@pytest.mark.parametrize("rate", [0, -5.0, np.nan, np.inf])
def test_sampling_rate_must_be_positive_and_finite(trial, rate):
    with pytest.raises(DataError, match=r"^x: sampling_rate is .* Hz: pass a positive number"):
        validate(trial.assign_attrs(sampling_rate=rate), source="x")


@pytest.mark.parametrize("rate", [None, "fast", [1.0, 2.0]])
def test_sampling_rate_must_be_a_number(rate):
    with pytest.raises(DataError, match=r"sampling_rate is .*: pass a single number in Hz"):
        new_trial(POSITION, TORQUE, rate)


def test_missing_sampling_rate(trial):
    del trial.attrs["sampling_rate"]
    with pytest.raises(DataError, match=r"the attribute sampling_rate is missing: set trial.attrs"):
        validate(trial)


@pytest.mark.parametrize("name", ["position", "torque"])
def test_missing_variable(trial, name):
    with pytest.raises(DataError, match=rf"^x: there is no variable {name} among \[.*'reference'.*\]: make the trial"):
        validate(trial.drop_vars(name), source="x")


def test_missing_time(trial):
    with pytest.raises(DataError, match="there is no coordinate time: make the trial with new_trial"):
        validate(trial.drop_vars("time"))


@pytest.mark.parametrize("name", ["position", "reference", "torque_reflex"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_samples_must_be_finite(trial, name, value):
    trial[name][[123, 200]] = value
    message = rf"^x: {name} is not finite at sample 123 \(0.123 s\), 2 samples in all: cut .* or repair the channel"
    with pytest.raises(DataError, match=message):
        validate(trial, source="x")


def test_time_of_a_sample_counts_from_the_start_of_the_time_axis(trial):
    trial.torque[123] = np.nan
    with pytest.raises(DataError, match=r"at sample 23 \(0.123 s\), 1 sample in all"):
        validate(trial.isel(time=slice(100, None)))


@pytest.mark.parametrize("name", ["position", "torque"])
@pytest.mark.parametrize("noise", [0.0, 1e-16])
def test_constant_channels_are_refused(trial, name, noise):
    trial[name][:] = 0.5 + noise * np.random.default_rng(0).standard_normal(500)
    with pytest.raises(DataError, match=rf"^x: {name} is constant \(0.5 at all 500 samples\): check the channel"):
        validate(trial, source="x")


def test_constant_reference_is_refused(trial):
    trial.reference[:] = 0.0
    with pytest.raises(DataError, match=r"reference is constant .* carries no information: leave it out, or check"):
        validate(trial)


def test_a_constant_truth_is_allowed():
    assert "torque_voluntary" in new_trial(POSITION, TORQUE, RATE, torque_voluntary=np.zeros(500))


def test_one_sample_is_refused():
    with pytest.raises(DataError, match="time has 1 sample: a trial needs at least 2"):
        new_trial([0.1], [1.0], RATE)


def test_two_samples_suffice():
    assert new_trial([0.0, 0.001], [1.0, 2.0], RATE).time.size == 2


def test_position_in_degrees_is_refused():
    with pytest.raises(
        DataError, match=r"position moves at 21.59 rad/s at sample \d+ \(\S+ s\), above 20 rad/s: is the"
    ) as e:
        new_trial(np.rad2deg(POSITION), TORQUE, RATE)
    assert "pass position_unit='deg'" in str(e.value)


def test_two_samples_in_degrees_are_refused():
    with pytest.raises(DataError, match=r"at 100 rad/s at sample 1 \(0.01 s\)"):
        new_trial([0.0, 1.0], [1.0, 2.0], 100.0)


@pytest.mark.parametrize("rate", [1000.0, 5000.0, 20000.0])
def test_position_noise_is_no_velocity(rate):
    time = np.arange(int(rate)) / rate
    noise = 0.01 * np.random.default_rng(1).standard_normal(time.size)
    position = 0.02 * np.sin(2 * np.pi * 3 * time) + noise
    assert np.max(np.abs(np.diff(position))) * rate > 20.0
    new_trial(position, np.cos(time), rate)


@pytest.mark.parametrize("size", [2, 3, 4, 6, 7, 8, 50])
@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_velocity_of_a_ramp_is_exact(size, rate):
    at, speed = trial_module._fastest(5.0 * np.arange(size) / rate, rate)
    assert 0 < at < size
    np.testing.assert_allclose(speed, 5.0, rtol=1e-9)


@settings(max_examples=50)
@given(hnp.arrays(float, st.integers(2, 40), elements=st.floats(-1.0, 1.0)), st.sampled_from([100.0, 700.0, 1000.0]))
def test_fastest_is_the_largest_difference_of_means(position, rate):
    half = min(max(1, round(0.003 * rate)), (position.size - 1) // 2)
    speeds = {k: abs(position[k] - position[k - 1]) * rate for k in range(1, position.size)}
    if half:
        inside = range(half, position.size - half)
        means = {k: (position[k + 1 : k + half + 1].mean(), position[k - half : k].mean()) for k in inside}
        speeds = {k: abs(after - before) / (half + 1) * rate for k, (after, before) in means.items()}
    at, speed = trial_module._fastest(position, rate)
    assert speed == pytest.approx(max(speeds.values()), abs=1e-9)
    assert speed == 0.0 or speeds[at] == pytest.approx(speed, abs=1e-9)


def test_other_dimensions_are_refused(trial):
    trial["emg"] = ("emg_time", np.zeros(3))
    with pytest.raises(DataError, match=r"emg has shape \(3,\) over \('emg_time',\).*: cut all variables"):
        validate(trial)


def test_other_types_are_refused(trial):
    with pytest.raises(DataError, match="position is of type float32, not float64: make the trial with new_trial"):
        validate(trial.assign(position=trial.position.astype("float32")))
    with pytest.raises(DataError, match=r"a trial is an xarray.Dataset, not dict: make it with new_trial"):
        validate({"position": POSITION})


def _with_time(trial, time):
    return trial.assign_coords(time=("time", time))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: np.where(np.arange(500) < 300, t, t + 0.05),
            r"irregular at sample 300 \(0.35 s\): it steps by 0.051 s",
        ),
        (
            lambda t: np.where(np.arange(500) < 300, t, t - 0.001),
            r"irregular at sample 300 \(0.299 s\): it steps by 0 s",
        ),
        (lambda t: np.where(np.arange(500) == 300, t + 4e-5, t), r"irregular at sample 300 \(0.30004 s\)"),
        (lambda t: np.where(np.arange(500) == 300, np.nan, t), r"time is not finite at sample 300 \(1 sample in all\)"),
        (lambda t: t[::-1], "irregular at sample 1 "),
        (lambda t: 2 * t, r"stated as 1000 Hz, but time runs at 500 Hz: correct the one"),
    ],
    ids=["gap", "duplicate", "jitter", "nan", "backwards", "other-rate"],
)
def test_time_must_be_regular(trial, change, message):
    with pytest.raises(DataError, match=message):
        validate(_with_time(trial, change(trial.time.to_numpy())))


def test_time_in_single_precision_is_regular():
    time = (np.arange(300_000) / RATE).astype(np.float32).astype(float)
    assert rate_from_time(time, source="x") == pytest.approx(RATE, rel=1e-6)


# --- files

_finite = st.floats(allow_nan=False, allow_infinity=False, width=64)
_attributes = st.one_of(
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False),
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20),
)


@settings(max_examples=50, deadline=None)
@given(
    position=hnp.arrays(float, 20, elements=st.floats(-0.1, 0.1), unique=True),
    torque=hnp.arrays(float, 20, elements=_finite, unique=True),
    rate=st.floats(1.0, 30.0),
    attribute=_attributes,
)
def test_round_trip_is_bit_exact(tmp_path_factory, position, torque, rate, attribute):
    path = tmp_path_factory.mktemp("trips") / "trial.nc"
    position, torque = [0.0, 0.1, *position], [0.0, 1.0, *torque]
    trial = new_trial(position, torque, rate, emg=torque, setting=attribute)
    save_trial(trial, path)
    loaded = load_trial(path)
    assert loaded.identical(trial)
    assert {name: type(value) for name, value in loaded.attrs.items()} == {
        name: type(value) for name, value in trial.attrs.items()
    }
    for name in trial.variables:  # identical() takes -0.0 for 0.0
        assert loaded[name].to_numpy().tobytes() == trial[name].to_numpy().tobytes()


def test_round_trip_keeps_a_cut_trial_and_its_order(trial, tmp_path):
    cut = trial.isel(time=slice(100, None))
    save_trial(cut, tmp_path / "a.nc")
    save_trial(load_trial(tmp_path / "a.nc"), tmp_path / "b.nc")
    loaded = load_trial(tmp_path / "b.nc")
    assert loaded.identical(cut)
    assert list(loaded.data_vars) == list(trial.data_vars)


def test_a_packed_encoding_does_not_change_the_samples(trial, tmp_path):
    trial.torque.encoding = {"dtype": "int16", "scale_factor": 0.01, "_FillValue": -1}
    save_trial(trial, tmp_path / "trial.nc")
    assert load_trial(tmp_path / "trial.nc").identical(trial)


def test_the_path_of_the_machine_stays_out(trial, tmp_path):
    save_trial(trial, str(tmp_path / "trial.nc"))
    assert load_trial(str(tmp_path / "trial.nc")).encoding == {}
    assert str(tmp_path).encode() not in (tmp_path / "trial.nc").read_bytes()


def test_the_same_trial_gives_the_same_file(trial, tmp_path):
    for name in ("a.nc", "b.nc"):
        save_trial(trial, tmp_path / name)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def test_saving_replaces_and_leaves_nothing_else(trial, tmp_path):
    path = tmp_path / "trial.nc"
    path.write_text("old")
    save_trial(trial, path)
    assert os.listdir(tmp_path) == ["trial.nc"]
    assert load_trial(path).identical(trial)


def test_a_failed_save_leaves_the_old_file(trial, tmp_path, monkeypatch):
    path = tmp_path / "trial.nc"
    save_trial(trial, path)
    before = path.read_bytes()

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(storage.os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        save_trial(trial, path)
    assert os.listdir(tmp_path) == ["trial.nc"]
    assert path.read_bytes() == before


def test_an_invalid_trial_is_not_saved(trial, tmp_path):
    trial.torque[5] = np.nan
    with pytest.raises(DataError, match=r"^trial.nc: torque is not finite at sample 5"):
        save_trial(trial, tmp_path / "trial.nc")
    assert os.listdir(tmp_path) == []


def test_saving_into_a_missing_folder(trial, tmp_path):
    with pytest.raises(DataError, match=r"there is no folder .*: make it first"):
        save_trial(trial, tmp_path / "none" / "trial.nc")


def test_loading_a_missing_file(tmp_path):
    with pytest.raises(DataError, match=r"none.nc: there is no such file: check the path"):
        load_trial(tmp_path / "none.nc")


@pytest.mark.parametrize("content", [b"", b"not a netcdf file", b"\x89HDF\r\n\x1a\n" + bytes(100)])
def test_loading_another_kind_of_file(tmp_path, content):
    (tmp_path / "trial.nc").write_bytes(content)
    with pytest.raises(DataError, match=r"^trial.nc: not a readable NetCDF-4 file .*: write it with save_trial") as e:
        load_trial(tmp_path / "trial.nc")
    assert e.value.__cause__ is not None


def test_loading_half_a_file(trial, tmp_path):
    save_trial(trial, tmp_path / "trial.nc")
    whole = (tmp_path / "trial.nc").read_bytes()
    (tmp_path / "trial.nc").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(DataError, match="not a readable NetCDF-4 file"):
        load_trial(tmp_path / "trial.nc")


def test_loading_checks_the_trial(trial, tmp_path):
    save_trial(trial, tmp_path / "trial.nc")
    with h5py.File(tmp_path / "trial.nc", "r+") as file:
        file["time"][300:] += 0.05
    with pytest.raises(DataError, match=r"^trial.nc: time is irregular at sample 300 \(0.35 s\)"):
        load_trial(tmp_path / "trial.nc")
