"""Files of a laboratory, read into trials: CSV, MATLAB (v5 and v7.3), HDF5 and NetCDF."""

import csv
import gzip
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import scipy.io
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.records.trial import TRUTHS, as_signal, new_trial
from ankleloop.signals.sampling import as_rate, check_same_rate, rate_from_time

__all__ = ["read_trial"]

# Exact letters only: T is often the torque, not the time.
RATE_NAMES = ("sampling_rate", "sample_rate", "fs", "Fs")
TIME_NAMES = ("time", "time_s", "t", "Time")


def read_trial(
    path,
    *,
    position="position",
    torque="torque",
    reference=None,
    sampling_rate=None,
    position_unit="rad",
    position_sign=1,
    torque_sign=1,
):
    r"""Read a recording from a file.

    The container follows from the suffix: `.csv`, `.csv.gz`, `.mat` (v5 and v7.3), `.h5`, `.hdf5`, `.nc`. Nested
    variables are named `group/position` in HDF5 and NetCDF, `struct.field` in MATLAB files. The true torques of a
    simulated trial come along where the file has them beside the torque.

    Parameters
    ----------
    path : str or pathlib.Path
        The file.
    position, torque : str
        The variables of the file, each of shape (N,), (N, 1) or (1, N).
    reference : str, optional
        The variable of the command to the servo; it has the unit and the sign of the position.
    sampling_rate : float, optional
        Sampling rate [Hz]. By default it comes from the file: a number called `sampling_rate`, `sample_rate`, `fs` or
        `Fs`, as a variable or an attribute, beside the position or above it; else from a column `time`, `time_s`, `t`
        or `Time` [s]. A time column must be regular and agree with the rate within 0.1 % in any case.
    position_unit : {"rad", "deg"}
        The unit of position and reference in the file.
    position_sign, torque_sign : {1, -1}
        Factors that bring the file to the convention here: the torque opposes stretch, so stiffness is positive.

    Returns
    -------
    xarray.Dataset
        The trial, in rad and N·m over `time` [s] from 0. Its attributes record the name of the file and how the
        file was read.

    Raises
    ------
    DataError
        If the file cannot be read, lacks a variable or a sampling rate, has an irregular time column or one that
        contradicts the sampling rate, states another unit than `position_unit`, or holds no valid trial.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "trial.csv"
    ...     _ = path.write_text("t,angle,moment\n0.00,0.0,0\n0.01,0.5,-1\n0.02,0.9,-2\n")
    ...     trial = read_trial(path, position="angle", torque="moment", position_unit="deg", torque_sign=-1)
    >>> trial.torque.values.tolist(), trial.attrs["sampling_rate"], trial.attrs["source"]
    ([-0.0, 1.0, 2.0], 100.0, 'trial.csv')
    """
    if position_unit not in ("rad", "deg"):
        raise DataError(f"position_unit is {position_unit!r}: pass 'rad' or 'deg'.")
    for name, sign in (("position_sign", position_sign), ("torque_sign", torque_sign)):
        if sign not in (1, -1):
            raise DataError(f"{name} is {sign!r}: pass 1 or -1.")
    path = Path(path)
    contents = _read_contents(path)
    names = {"position": position, "torque": torque}
    if reference is not None:
        names["reference"] = reference
    signals = {role: _signal(contents, path, name) for role, name in names.items()}
    signals |= _truths(contents, path, torque)
    for role in signals:
        if role.startswith("torque"):
            signals[role] *= torque_sign
        else:
            _check_unit(contents, path.name, names[role], position_unit)
            signals[role] *= position_sign * (np.pi / 180.0 if position_unit == "deg" else 1.0)
    rate = _rate(contents, path, names, signals["position"].size, sampling_rate)
    record = {f"{role}_variable": name for role, name in names.items()}
    record |= {"position_unit": position_unit, "position_sign": int(position_sign), "torque_sign": int(torque_sign)}
    return new_trial(**signals, sampling_rate=rate, source=path.name, **record)


