"""Trials from the files of a laboratory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.options import check_path, show_fields
from ankleloop.signals.sampling import check_same_rate, compute_rate_of_parts, parse_rate
from ankleloop.trials.channels import (
    RATE,
    RATE_NAMES,
    TIME,
    TIME_NAMES,
    Variable,
    check_unit,
    time_factor,
)
from ankleloop.trials.files import PathLike
from ankleloop.trials.reading_options import ReadingOptions
from ankleloop.trials.reading_process import read_channels
from ankleloop.trials.trial import check_shape, check_sizes, new_trial

LOWEST_RATE = 10.0  # Hz: below it, times without a unit are taken to be in ms


@show_fields(ReadingOptions)
def read_trial(path: PathLike, **mapping: Any) -> xr.Dataset:
    r"""Read a trial from a file.

    The file format follows from the suffix: `.csv`, `.csv.gz`, `.mat` (v5 and v7.3), `.h5`, `.hdf5`, `.nc`, `.flb`.
    Nested variables are named `group/position` in HDF5 and NetCDF, `struct.field` in MATLAB files. The true torques of
    a simulated trial are read too where the file has them beside the torque. Scale, offset and missing samples are
    applied as the attributes of the file state them. Another process opens the file, with limits of time and memory.

    Parameters
    ----------
    path : str or pathlib.Path
        The file.
    position, torque : str
        The variables of the file, each of shape (N,), (N, 1) or (1, N). Where none is called `position`, the only one
        that has a name of a position is taken, as `position_rad` or `ankle_angle`; in the same way the torque.
    reference : str, optional
        The variable of the command to the servo; it has the unit and the sign of the position.
    sampling_rate : float, optional
        Sampling rate [Hz]. By default it comes from the file: a number called `sampling_rate`, `sample_rate`, `fs` or
        `Fs`, as a variable or an attribute, beside the position or above it; else from a column `time`, `time_s`, `t`
        or `Time` [s], `time_ms`, `t_ms` or `time_us`. A time column must be regular. Rates that are given, in the
        file, and of the time column have to agree within 0.1 %.
    position_unit : {"rad", "deg"}
        The unit of position and reference in the file.
    position_sign, torque_sign : {1, -1}
        Factors that bring the file to the convention here: the torque opposes stretch, so stiffness is positive.
    case : int, optional
        The trial of an FLB file that has several, counted from 1.
    variables : mapping of str to str, optional
        Further variables, as the one that schedules a joint or the phase of a cycle: the name in the trial, and the
        variable of the file. Their numbers stay as the file has them.

    Returns
    -------
    xarray.Dataset
        The trial, in rad and N·m over `time` [s] from 0. Its attributes record the name of the file and how the
        file was read.

    Raises
    ------
    DataError
        If the file cannot be read, or not within the limits; if it has more than 20 million samples, lacks a variable
        or a sampling rate, has an irregular time column or one that contradicts the sampling rate, states another unit
        than `position_unit` or N·m, or holds no valid trial; or if an option has a wrong value.

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
    path = check_path("read_trial", "path", path)
    options = parse_options("read_trial", path.name, mapping)
    channels = _read(path, options)
    times = [channels[TIME].values] if TIME in channels else []
    rate = choose_rate(channels, options, times, source=path.name)
    trial = new_trial(
        **{
            role: channels[role].values * options.factor(role)
            for role in channels
            if role not in (TIME, RATE)
        },
        sampling_rate=rate,
        source=path.name,
        **{f"{role}_variable": channels[role].name for role in options.names},
        **options.model_dump(include={"position_sign", "torque_sign", "case"}),
        position_unit="rad",
        position_unit_of_file=options.position_unit,
    )
    for name in options.further:
        trial[name].attrs["units"] = channels[name].unit
    return trial


def parse_options(owner: str, source: str, values: Mapping[str, Any]) -> ReadingOptions:
    """Check the options of reading."""
    ReadingOptions.check_names(owner, values)
    try:
        return ReadingOptions.parse(source, **values)
    except ValueError as error:
        raise DataError(str(error)) from None


def _read(path: PathLike, options: ReadingOptions, **wanted: Any) -> dict[str, Variable]:
    """Read channels of a file; `wanted` is what `channels.select_channels` takes beside names and rate."""
    return read_channels(
        path, options.case, variables=options.names, rate=options.sampling_rate, **wanted
    )


def choose_rate(
    channels: Mapping[str, Variable],
    options: ReadingOptions,
    times: Iterable[np.ndarray],
    *,
    source: str,
) -> float:
    """Check units and shapes of channels, and choose the sampling rate: the stated one, else that of the times.

    All that the file says of it, and the times, which are read in parts, must agree with a rate of the file.
    """
    for role, channel in channels.items():
        if role not in (TIME, RATE):
            if role not in options.further:
                check_unit(role, channel.name, channel.unit, options.position_unit, source=source)
            check_shape(channel.shape, channel.name, source=source)
    rates = (
        [parse_rate(number, source=source) for number in channels[RATE].values]
        if RATE in channels
        else []
    )
    given = options.sampling_rate
    if given is not None:  # which of several rates is right
        rates = sorted(rates, key=lambda rate: abs(rate - given))[:1]
    for rate in rates:
        check_same_rate(given or rates[0], rate, source=source, name=channels[RATE].name)
    stated = given or next(iter(rates), None)
    if TIME not in channels:
        if stated is None:
            raise DataError(
                f"{source}: there is no sampling rate ({', '.join(RATE_NAMES)}) and no time column "
                f"({', '.join(TIME_NAMES)}): pass sampling_rate in Hz."
            )
        return stated
    time, size = channels[TIME], max(channels["position"].shape)
    samples = check_shape(time.shape, time.name, source=source)
    check_sizes({"position": size, time.name: samples}, source=source)
    factor = time_factor(time.name, time.unit, source=source)
    parts = (part * (factor or 1.0) for part in times)
    measured = compute_rate_of_parts(parts, samples, source=source, name=time.name)
    if stated is None and factor is None and measured < LOWEST_RATE:
        raise DataError(
            f"{source}: {time.name} runs at {measured:.9g} Hz, too slow for a joint: is it in ms? Then call it "
            "time_ms; or pass sampling_rate in Hz."
        )
    check_same_rate(stated or measured, measured, source=source, name=time.name)
    return stated or measured
