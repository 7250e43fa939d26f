"""Short windows of a record around perturbations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.options import as_plain, as_real
from ankleloop.trials.trial import REQUIRED, validate

WINDOW = (-0.1, 0.25)  # s, from the onset of the perturbation
FILTERED = 0.2  # s on either side of a window, for its filters
TRIGGER_LEVEL = 0.1  # of the range of a trigger, above which it has risen
Conditions = str | Sequence[str | bool | float]


def cut(
    trial: xr.Dataset,
    onsets: str | Sequence[float],
    window: tuple[float, float] = WINDOW,
    *,
    condition: Conditions,
) -> list[xr.Dataset]:
    """Cut windows around perturbations out of a record, for the method `ensemble`.

    Parameters
    ----------
    trial : xarray.Dataset
        The record.
    onsets : str or sequence of float
        Onset of the perturbation in each window [s]; of a nominal one, in which nothing is commanded, the time at which
        it would have been. Or the variable of the record that rises there, as a trigger does.
    window : tuple of float
        Start and end of the windows from the onset [s]. Each is cut 0.2 s longer on either side, for the filters.
    condition : str or sequence
        What was commanded in each window, as "nominal", "ramp up" or the number of a sequence; or the variable of the
        record that says so at the onset.

    Returns
    -------
    list of xarray.Dataset
        Position and torque of each window over the time of the record. Their attributes hold `condition`, `onset`, the
        time of the onset from the start of each [s], and `window_start` and `window_end` [s].

    Raises
    ------
    DataError
        If there are not as many conditions as onsets, an onset lies too near to an end of the record, or windows
        overlap.

    See Also
    --------
    ankleloop.identify : With the method "ensemble" it takes the windows.

    Examples
    --------
    >>> from ankleloop import simulate
    >>> trial = simulate(seed=1, duration=10.0)
    >>> windows = cut(trial, [2.0, 4.0, 6.0], condition=["nominal", "ramp", "nominal"])
    >>> [part.attrs["condition"] for part in windows], windows[0].sizes["time"]
    (['nominal', 'ramp', 'nominal'], 750)
    """
    record = validate(trial)
    rate = float(record.attrs["sampling_rate"])
    start, end = map(float, window)
    if not start < 0.0 < end:
        raise DataError(
            f"the window from {start:g} to {end:g} s must begin before the onset and end after it."
        )
    samples = _find_samples(record, onsets, rate)
    first = round((start - FILTERED) * rate)
    last = round((end + FILTERED) * rate)
    _check_places(record, samples, first, last, round((end - start) * rate))
    conditions = _find_conditions(record, condition, samples)
    attributes = {
        **record.attrs,
        "onset": -first / rate,
        "window_start": start,
        "window_end": end,
    }
    channels = record[list(REQUIRED)]
    return [
        channels.isel(time=slice(sample + first, sample + last)).assign_attrs(
            attributes, condition=name
        )
        for sample, name in zip(samples.tolist(), conditions, strict=True)
    ]


def _find_samples(record: xr.Dataset, onsets: str | Sequence[float], rate: float) -> np.ndarray:
    """Samples of the onsets."""
    if isinstance(onsets, str):
        level = _require(record, onsets, "onsets")
        risen = level > level.min() + TRIGGER_LEVEL * np.ptp(level)
        samples = np.flatnonzero(np.diff(risen.astype(int), prepend=1) == 1)
        if not samples.size:
            raise DataError(
                f"{onsets} never rises, so it has no onsets: name a trigger, or give times."
            )
        return samples
    times = as_real(onsets, "onsets")
    return np.rint((times - record["time"].values[0]) * rate).astype(int)


def _find_conditions(record: xr.Dataset, condition: Conditions, samples: np.ndarray) -> list[str]:
    """Names of the conditions of the windows."""
    if isinstance(condition, str):
        values = _require(record, condition, "condition")[samples].tolist()
    else:
        values = list(condition)
    if len(values) != samples.size:
        raise DataError(
            f"there are {samples.size} onsets and {len(values)} conditions: give one for each."
        )
    return list(map(name_condition, values))


def name_condition(value: object) -> str:
    """A condition as a text; numbers without a fraction are written without one."""
    plain = as_plain(value)
    return f"{plain:g}" if isinstance(plain, float) else str(plain)


def _require(record: xr.Dataset, name: str, option: str) -> np.ndarray:
    """A variable of the record."""
    if name not in record.data_vars:
        known = ", ".join(map(str, record.data_vars))
        raise DataError(
            f"the trial has no variable {name!r} for {option}; it has {known}. Read it with the trial (variables of "
            "read_trial), or give a value for each window."
        )
    return record[name].values


def _check_places(
    record: xr.Dataset, samples: np.ndarray, first: int, last: int, length: int
) -> None:
    """Refuse onsets too near to an end of the record, and windows that overlap."""
    time = record["time"].values
    rate = float(record.attrs["sampling_rate"])
    for number, sample in enumerate(samples.tolist(), 1):
        if sample + first < 0 or sample + last > time.size:
            raise DataError(
                f"onset {number} of {samples.size}, at {time[0] + sample / rate:g} s, is too near to an end of the "
                f"record, which goes from {time[0]:g} to {time[-1]:g} s: its window and the filters take "
                f"{-first / rate:g} s before it and {last / rate:g} s after it. Leave it out; onsets are in seconds of "
                "the record."
            )
    ordered = np.sort(samples)
    near = np.flatnonzero(np.diff(ordered) < length)
    if near.size:
        onset, following = time[ordered[near[0] : near[0] + 2]]
        raise DataError(
            f"the windows of the onsets at {onset:g} and {following:g} s overlap: leave one of them out, or take a "
            "shorter window."
        )