@dataclass
class _Contents:
    """A file, flattened: nested names joined by the separator, an attribute named below the object it belongs to."""

    variables: dict
    attributes: dict = field(default_factory=dict)
    separator: str = "/"

    def find(self, name):
        """Full name of a variable, or None; a leading slash, as HDF5 tools show it, does not matter."""
        return next((n for n in (name, name.lstrip("/")) if n in self.variables), None)

    def nearest(self, names, beside, scalar):
        """Full name of the first scalar, or else array, of these names: on a variable, beside it, or further up."""
        known = self.attributes | self.variables if scalar else self.variables
        scope = self.find(beside).split(self.separator)
        for depth in range(len(scope), -1, -1):
            for name in (self.separator.join([*scope[:depth], name]) for name in names):
                if name in known and (np.size(known[name]) == 1) == scalar:
                    return name
        return None

    def units(self, name):
        """Units that the file states for a variable, in lower case, or the empty string."""
        stated = np.ravel(self.attributes.get(f"{self.find(name)}{self.separator}units", ""))
        text = stated[0] if stated.size else ""
        return (text.decode(errors="replace") if isinstance(text, bytes) else str(text)).strip().lower()


def _read_contents(path):
    if not path.is_file():
        raise DataError(f"{path}: there is no such file: check the path.")
    suffix = next((suffix for suffix in _READERS if path.name.lower().endswith(suffix)), None)
    if suffix is None:
        raise DataError(f"{path.name}: unknown kind of file: convert it to one of {', '.join(_READERS)}.")
    try:
        return _READERS[suffix](path)
    except Exception as cause:  # the libraries raise almost anything on a damaged file
        reason = f"{type(cause).__name__}: {cause}".partition("\n")[0]
        raise DataError(
            f"{path.name}: cannot be read as {suffix} ({reason}): check that the file is whole and its suffix right."
        ) from cause


def _read_csv(path):
    with warnings.catch_warnings():
        # A line of more cells than the header, as decimal commas make, would lose its last cells.
        warnings.simplefilter("error", pd.errors.ParserWarning)
        # index_col=False: a comma at the end of each line must not shift the columns.
        frame = pd.read_csv(path, index_col=False, skipinitialspace=True, low_memory=False)
    return _Contents({name.strip(): frame[name].to_numpy() for name in frame.columns})


def _read_mat(path):
    if h5py.is_hdf5(path):
        return _read_hdf5(path, separator=".")
    workspace = scipy.io.loadmat(path, simplify_cells=True)
    return _Contents(dict(_fields({k: v for k, v in workspace.items() if not k.startswith("__")})), separator=".")


