"""Whole files from which the fuzzer begins, made by code: small, and of every kind that the readers know."""

import tempfile
from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import scipy.io
import xarray as xr

RATE = 200.0
TIME = np.arange(40) / RATE
POSITION = 0.02 * np.sin(20.0 * TIME)
TORQUE = 3.0 * np.cos(20.0 * TIME)


def make_corpus(reader: str) -> list[tuple[str, bytes]]:
    """Files of a reader: suffix and content of each; those that are compressed are not compressed here."""
    with tempfile.TemporaryDirectory() as folder:
        return [(path.suffix, path.read_bytes()) for path in _MAKERS[reader](Path(folder))]


def _make_csv(folder):
    rows = [f"{t:.3f},{p!r},{q!r}" for t, p, q in zip(TIME, POSITION.tolist(), TORQUE.tolist(), strict=True)]
    text = "\n".join(["time,position,torque", *rows]) + "\n"
    quoted = text.replace("time,position,torque", '"time_s", "position","torque",note').replace(",", ", ")
    contents = {
        "a.csv": text.encode(),
        "b.csv": b"\xef\xbb\xbf" + quoted.replace("\n", ",\r\n").encode(),
        "c.csv": "\n".join(["position,torque", *(row.partition(",")[2] for row in rows)]).encode(),
    }
    for name, content in contents.items():
        (folder / name).write_bytes(content)
        yield folder / name


def _make_matlab(folder):
    plain = {"position": POSITION[:, None], "torque": TORQUE[None], "fs": RATE, "time": TIME, "note": "left"}
    struct = {**plain, "rec": {"ankle": {"pos": POSITION, "list": np.array([1.0, "b"], dtype=object)}, "flag": True}}
    for name, variables, options in (
        ("plain.mat", plain, {}),
        ("struct.mat", struct, {}),
        ("packed.mat", struct, {"do_compression": True}),
        ("v4.mat", {name: plain[name] for name in ("position", "torque", "fs")}, {"format": "4"}),
    ):
        scipy.io.savemat(folder / name, variables, **options)
        yield folder / name


def _make_hdf5(folder):
    for number, (suffix, libver) in enumerate(((".h5", "earliest"), (".h5", "latest"), (".mat", "earliest"))):
        path = folder / f"{number}{suffix}"
        block = 512 if suffix == ".mat" else 0
        with h5py.File(path, "w", libver=libver, userblock_size=block) as file:
            file["position"] = np.round(POSITION * 1e6).astype(np.int32)
            file["position"].attrs.update(units="rad", scale_factor=1e-6, _FillValue=np.int32(-1))
            file.create_dataset("torque", data=TORQUE, chunks=(16,), compression="gzip", shuffle=True)
            file["time"] = TIME
            file.attrs["sampling_rate"] = RATE
            file["notes"] = ["left", "right"]
            file["group/angle"] = POSITION[None]
            file["link"] = h5py.SoftLink("/group/angle")
        if block:
            with open(path, "r+b") as file:
                file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
        yield path


def _make_netcdf_classic(folder):
    data = xr.Dataset({"position": ("time", POSITION), "torque": ("time", TORQUE)}, coords={"time": TIME})
    data["position"].attrs["units"] = "rad"
    packing = {"position": {"dtype": "int16", "scale_factor": 1e-5, "_FillValue": -1}}
    for name, dims in (("fixed.nc", None), ("records.nc", ["time"])):
        data.to_netcdf(folder / name, engine="scipy", encoding=packing, unlimited_dims=dims)
        yield folder / name


def _make_netcdf_4(folder):
    path = folder / "a.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"time": POSITION.size}
        for name, values in (("time", TIME), ("position", POSITION), ("torque", TORQUE)):
            file.create_variable(name, ("time",), float)[:] = values
        file.variables["time"].attrs["units"] = "seconds since 2026-01-31"
        file.create_group("other").attrs["fs"] = RATE
    yield path


def _make_config(folder):
    root = Path(__file__).parents[3] / "config"
    yield from (root / "config.yaml", root / "recordings.example.yaml", root / "ci.yaml")


_MAKERS = {
    "csv": _make_csv,
    "csv.gz": _make_csv,
    "matlab": _make_matlab,
    "hdf5": _make_hdf5,
    "netcdf-classic": _make_netcdf_classic,
    "netcdf-4": _make_netcdf_4,
    "config": _make_config,
}
READERS = tuple(_MAKERS)
