"""Trials from the files of a laboratory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from ankleloop.errors import DataError
from ankleloop.options import check_path, show_fields
from ankleloop.signals.sampling import check_same_rate, compute_rate
from ankleloop.trials.files import PathLike
from ankleloop.trials.trial import check_sizes, new_trial
from ankleloop_lab.files.channels import RATE, RATE_NAMES, TIME
from ankleloop_lab.files.contents import Variable
from ankleloop_lab.files.reading_options import Reading, ReadingOptions
from ankleloop_lab.files.reading_process import read_channels
from ankleloop_lab.files.units import find_factor, find_position_unit, time_factor

LOWEST_JOINT_RATE = 10.0  # Hz: times without a unit that are slower may be in ms


@show_fields(ReadingOptions)
def read_trial(path: PathLike, **mapping: Any) -> xr.Dataset:
    r"""Read a trial from a file.

    The file format follows from the suffix: `.csv`, `.csv.gz`, `.txt`, `.tsv`, `.mat` (v4 to v7.3), `.h5`, `.hdf5`,
    `.nc`, `.flb`, and with the extra `formats` `.c3d` (its analog channels) and `.tdms`. Nested variables are named
    `group/position` in HDF5 and NetCDF, `struct.field` in MATLAB files, where columns of tables, properties of objects
    and channels of the class `nldat` are such fields. The true torques of a simulated trial are read too where the file
    has them beside the torque. Scale, offset and missing samples are applied as the attributes of the file state them.
    Another process opens the file, with limits of time and memory.

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
        The variable of the command to the servo; it has the unit and the sign of the position. By default it is found
        by its name (`reference`, `command`), where one has such a name; "none" takes no variable for it.
    time : str, optional
        The variable of the times, which must be regular. By default, "auto", it is found beside the position or above
        it by a name or a unit of times, as `time`, `Time (s)`, `t_ms` or `timestamps`; a clock as text is read, too.
        None takes no times: then gaps are not looked for.
    sampling_rate : float, optional
        Sampling rate [Hz]. By default it comes from the file: a number called `sampling_rate`, `sample_rate`, `fs` or
        `Fs`, as a variable or an attribute, beside the position or above it; else from the times. Rates that are given,
        in the file, and of the times have to agree within 0.1 %.
    position_unit : {"rad", "deg", "mrad", "turn"} or float, optional
        The unit of position and reference in the file, or how many rad 1 is there. By default rad or deg as the file
        states it for the position, by an attribute or at the end of its name (`angle_deg`), and rad where it states
        none.
    torque_unit : {"N·m", "mN·m", "N·cm", "lbf·ft", "lbf·in", "kgf·m"} or float, optional
        The unit of the torque in the file, also in other spellings, as "ft.lb"; or how many N·m 1 is there, for a
        torque in volts or for each kg. By default N·m; a file that states another unit is refused.
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
        irregular time column or one that contradicts the sampling rate, states another unit than `position_unit` or
        `torque_unit`, or a gain or an offset without a convention, or holds no valid trial; or if an option has a wrong
        value.

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
    options = settle_position_unit(variables, options)
    factors = find_factors(variables, options, source=path.name)
    signals = {role: item for role, item in variables.items() if role not in (TIME, RATE)}
    trial = new_trial(
        **{role: factors.get(role, 1.0) * variable.read() for role, variable in signals.items()},
        sampling_rate=choose_rate(variables, source=path.name),
        source=path.name,
        **{f"{role}_variable": signals[role].name for role in options.names if role in signals},
        **options.model_dump(include={"position_sign", "torque_sign", "case"}),
        position_unit="rad",
        position_unit_of_file=options.position_unit or "rad",
        torque_unit_of_file=options.torque_unit,
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


def settle_position_unit(variables: Mapping[str, Variable], options: Reading) -> Reading:
    """Options with the unit of the position that the file states, where they have none."""
    position = variables["position"]
    unit = options.position_unit or find_position_unit(position.name, position.unit)
    return options.model_copy(update={"position_unit": unit})


def find_factors(
    variables: Mapping[str, Variable], options: Reading, *, source: str
) -> dict[str, float]:
    """Factors by which channels are in rad and N·m and have the signs of the library, and times in s; else refused."""
    factors = {}
    for role, variable in variables.items():
        if role in (RATE, *options.further):
            continue
        if role == TIME:
            factors[TIME] = time_factor(variable.name, variable.unit, source=source) or 1.0
            continue
        unit = options.position_unit
        sign = options.position_sign
        if role.startswith("torque"):
            unit = options.torque_unit
            sign = options.torque_sign
        factors[role] = sign * find_factor(role, variable.name, variable.unit, unit, source=source)
    return factors


def choose_rate(variables: Mapping[str, Variable], *, source: str) -> float:
    """Choose the sampling rate [Hz]: the stated one, or that of the times; both must agree."""
    stated = variables[RATE].read().item() if RATE in variables else None
    if TIME in variables:
        samples = variables["position"].read().size
        measured = _measure_rate(variables[TIME], samples, stated, source=source)
        return stated or measured
    if stated is None:
        raise DataError(
            f"{source}: there is no sampling rate ({', '.join(RATE_NAMES)}) and no time column (time, t): pass "
            "sampling_rate in Hz.",
            remedy={"sampling_rate": None},
        )
    return stated


def _measure_rate(variable: Variable, samples: int, stated: float | None, *, source: str) -> float:
    """Rate [Hz] of the times, which must agree with a stated one."""
    factor = time_factor(variable.name, variable.unit, source=source)
    times = variable.read() * (factor or 1.0)
    check_sizes({"position": samples, variable.name: times.size}, source=source)
    try:
        measured = compute_rate(times, source=source, name=variable.name)
    except DataError as error:
        raise DataError(
            f"{error} If the times are wrong, and not the samples, leave them out by time=None and pass sampling_rate."
        ) from None
    if stated is not None:
        check_same_rate(stated, measured, source=source, name=variable.name)
    elif factor is None and measured < LOWEST_JOINT_RATE:
        raise DataError(
            f"{source}: {variable.name} runs at {measured:.9g} Hz, too slow for a joint: is it in ms? Then call it "
            "time_ms; or pass sampling_rate in Hz.",
            remedy={"sampling_rate": None},
        )
    return measured