def _fields(struct, prefix=""):
    for name, value in struct.items():
        if isinstance(value, dict):
            yield from _fields(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _read_hdf5(path, separator="/"):
    contents = _Contents({}, separator=separator)

    def flatten(name, item):
        name = name.replace("/", separator)
        if name.startswith("#"):  # MATLAB keeps its internals in #refs# and #subsystem#
            return
        contents.attributes.update({f"{name}{separator}{key}": value for key, value in item.attrs.items()})
        if isinstance(item, h5py.Dataset):
            # For an empty array MATLAB stores its size instead, which would pass for samples.
            contents.variables[name] = np.empty(0) if item.attrs.get("MATLAB_empty", 0) else item[()]

    with h5py.File(path, "r") as file:
        contents.attributes.update(file.attrs.items())
        file.visititems(flatten)
    return contents


def _read_netcdf(path):
    if h5py.is_hdf5(path):
        groups = xr.open_groups(path, engine="h5netcdf", decode_times=False)
    else:  # classic NetCDF, which has no groups
        groups = {"/": xr.open_dataset(path, engine="scipy", decode_times=False)}
    contents = _Contents({})
    for group, dataset in groups.items():
        prefix = f"{group.strip('/')}/".lstrip("/")
        with dataset:
            contents.attributes.update({f"{prefix}{key}": value for key, value in dataset.attrs.items()})
            for name, variable in dataset.variables.items():
                contents.variables[f"{prefix}{name}"] = variable.to_numpy()
                contents.attributes.update({f"{prefix}{name}/{key}": value for key, value in variable.attrs.items()})
    return contents


_READERS = {
    ".csv": _read_csv,
    ".csv.gz": _read_csv,
    ".mat": _read_mat,
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
    ".nc": _read_netcdf,
}


def _signal(contents, path, name):
    full = contents.find(name)
    if full is None:
        raise DataError(
            f"{path.name}: there is no variable {name!r}; the file has: {', '.join(contents.variables) or 'none'}. "
            "Name one of these."
        )
    _check_numeric(path, full, contents.variables[full])
    return as_signal(contents.variables[full], full, source=path.name)


def _check_numeric(path, name, values):
    if np.asarray(values).dtype.kind not in "OUS":
        return
    cells = pd.Series(np.ravel(values))
    text = cells[pd.to_numeric(cells, errors="coerce").isna() & cells.notna()]
    if text.size:
        row = text.index[0]
        where = f"in line {_line(path, row)}" if path.name.lower().endswith((".csv", ".csv.gz")) else f"at sample {row}"
        found = f"{name} is not a number {where} but {text.iloc[0]!r}"
        raise DataError(f"{path.name}: {found}: correct the file, or choose another variable.")


def _line(path, row):
    """Line of the file that holds a row of the table; blank lines are no rows, and the header is one."""
    opener = gzip.open if path.name.lower().endswith(".gz") else open
    with opener(path, "rt", encoding="utf-8", newline="") as file:
        lines = csv.reader(file)
        return [lines.line_num for cells in lines if cells][row + 1]


def _truths(contents, path, torque):
    parent, separator, _ = contents.find(torque).rpartition(contents.separator)
    names = {truth: f"{parent}{separator}{truth}" for truth in TRUTHS}
    return {truth: _signal(contents, path, name) for truth, name in names.items() if name in contents.variables}


def _check_unit(contents, source, name, position_unit):
    stated = contents.units(name)
    if not stated:
        return
    if not stated.startswith(("rad", "deg", "°")):
        raise DataError(f"{source}: {name} is in {stated!r} according to the file: convert it to rad or deg.")
    unit = "rad" if stated.startswith("rad") else "deg"
    if unit != position_unit:
        raise DataError(
            f"{source}: {name} is in {stated!r} according to the file, but position_unit is {position_unit!r}: "
            f"pass position_unit={unit!r}, or correct the file."
        )


def _rate(contents, path, names, size, argument):
    """Choose the sampling rate [Hz]: the argument, else a number in the file, else the time, which must agree."""
    stated = argument
    if stated is None:
        name = contents.nearest(RATE_NAMES, names["position"], scalar=True)
        stated = None if name is None else np.ravel((contents.attributes | contents.variables)[name])[0]
    if stated is not None:
        stated = as_rate(stated, source=path.name)
    name = contents.nearest(TIME_NAMES, names["position"], scalar=False)
    if name is None or name in names.values():
        if stated is None:
            raise DataError(
                f"{path.name}: there is no sampling rate ({', '.join(RATE_NAMES)}) and no time column "
                f"({', '.join(TIME_NAMES)}): pass sampling_rate in Hz."
            )
        return stated
    measured = _rate_of_column(contents, path, name, size)
    if stated is not None:
        check_same_rate(stated, measured, source=path.name, name=name)
    return measured if stated is None else stated


def _rate_of_column(contents, path, name, size):
    unit = contents.units(name)
    if unit and not unit.startswith("s"):  # "s", "sec", "seconds since …"
        raise DataError(f"{path.name}: {name} is in {unit!r} according to the file: write it in seconds.")
    time = _signal(contents, path, name)
    if time.size != size:
        raise DataError(f"{path.name}: {name} has {time.size} samples but position has {size}: cut both to the same.")
    return rate_from_time(time, source=path.name, name=name)
