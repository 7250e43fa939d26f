"""A long record is read as `read_trial` reads a short one: the same samples, or the same refusal."""

import os

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import netcdf_file

from ankleloop import DataError, LongRecord, read_trial
from ankleloop.trials import readers
from ankleloop.trials.trial import check_samples, validate

RATE = 1000.0
N = 1000
TIME = np.arange(N) / RATE
RNG = np.random.default_rng(0)
P = 0.02 * np.sin(2 * np.pi * 3 * TIME) + 1e-4 * RNG.standard_normal(N)
R = P + 1e-3 * np.cos(2 * np.pi * 7 * TIME)
TQ = 150 * P + RNG.standard_normal(N)


def changed(values, sample, value):
    values = values.copy()
    values[sample] = value
    return values


def write(path, variables=None, attributes=None, group="", **file_attributes):
    """Write a recording; attributes by variable."""
    samples = {"position": P, "torque": TQ, "reference": R} | (variables or {})
    with h5py.File(path, "w") as file:
        parent = file.require_group(group) if group else file
        parent.attrs.update({"sampling_rate": RATE} | file_attributes)
        if parent.attrs["sampling_rate"] == 0:
            del parent.attrs["sampling_rate"]
        for name, values in samples.items():
            parent[name] = values
            parent[name].attrs.update((attributes or {}).get(name, {}))


PACKED = np.round((P + 0.01) / 1e-6).astype(np.int32)
GAP = np.concatenate([TIME[:600], TIME[600:] + 0.5])

# What is written, and how it is read.
VARIANTS = {
    "plain": ({}, {}),
    "packed": (
        {
            "variables": {"position": PACKED},
            "attributes": {"position": {"scale_factor": 1e-6, "add_offset": -0.01}},
        },
        {},
    ),
    "fill value": (
        {
            "variables": {"torque": changed(TQ, 700, -9999.0)},
            "attributes": {"torque": {"_FillValue": -9999.0}},
        },
        {},
    ),
    "degrees": (
        {"variables": {"position": np.degrees(P), "reference": np.degrees(R)}},
        {"position_unit": "deg", "torque_sign": -1, "position_sign": -1},
    ),
    "time column": ({"variables": {"time": TIME + 3.0}, "sampling_rate": 0}, {}),
    "gap": ({"variables": {"time": GAP}}, {}),
    "time of another length": ({"variables": {"time": TIME[:-1]}}, {}),
    "wrong rate": ({"variables": {"time": TIME}, "sampling_rate": 500.0}, {}),
    "no rate": ({"sampling_rate": 0}, {}),
    "text": ({"variables": {"torque": np.array([b"1.5"] * N)}}, {}),
    "column": ({"variables": {"position": P[:, None], "torque": TQ[None, :]}}, {}),
    "another length": ({"variables": {"reference": R[:-1]}}, {}),
    "not finite": ({"variables": {"reference": changed(changed(R, 510, np.nan), 20, np.inf)}}, {}),
    "constant": ({"variables": {"torque": np.full(N, 2.5)}}, {}),
    "two spikes": ({"variables": {"position": changed(changed(P, 100, 1.0), 503, -1.1)}}, {}),
    "group": (
        {"group": "ankle/left"},
        {name: f"ankle/left/{name}" for name in ("position", "torque", "reference")},
    ),
    "further variables": (
        {
            "variables": {"emg": R + 1.0, "level": np.ones(N)},
            "attributes": {"emg": {"units": "mV"}},
        },
        {
            "variables": {"activity": "emg", "still": "level"},
            "position_unit": "deg",
            "torque_sign": -1,
        },
    ),
}


def outcome(read):
    try:
        return read()
    except DataError as error:
        return str(error)


def compare(path, **options):
    """Both readers agree; what they give."""
    short = outcome(lambda: read_trial(path, **{"reference": "reference"} | options))
    long = outcome(lambda: LongRecord(path, **options))
    if isinstance(long, str):
        assert long == short
        return long
    assert not isinstance(short, str), short
    piece = long.read(0, long.samples)
    xr.testing.assert_identical(piece.drop_attrs(), short.drop_attrs())
    assert long.rate == short.attrs["sampling_rate"] == piece.attrs["sampling_rate"]
    parts = [long.read(start, start + 333) for start in range(0, long.samples, 333)]
    xr.testing.assert_equal(xr.concat(parts, "time"), piece)
    return piece


@pytest.mark.parametrize("variant", VARIANTS)
def test_each_variant_is_read_or_refused_as_by_read_trial(tmp_path, monkeypatch, variant):
    monkeypatch.setattr(readers, "BLOCK", 128)
    contents, options = VARIANTS[variant]
    write(tmp_path / "rec.h5", **contents)
    compare(tmp_path / "rec.h5", **options)


