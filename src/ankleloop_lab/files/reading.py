"""Trials from the files of a laboratory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from scipy.interpolate import make_interp_spline

from ankleloop.errors import DataError
from ankleloop.options import check_path, show_fields
from ankleloop.signals.sampling import (
    Clock,
    check_same_rate,
    compute_rate,
    fit_clock,
    irregular_error,
)
from ankleloop.trials.files import PathLike
from ankleloop.trials.trial import check_sizes, new_trial
from ankleloop_lab.files.channels import RATE, RATE_NAMES, TIME
from ankleloop_lab.files.contents import Variable
from ankleloop_lab.files.reading_options import ReadingOptions
from ankleloop_lab.files.reading_process import read_channels
from ankleloop_lab.files.units import OPTIONS, ChannelUnit, time_factor

LOWEST_JOINT_RATE = 10.0  # Hz: times without a unit that are slower may be in ms
LARGEST_JITTER = 0.5  # sample: with more a time may be that of a neighbour
LARGEST_STEP = 5.0  # usual ones, over which samples that were taken unevenly are interpolated
HIGHEST_RESAMPLING = 10.0  # times the mean rate


@show_fields(ReadingOptions)
def read_trial(path: PathLike, **mapping: Any) -> xr.Dataset:
    r"""Read a trial from a file.

    The file format follows from the suffix: `.csv`, `.csv.gz`, `.txt`, `.tsv`, `.sto`, `.mot`, `.mat` (v4 to v7.3),
    `.h5`, `.hdf5`, `.nc`, `.flb`, and with the extra `formats` `.c3d` (its analog channels) and `.tdms`. Nested
    variables are named `group/position` in HDF5 and NetCDF, `struct.field` in MATLAB files, where columns of tables,
    properties of objects and channels of the class `nldat` are such fields. The true torques of a simulated trial are
    read too where the file has them beside the torque. Scale, offset and missing samples are applied as the attributes
    of the file state them. Another process opens the file, with limits of time and memory.

    Parameters
    ----------
    path : str or pathlib.Path
        The file.
    position, torque : str, optional
        The variables of the file, each of shape (N,), (N, 1) or (1, N), or parts of them, counted from 0: a column
        `data[:, 2]`, an element `pos[3]` of a cell array, a field `trial[2].pos` or `table.angle`. By default the only
        one that has a name of a position is taken, as `position`, `position_rad` or `ankle_angle`; in the same way the
        torque (`torque`, `moment`). Several that may be it are refused.
    reference : str, optional
        The variable of the command to the servo; it has the sign of the position. By default it is found by its name
        (`reference`, `command`), where one has such a name; "none" takes no variable for it.
    time : str, optional
        The variable of the times, which must be those of an even clock. By default, "auto", it is found beside the
        position or above it by a name or a unit of times, as `time`, `Time (s)`, `t_ms` or `timestamps`; a clock as
        text is read, too. None takes no times: then gaps are not looked for.
    sampling_rate : float, optional
        Sampling rate [Hz]. By default it comes from the file: a number called `sampling_rate`, `sample_rate`, `fs` or
        `Fs`, as a variable or an attribute, beside the position or above it; else from the times. Rates that are given,
        in the file, and of the times have to agree within 0.1 %.
    jitter : bool
        Whether times may jitter by more than half a sample (standard deviation) around an even clock. Deviations that
        return are jitter, and are straightened; a shift that lasts is a gap, and is refused. The attribute `jitter` of
        the trial has their standard deviation [samples].
    resample : float, optional
        Rate [Hz] at which samples that were taken unevenly are interpolated over their times, by cubic splines.
    position_unit, torque_unit, reference_unit : str or float, optional
        Units in the file, in any spelling, as "deg", "ft.lb" or "kgf cm"; or how many rad, or N·m, 1 is there, for
        volts, counts, or a torque for each kg. By default as the file states them, by an attribute or at the end of a
        name (`angle_deg`), else rad and N·m; a reference of which nobody says one has the unit of the position. What
        the file states is converted; an option that contradicts it is refused, and so is a number in its place.
    position_sign, torque_sign : {1, -1}
        Factors that bring the file to the convention here: the torque opposes stretch, so stiffness is positive.
    case : int, optional
        The trial of an FLB file that has several, counted from 1.
    apparatus : str, optional
        A file of `ankleloop.save_estimate` with the estimate of the device without a subject, which is subtracted
        (`ankleloop.subtract`).
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
        If the file cannot be read, or not within the limits; if it lacks a variable or a sampling rate, has an
        irregular time column or one that contradicts the sampling rate, states a unit that is none of an angle or a
        torque, or not that of an option, or a gain or an offset without a convention, or holds no valid trial; or if an
        option has a wrong value.

    See Also
    --------
    ankleloop.new_trial : A trial from arrays.
    ankleloop.load_trial : A trial that the library has saved.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "trial.csv"
    ...     _ = path.write_text("t,angle,moment\n0.00,0.0,0\n0.01,0.5,-1\n0.02,0.9,-2\n")
    ...     trial = read_trial(path, position_unit="deg", torque_sign=-1)
    >>> trial.torque.values.tolist(), trial.attrs["sampling_rate"], trial.attrs["source"]
    ([-0.0, 1.0, 2.0], 100.0, 'trial.csv')
    """
    path = check_path("read_trial", "path", path)
    ReadingOptions.check_names("read_trial", mapping)
    try:
        options = ReadingOptions.parse(path.name, **mapping)
    except ValueError as error:
        raise DataError(str(error)) from None
    variables = read_channels(
        path,
        options.case,
        variables=options.names,
        rate=options.sampling_rate,
        time=options.time,
    )
    units = options.find_units(variables, source=path.name)
    factors = find_factors(variables, units, options, source=path.name)
    signals = {role: item for role, item in variables.items() if role not in (TIME, RATE)}
    samples = {role: factors.get(role, 1.0) * item.read() for role, item in signals.items()}
    if options.resample is None:
        clock = read_clock(variables, jitter=options.jitter, source=path.name)
    else:
        samples = _resample(variables, samples, options.resample, source=path.name)
        clock = Clock(options.resample, 0.0)
    trial = new_trial(
        **samples,
        sampling_rate=clock.rate,
        jitter=clock.jitter or None,
        resample=options.resample,
        source=path.name,
        **{f"{role}_variable": signals[role].name for role in options.names if role in signals},
        **options.model_dump(include={"position_sign", "torque_sign", "case"}),
        position_unit="rad",
        **{f"{role}_unit_of_file": units[role].name for role in OPTIONS if role in units},
        gaps=None if TIME in variables else "unknown",
    )
    for name in options.further:
        trial[name].attrs["units"] = variables[name].unit
    if options.apparatus is None:
        return trial
    # Here, because their import takes time.
    from ankleloop.joint.estimate_files import load_estimate
    from ankleloop.methods.apparatus import subtract

    return subtract(trial, load_estimate(options.apparatus))


def find_factors(
    variables: Mapping[str, Variable],
    units: Mapping[str, ChannelUnit],
    options: ReadingOptions,
    *,
    source: str,
) -> dict[str, float]:
    """Factors by which channels are in rad and N·m and have the signs of the library, and times in s."""
    factors = {}
    for role, unit in units.items():
        sign = options.torque_sign if role.startswith("torque") else options.position_sign
        factors[role] = sign * unit.factor
    if TIME in variables:
        time = variables[TIME]
        factors[TIME] = time_factor(time.name, time.unit, source=source) or 1.0
    return factors


def read_clock(variables: Mapping[str, Variable], *, jitter: bool = False, source: str) -> Clock:
    """Clock of the samples: at the stated rate or that of the times, which must agree; with `jitter` of any size."""
    stated = variables[RATE].read().item() if RATE in variables else None
    if TIME in variables:
        clock = _measure_clock(variables, jitter=jitter, source=source)
        if stated is not None:
            check_same_rate(stated, clock.rate, source=source, name=variables[TIME].name)
        return replace(clock, rate=stated or clock.rate)
    if stated is None:
        raise DataError(
            f"{source}: there is no sampling rate ({', '.join(RATE_NAMES)}) and no time column (time, t): pass "
            "sampling_rate in Hz.",
            remedy={"sampling_rate": None},
        )
    return Clock(stated, 0.0)


def _measure_clock(variables: Mapping[str, Variable], *, jitter: bool, source: str) -> Clock:
    """Even clock behind the times: they have jitter about it, or else are refused."""
    times, name, has_unit = _read_times(variables, source=source)
    try:
        clock = Clock(compute_rate(times, source=source, name=name), 0.0)
    except DataError as error:
        fitted = fit_clock(times)
        if fitted is None or fitted.shift is not None:
            place = None if fitted is None else fitted.shift
            raise _refuse_times(times, error, place, source=source, name=name) from None
        clock = fitted
    if clock.jitter > LARGEST_JITTER and not jitter:
        raise DataError(
            f"{source}: {name} jitters around an even clock of {clock.rate:g} Hz by {clock.jitter:.2g} samples "
            f"(standard deviation), the most at sample {clock.largest} ({times[clock.largest or 0]:g} s): pass "
            "jitter=True if the samples were taken evenly, and stamped late; or resample in Hz if not."
        )
    if not has_unit and RATE not in variables and clock.rate < LOWEST_JOINT_RATE:
        raise DataError(
            f"{source}: {name} runs at {clock.rate:.9g} Hz, too slow for a joint: is it in ms? Then call it "
            "time_ms; or pass sampling_rate in Hz.",
            remedy={"sampling_rate": None},
        )
    return clock


def _read_times(variables: Mapping[str, Variable], *, source: str) -> tuple[np.ndarray, str, bool]:
    """Times [s], their name in the file, and whether that states their unit."""
    variable = variables[TIME]
    factor = time_factor(variable.name, variable.unit, source=source)
    times = variable.read() * (factor or 1.0)
    samples = variables["position"].read().size
    check_sizes({"position": samples, variable.name: times.size}, source=source)
    return times, variable.name, factor is not None


def _refuse_times(
    times: np.ndarray, error: DataError, place: int | None, *, source: str, name: str
) -> DataError:
    """The error of times that are no clock: where they shift, and how they may be read where they do not."""
    if place is not None:
        usual_step = float(np.median(np.diff(times)))
        error = irregular_error(times, place, usual_step, source=source, name=name)
    advice = " Where samples were taken unevenly, and none are missing, pass resample in Hz."
    steps = np.diff(times)
    is_uneven = bool(np.all((steps > 0) & (steps <= LARGEST_STEP * np.median(steps))))
    return DataError(f"{error}{advice}") if is_uneven else error


def _resample(
    variables: Mapping[str, Variable],
    samples: Mapping[str, np.ndarray],
    rate: float,
    *,
    source: str,
) -> dict[str, np.ndarray]:
    """Samples of uneven times at an even rate [Hz], by cubic splines; refused where samples are missing between."""
    if TIME not in variables:
        raise DataError(f"{source}: resample needs times, and the file has none: leave it out.")
    times, name, _ = _read_times(variables, source=source)
    steps = np.diff(times)
    usual_step = float(np.median(steps)) if steps.size else np.nan
    is_regular = (steps > 0) & (steps <= LARGEST_STEP * usual_step)
    if not is_regular.all():
        sample = int(np.argmin(is_regular)) + 1
        raise irregular_error(times, sample, usual_step, source=source, name=name)
    lowest = (times.size - 1) / (times[-1] - times[0])
    if not lowest <= rate <= HIGHEST_RESAMPLING * lowest:
        raise DataError(
            f"{source}: resample must be between the mean rate of {name}, {lowest:.6g} Hz, below which frequencies "
            f"would fold, and {HIGHEST_RESAMPLING:g} times as much; got {rate:g}."
        )
    grid = times[0] + np.arange(int((times[-1] - times[0]) * rate) + 1) / rate
    return {role: make_interp_spline(times, values)(grid) for role, values in samples.items()}
