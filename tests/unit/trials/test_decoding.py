"""Scale, offset and missing samples by the same rule in every format; units of channels."""

import h5py
import numpy as np
import pytest
import scipy.io
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.trials.contents import decode
from ankleloop.trials.readers import read_trial
from ankleloop.trials.units import time_factor

RATE = 500.0
P = 0.02 * np.sin(np.arange(300) / 10)
TQ = 3.0 * np.cos(np.arange(300) / 10)


@pytest.mark.parametrize("kind", ["int16", "int32", "uint16", "float32"])
@pytest.mark.parametrize(
    "attributes",
    [{"scale_factor": 0.5}, {"add_offset": 3.0}, {"scale_factor": 2.0, "add_offset": -1.0}],
)
def test_samples_are_those_of_xarray(kind, attributes):
    stored = np.array([0, 1, 7, 100, 7], dtype=kind)
    attributes = {**attributes, "_FillValue": stored.dtype.type(7)}
    data = xr.decode_cf(xr.Dataset({"x": ("t", stored, attributes)}))
    np.testing.assert_allclose(decode(stored, attributes), data.x.values, rtol=1e-7)


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


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [
        ("time", "", None),
        ("time_s", "", 1.0),
        ("time_ms", "", 1e-3),
        ("t_us", "", 1e-6),
        ("time", "ms", 1e-3),
        ("time", "Seconds since 2026-01-31 12:00", 1.0),
    ],
)
def test_units_of_time(name, unit, factor):
    assert time_factor(name, unit, source="a") == factor


@pytest.mark.parametrize(("name", "unit"), [("time_ms", None), ("time", "milliseconds")])
def test_times_in_ms(tmp_path, name, unit):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["position"], file["torque"], file[name] = P, TQ, np.arange(300) * 2.0
        if unit:
            file[name].attrs["units"] = unit
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