def test_files_of_xarray_and_classic_netcdf(tmp_path):
    data = xr.Dataset(
        {"position": ("t", P), "torque": ("t", TQ), "reference": ("t", R)}, attrs={"fs": RATE}
    )
    packing = {"position": {"dtype": "int16", "scale_factor": 1e-6, "_FillValue": -32768}}
    data.to_netcdf(tmp_path / "packed.nc", engine="h5netcdf", encoding=packing)
    xr.DataTree.from_dict({"/": xr.Dataset(), "/left": data}).to_netcdf(
        tmp_path / "group.nc", engine="h5netcdf"
    )
    with netcdf_file(tmp_path / "classic.nc", "w") as file:
        file.createDimension("t", N)
        for name, values in {"position": P, "torque": TQ, "reference": R, "time": TIME}.items():
            file.createVariable(name, "f8", ("t",))[:] = values
    names = {name: f"left/{name}" for name in ("position", "torque", "reference")}
    assert not isinstance(compare(tmp_path / "packed.nc"), str)
    assert not isinstance(compare(tmp_path / "group.nc", **names), str)
    np.testing.assert_array_equal(compare(tmp_path / "classic.nc")["torque"], TQ)


def test_files_that_cannot_be_opened(tmp_path):
    write(tmp_path / "whole.h5")
    content = (tmp_path / "whole.h5").read_bytes()
    (tmp_path / "empty.h5").touch()
    (tmp_path / "text.h5").write_text("position,torque\n0,0\n")
    for share in (0.1, 0.5, 0.99):
        (tmp_path / f"truncated-{share}.h5").write_bytes(content[: int(share * len(content))])
    (tmp_path / "folder.h5").mkdir()
    (tmp_path / "loop.h5").symlink_to("loop.h5")
    (tmp_path / "lost.h5").symlink_to("nowhere.h5")
    names = [*os.listdir(tmp_path), "missing.h5", "none/x.h5", "x" * 300 + ".h5"]
    for name in {*names} - {"whole.h5"}:
        assert isinstance(compare(tmp_path / name), str)
    assert not isinstance(compare(tmp_path / "whole.h5"), str)
    with pytest.raises(DataError, match=r"read from \.h5, \.hdf5, \.nc, \.flb; convert it first"):
        LongRecord(tmp_path / "x.csv")


def test_a_file_that_is_changed_later_is_refused(tmp_path):
    write(tmp_path / "rec.h5")
    record = LongRecord(tmp_path / "rec.h5")
    write(tmp_path / "rec.h5", {"torque": 2 * TQ})
    with pytest.raises(
        DataError, match=r"^rec.h5: the file has been changed since the record was made"
    ):
        record.read(0, 10)
    (tmp_path / "rec.h5").unlink()
    with pytest.raises(DataError, match="there is no such file"):
        record.read(0, 10)


def test_pieces_in_any_order(tmp_path, monkeypatch):
    monkeypatch.setattr(readers, "BLOCK", 100)
    write(tmp_path / "rec.h5")
    record = LongRecord(tmp_path / "rec.h5")
    rng = np.random.default_rng(0)
    for start, length in zip(rng.integers(0, N, 12), rng.integers(1, 300, 12), strict=True):
        names = ["torque"] if length % 2 else None
        piece = record.read(int(start), int(start + length), names)
        np.testing.assert_array_equal(piece["torque"], TQ[start : start + length])
        np.testing.assert_array_equal(piece["time"], TIME[start : start + length])
        piece["torque"][:] = 0.0  # a piece is a copy


_values = st.sampled_from([0.0, 0.01, -0.01, 0.5, np.nan, np.inf, 1e308, -1e308])


@settings(max_examples=200, deadline=None)
@given(
    values=st.lists(st.tuples(_values, _values, _values), min_size=2, max_size=30),
    cuts=st.lists(st.integers(1, 30), max_size=4),
    rate=st.sampled_from([100.0, 1000.0]),
)
def test_checks_of_blocks_are_those_of_the_whole(values, cuts, rate):
    columns = dict(zip(("position", "torque", "reference"), np.array(values).T, strict=True))
    cuts = sorted({cut for cut in cuts if cut < len(values)})
    blocks = [
        dict(zip(columns, parts, strict=True))
        for parts in zip(*(np.split(column, cuts) for column in columns.values()), strict=True)
    ]
    time = ("time", np.arange(len(values)) / rate)
    trial = xr.Dataset({name: ("time", column) for name, column in columns.items()}, {"time": time})
    whole = outcome(lambda: validate(trial.assign_attrs(sampling_rate=rate), source="x"))
    assert outcome(lambda: check_samples(blocks, rate, source="x")) == (
        whole if isinstance(whole, str) else None
    )
