"""Trials: made from arrays, cut, saved and loaded."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from ankleloop.errors import DataError
from ankleloop.trials.trial import new_trial, segment
from ankleloop.trials.trial_files import load_trial, save_trial

RATE = 1000.0
T = np.arange(500) / RATE
POSITION = 0.02 * np.sin(2 * np.pi * 3 * T)
TORQUE = 3.0 * np.cos(2 * np.pi * 3 * T)
REFERENCE = 0.02 * np.sign(POSITION + 1e-9)


@pytest.fixture
def trial():
    return new_trial(
        POSITION, TORQUE, RATE, REFERENCE, torque_reflex=TORQUE / 3, seed=7, subject="S1"
    )


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


def test_attributes_have_types_of_netcdf():
    trial = new_trial(
        POSITION,
        TORQUE,
        RATE,
        a=np.float32(0.5),
        b=np.int8(3),
        c=True,
        d=None,
        e=np.array(2.0),
        f="x",
    )
    attributes = {name: value for name, value in trial.attrs.items() if name != "sampling_rate"}
    assert attributes == {"a": 0.5, "b": 3, "c": 1, "e": 2.0, "f": "x"}
    assert {type(value) for value in attributes.values()} == {int, float, str}


@pytest.mark.parametrize("value", [1j, {}, 2**70, b"bytes"])
def test_attributes_of_other_types_are_refused(value):
    with pytest.raises(
        DataError, match=r"the attribute setting is .*: pass a string, a float or a 64-bit integer"
    ):
        new_trial(POSITION, TORQUE, RATE, setting=value)


# --- segment


def test_segment_keeps_its_times(trial):
    part = segment(trial, 0.1, 0.4)
    xr.testing.assert_identical(part, trial.isel(time=slice(100, 400)))


# --- save_trial, load_trial

_finite = st.floats(allow_nan=False, allow_infinity=False, width=64)
_attributes = st.one_of(
    st.integers(1 - 2**63, 2**63 - 1),
    st.floats(allow_nan=False),
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20),
)


@settings(max_examples=20, deadline=None)
@given(
    position=hnp.arrays(float, 20, elements=st.floats(-0.1, 0.1), unique=True),
    torque=hnp.arrays(float, 20, elements=st.floats(-1e14, 1e14), unique=True),
    emg=hnp.arrays(float, 22, elements=_finite),
    rate=st.floats(1.0, 30.0),
    attribute=_attributes,
)
def test_round_trip_is_bit_exact(tmp_path_factory, position, torque, emg, rate, attribute):
    path = tmp_path_factory.mktemp("trials") / "trial.nc"
    position, torque = [0.0, 0.1, *position], [0.0, 1.0, *torque]
    trial = new_trial(position, torque, rate, emg=emg, setting=attribute)
    save_trial(trial, path)
    loaded = load_trial(path)
    assert loaded.identical(trial)
    assert {name: type(value) for name, value in loaded.attrs.items()} == {
        name: type(value) for name, value in trial.attrs.items()
    }
    for name in trial.variables:  # identical() takes -0.0 for 0.0
        assert loaded[name].to_numpy().tobytes() == trial[name].to_numpy().tobytes()


def test_packed_encoding_does_not_change_samples(trial, tmp_path):
    trial.torque.encoding = {"dtype": "int16", "scale_factor": 0.01, "_FillValue": -1}
    save_trial(trial, tmp_path / "trial.nc")
    assert load_trial(tmp_path / "trial.nc").identical(trial)


def test_file_is_reproducible(trial, tmp_path):
    for name in ("a.nc", "b.nc"):
        save_trial(trial, tmp_path / name)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()
