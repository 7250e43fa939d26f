"""Trials from the files of a laboratory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.records.file_formats import FileContents, read_contents
from ankleloop.records.reading_options import ReadingOptions
from ankleloop.records.trial import TRUE_TORQUES, as_signal, new_trial
from ankleloop.signals.sampling import check_same_rate, compute_rate, parse_rate

if TYPE_CHECKING:
    import os

__all__ = ["read_trial"]

# Upper and lower case count: T is often the torque, not the time.
RATE_NAMES = ("sampling_rate", "sample_rate", "fs", "Fs")
TIME_NAMES = ("time", "time_s", "t", "Time")


def read_trial(
    path: str | os.PathLike[str],
    *,
    position: str = "position",
    torque: str = "torque",
    reference: str | None = None,
    sampling_rate: float | None = None,
    position_unit: str = "rad",
    position_sign: int = 1,
    torque_sign: int = 1,
) -> xr.Dataset:
    r"""Read a trial from a file.

    The file format follows from the suffix: `.csv`, `.csv.gz`, `.mat` (v5 and v7.3), `.h5`, `.hdf5`, `.nc`. Nested
    variables are named `group/position` in HDF5 and NetCDF, `struct.field` in MATLAB files. The true torques of a
    simulated trial are read too where the file has them beside the torque.

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
        contradicts the sampling rate, states another unit than `position_unit`, or holds no valid trial; or if an
        option has a wrong value.

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
    path = Path(path)
    options = _parse_options(
        path.name,
        position=position,
        torque=torque,
        reference=reference,
        sampling_rate=None if sampling_rate is None else parse_rate(sampling_rate, source=path.name),
        position_unit=position_unit,
        position_sign=position_sign,
        torque_sign=torque_sign,
    )
    contents = read_contents(path)
    signals = {channel: _read_signal(contents, name) for channel, name in options.variables.items()}
    signals |= _read_true_torques(contents, options.torque)
    for channel in signals:
        if channel in ("position", "reference"):
            _check_unit(contents, options.variables[channel], options.position_unit)
        signals[channel] *= options.factor(channel)
    return new_trial(
        **signals,
        sampling_rate=_read_rate(contents, options, signals["position"].size),
        source=path.name,
        **{f"{channel}_variable": name for channel, name in options.variables.items()},
        **options.model_dump(include={"position_unit", "position_sign", "torque_sign"}),
    )


def _parse_options(source: str, **values: Any) -> ReadingOptions:
    try:
        return ReadingOptions.parse(source, **values)
    except ValueError as error:
        raise DataError(f"{source}: {error}") from None


def _read_true_torques(contents: FileContents, torque: str) -> dict[str, np.ndarray]:
    """True torques that the file has beside the torque."""
    parent, separator, _ = contents.find_variable(torque).rpartition(contents.separator)
    names = {channel: f"{parent}{separator}{channel}" for channel in TRUE_TORQUES}
    return {channel: _read_signal(contents, name) for channel, name in names.items() if name in contents.variables}


def _read_signal(contents: FileContents, name: str) -> np.ndarray:
    variable = contents.find_variable(name)
    values = contents.variables[variable]
    _check_numbers(contents, variable, values)
    return as_signal(values, variable, source=contents.path.name)


def _check_numbers(contents: FileContents, name: str, values: Any) -> None:
    if np.asarray(values).dtype.kind not in "OUS":
        return
    cells = pd.Series(np.ravel(values))
    text = cells[pd.to_numeric(cells, errors="coerce").isna() & cells.notna()]
    if text.size:
        raise DataError(
            f"{contents.path.name}: {name} is not a number {contents.locate_sample(text.index[0])} but "
            f"{text.iloc[0]!r}: correct the file, or choose another variable."
        )


def _check_unit(contents: FileContents, name: str, position_unit: str) -> None:
    stated = contents.find_unit(name)
    if not stated:
        return
    fault = f"{contents.path.name}: {name} is in {stated!r} according to the file"
    if not stated.startswith(("rad", "deg", "°")):
        raise DataError(f"{fault}: convert it to rad or deg.")
    unit = "rad" if stated.startswith("rad") else "deg"
    if unit != position_unit:
        raise DataError(
            f"{fault}, but position_unit is {position_unit!r}: pass position_unit={unit!r}, or correct the file."
        )


def _read_rate(contents: FileContents, options: ReadingOptions, size: int) -> float:
    """Sampling rate [Hz]: the option, else a number in the file, else the rate of the times, which must agree."""
    stated = options.sampling_rate
    if stated is None:
        stated = _read_stated_rate(contents, options.position)
    name = contents.find_nearest(TIME_NAMES, options.position, scalar=False)
    if name is None or name in options.variables.values():
        if stated is None:
            raise DataError(
                f"{contents.path.name}: there is no sampling rate ({', '.join(RATE_NAMES)}) and no time column "
                f"({', '.join(TIME_NAMES)}): pass sampling_rate in Hz."
            )
        return stated
    measured = _read_time_rate(contents, name, size)
    if stated is None:
        return measured
    check_same_rate(stated, measured, source=contents.path.name, name=name)
    return stated


def _read_stated_rate(contents: FileContents, position: str) -> float | None:
    name = contents.find_nearest(RATE_NAMES, position, scalar=True)
    if name is None:
        return None
    return parse_rate(np.ravel((contents.attributes | contents.variables)[name])[0], source=contents.path.name)


def _read_time_rate(contents: FileContents, name: str, size: int) -> float:
    source = contents.path.name
    unit = contents.find_unit(name)
    if unit and not unit.startswith("s"):  # "s", "sec", "seconds since …"
        raise DataError(f"{source}: {name} is in {unit!r} according to the file: write it in seconds.")
    time = _read_signal(contents, name)
    if time.size != size:
        raise DataError(f"{source}: {name} has {time.size} samples but position has {size}: cut both to the same.")
    return compute_rate(time, source=source, name=name)
