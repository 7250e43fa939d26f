"""Scale and missing samples by the same rule in every format; units of times."""

import h5py
import numpy as np
import pytest
import scipy.io
import xarray as xr

from ankleloop.errors import DataError
from ankleloop_lab.files.contents import decode
from ankleloop_lab.files.reading import read_trial

RATE = 500.0
P = 0.02 * np.sin(np.arange(300) / 10)
TQ = 3.0 * np.cos(np.arange(300) / 10)


@pytest.mark.parametrize("engine", ["h5py", "h5netcdf", "scipy"])
def test_packed_positions_of_every_format(tmp_path, engine):
    stored = np.round(P * 1e6).astype(np.int32)
    packing = {"scale_factor": 1e-6, "_FillValue": np.int32(-(2**31)), "units": "rad"}
    path = tmp_path / ("a.h5" if engine == "h5py" else "a.nc")
    if engine == "h5py":
        with h5py.File(path, "w") as file:
            file.update({"position": stored, "torque": TQ, "fs": RATE})
            file["position"].attrs.update(packing)
    else:
        signals = {"position": ("t", stored, packing), "torque": ("t", TQ)}
        xr.Dataset(signals, attrs={"fs": RATE}).to_netcdf(path, engine=engine)
    np.testing.assert_allclose(read_trial(path).position, stored * 1e-6, rtol=1e-12)


@pytest.mark.parametrize("kind", [bool, complex])
def test_samples_that_are_no_real_numbers_are_refused(tmp_path, kind):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["position"], file["torque"], file["fs"] = P, TQ.astype(kind), RATE
    with pytest.raises(DataError, match=r"a.h5: torque is of type \w+, not real numbers"):
        read_trial(tmp_path / "a.h5")


# --- units


def test_times_in_ms(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.update({"position": P, "torque": TQ, "time": 2.0 * np.arange(300)})
        file["time"].attrs["units"] = "Milliseconds since 2026-01-31 12:00"
    assert read_trial(tmp_path / "a.h5").attrs["sampling_rate"] == RATE


def test_times_without_unit_that_are_too_slow(tmp_path):
    scipy.io.savemat(
        tmp_path / "a.mat", {"position": P, "torque": TQ, "time": 2.0 * np.arange(300)}
    )
    with pytest.raises(
        DataError,
        match=r"time runs at 0.5 Hz, too slow for a joint: is it in ms\? Then call it time_ms",
    ) as e:
        read_trial(tmp_path / "a.mat")
    assert e.value.remedy == {"sampling_rate": None}


def test_a_missing_sample_is_one_as_it_is_stored(tmp_path):
    """And not one whose scaled value is that of the marker."""
    stored = np.round(P * 1000).astype(np.int16)
    stored[[7, 8, 9]] = [14, 7, 14]
    attributes = {"scale_factor": 0.5, "_FillValue": np.int16(14)}
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.update({"position": P, "torque": stored, "fs": RATE})
        file["torque"].attrs.update(attributes)
        numbers = decode(file["torque"][:], file["torque"].attrs)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(numbers)), np.flatnonzero(stored == 14))
    assert numbers[8] == 3.5
    assert 7.0 not in numbers  # it would be a scaled 14
    assert np.isnan(numbers[7])
