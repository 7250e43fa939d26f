"""Whole files from which the fuzzer begins, made by code: small, and of every kind that the readers know."""

from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import pandas as pd
import scipy.io
import xarray as xr
from matio import save_to_mat

from ankleloop import identify, save_estimate, save_trial, simulate
from ankleloop.trials.files import CHECKSUM_LENGTH
from ankleloop.trials.trial_files import save_trials

RATE = 200.0
TIME = np.arange(40) / RATE
POSITION = 0.02 * np.sin(20.0 * TIME)
TORQUE = 3.0 * np.cos(20.0 * TIME)


def make_corpus(reader: str, folder: Path) -> list[tuple[str, bytes]]:
    """Suffix and content of each file of a reader, made in a folder; none of them is compressed as a whole."""
    _MAKERS[reader](folder)
    return [(path.suffix, path.read_bytes()) for path in sorted(folder.iterdir())]


def _make_csv(folder):
    rows = [
        f"{t:.3f},{p!r},{q!r}"
        for t, p, q in zip(TIME, POSITION.tolist(), TORQUE.tolist(), strict=True)
    ]
    text = "\n".join(["time,position,torque", *rows]) + "\n"
    quoted = text.replace("time,position,torque", '"time_s", "position","torque",note').replace(
        "\n", ",\r\n"
    )
    (folder / "plain.csv").write_text(text)
    (folder / "quoted.csv").write_text(quoted, encoding="utf-8-sig")


def _make_matlab(folder):
    plain = {"position": POSITION[:, None], "torque": TORQUE[None], "fs": RATE, "time": TIME}
    struct = {"ankle": {"pos": POSITION, "list": np.array([1.0, "b"], dtype=object)}, "flag": True}
    scipy.io.savemat(folder / "plain.mat", plain)
    scipy.io.savemat(folder / "struct.mat", plain | {"rec": struct, "note": "left"})
    scipy.io.savemat(folder / "packed.mat", plain | {"rec": struct}, do_compression=True)
    scipy.io.savemat(folder / "v4.mat", plain, format="4")
    signals = {"time": TIME, "position": POSITION, "torque": TORQUE}
    objects = {"T": pd.DataFrame(signals), "rec": {name: x[None] for name, x in signals.items()}}
    for version in ("v7", "v7.3"):
        save_to_mat(folder / f"objects-{version}.mat", objects, version=version)


def _make_hdf5(folder):
    for libver in ("earliest", "latest"):
        with h5py.File(folder / f"{libver}.h5", "w", libver=libver) as file:
            file["position"] = np.round(POSITION * 1e6).astype(np.int32)
            file["position"].attrs.update(units="rad", scale_factor=1e-6, _FillValue=np.int32(-1))
            file.create_dataset(
                "torque", data=TORQUE, chunks=(16,), compression="gzip", shuffle=True
            )
            file["time"] = TIME
            file.attrs["sampling_rate"] = RATE
            file["group/angle"] = POSITION[None]
            file["link"] = h5py.SoftLink("/group/angle")


def _make_netcdf_classic(folder):
    data = xr.Dataset(
        {"position": ("time", POSITION), "torque": ("time", TORQUE)}, coords={"time": TIME}
    )
    packing = {"position": {"dtype": "int16", "scale_factor": 1e-5, "_FillValue": -1}}
    for name, dims in (("fixed.nc", None), ("records.nc", ["time"])):
        data.to_netcdf(folder / name, engine="scipy", encoding=packing, unlimited_dims=dims)


def _make_netcdf_4(folder):
    with h5netcdf.File(folder / "a.nc", "w") as file:
        file.dimensions = {"time": POSITION.size}
        for name, values in (("time", TIME), ("position", POSITION), ("torque", TORQUE)):
            file.create_variable(name, ("time",), float)[:] = values
        file.variables["time"].attrs["units"] = "seconds since 2026-01-31"
        file.create_group("other").attrs["fs"] = RATE


def _make_trial(folder):
    save_trial(simulate(seed=1, duration=2.0), folder / "a.nc")
    _remove_checksum(folder / "a.nc")


def _make_trials(folder):
    save_trials([simulate(seed=1, duration=2.0)] * 2, folder / "a.nc", [("a", 0), ("a", 1)])
    _remove_checksum(folder / "a.nc")


def _make_estimate(folder):
    estimate = identify(simulate(seed=1, duration=10.0), "pr-moesp")
    save_estimate(estimate, folder / "a.nc")
    save_estimate(estimate, folder / "a.mat")
    _remove_checksum(folder / "a.nc")


def _remove_checksum(path):
    """Without it damage is not seen before the file is read."""
    path.write_bytes(path.read_bytes()[:-CHECKSUM_LENGTH])


_MAKERS = {
    "csv": _make_csv,
    "csv.gz": _make_csv,
    "matlab": _make_matlab,
    "hdf5": _make_hdf5,
    "netcdf-classic": _make_netcdf_classic,
    "netcdf-4": _make_netcdf_4,
    "trial": _make_trial,
    "trials": _make_trials,
    "estimate": _make_estimate,
}
READERS = tuple(_MAKERS)
