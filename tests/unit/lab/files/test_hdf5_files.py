"""Variables of HDF5 files: links, samples in other files, dimensions without a variable."""

import h5netcdf
import h5py
import numpy as np
import pytest

from ankleloop.errors import DataError
from ankleloop_lab.files.reading import read_trial

RATE = 500.0
P = 0.02 * np.sin(np.arange(300) / 10)
TQ = 3.0 * np.cos(np.arange(300) / 10)


@pytest.fixture
def path(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["data/angle"], file["torque"] = P, TQ
        file["data"].attrs["fs"] = RATE
        file.attrs["fs"] = RATE
    return tmp_path / "a.h5"


def link(path, name, target):
    with h5py.File(path, "a") as file:
        file[name] = target


@pytest.mark.parametrize(
    ("name", "links"),
    [
        ("position", {"position": "/data/angle"}),
        ("position", {"position": "data/angle"}),
        ("data/position", {"data/position": "angle"}),
        ("other/position", {"other": "/data", "data/position": "angle"}),
    ],
)
def test_soft_links_are_followed(path, name, links):
    for source, target in links.items():
        link(path, source, h5py.SoftLink(target))
    np.testing.assert_array_equal(read_trial(path, position=name).position, P)


def test_a_link_that_is_called_as_a_channel(path):
    with h5py.File(path, "a") as file:
        file["raw/x17"] = 2.0 * P
        file["position"] = h5py.SoftLink("/raw/x17")
        file["reference"] = h5py.SoftLink("/data/angle")
    trial = read_trial(path, sampling_rate=RATE)
    np.testing.assert_array_equal(trial.position, 2.0 * P)
    np.testing.assert_array_equal(trial.reference, P)


def test_a_link_to_another_file(path):
    with h5py.File(path.with_name("b.h5"), "w") as file:
        file["angle"] = P
    link(path, "position", h5py.ExternalLink("b.h5", "/angle"))
    with pytest.raises(DataError, match=r"^a.h5: the samples of position are in other files"):
        read_trial(path)


def test_a_dimension_without_a_variable_is_no_time(tmp_path):
    with h5netcdf.File(tmp_path / "a.nc", "w") as file:
        file.dimensions = {"time": 300}
        for name, values in (("position", P), ("torque", TQ)):
            file.create_variable(name, ("time",), float)[:] = values
    with h5py.File(tmp_path / "a.nc", "a") as file:
        assert file["time"].shape == (300,)  # zeros
    with pytest.raises(
        DataError, match=r"a.nc: there is no sampling rate \(.*\) and no time column"
    ):
        read_trial(tmp_path / "a.nc")
    assert read_trial(tmp_path / "a.nc", sampling_rate=RATE).attrs["sampling_rate"] == RATE


def test_a_rate_in_khz(path):
    with h5py.File(path, "a") as file:
        file["data/position"], file["data/sampling_rate"] = P, 0.5
        del file["data"].attrs["fs"]
        file["data/sampling_rate"].attrs["units"] = "kHz"
    with pytest.raises(DataError, match=r"data/sampling_rate is in kHz, not in Hz") as e:
        read_trial(path, position="data/position")
    assert e.value.remedy == {"sampling_rate": None}
