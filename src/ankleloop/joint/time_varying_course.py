"""What the parameters of a joint vary with, place and segment of each sample; splines and trajectories over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import Grid
from ankleloop.quantities import QUANTITIES
from ankleloop.trials.group_files import Fields

MARGIN = 0.75  # s at either end of a record that responses and filters touch
FEWEST_CYCLES = 8
SEGMENT = 1.0  # s: segments of a record without cycles, which count as independent
OUTSIDE = (
    0.02  # share of the samples at either end of a scheduling variable that lie beyond its range
)
UNEVEN = 1.8  # ratio of a cycle to the median one, or of that to a cycle: an onset is missing, or one too many
SAME_PHASE = 1e-4
COMMON = (
    0.5  # share of its fast changes that a scheduling variable may have in common with the position
)
FALL = -0.5  # of a phase from 0 to 1, where a cycle begins
NO_VARIABLE = (
    "Name one of these, or read another one with the trial: variables of read_trial, a further "
    "array of new_trial."
)
COORDINATES = {
    "phase": ("1", "phase of the cycle"),
    "time": ("s", "time from the first sample"),
    "schedule": ("", "scheduling variable"),
}
NAMES = ("K", "B", "G", "I")
ENDS = {
    "": "{}",
    "_low": "lower end of the 95 % band of the {}",
    "_high": "upper end of the 95 % band of the {}",
}


@dataclass(frozen=True, eq=False)
class Course:
    """Place of each decimated sample within what the parameters vary with, and the samples that count."""

    dimension: str  # "phase", "time" or "schedule"
    place: np.ndarray  # shape (N,): place, from 0 to 1
    # Phase, time from the first sample of the record [s] or scheduling variable at the places 0 and 1.
    limits: tuple[float, float]
    rows: slice  # samples that count; they are whole segments
    # Shape (rows,): number of the cycle, or of the segment of a record without cycles, of each of them.
    segment: np.ndarray
    since: (
        np.ndarray
    )  # shape (rows,): samples since the onset of the cycle; of the segment, without cycles

    @property
    def periodic(self) -> bool:
        """Whether place 1 is place 0 again."""
        return self.dimension == "phase"

    @cached_property
    def segments(self) -> int:
        """Number of cycles or segments."""
        return int(self.segment[-1]) + 1

    @cached_property
    def equal_cycles(self) -> int:
        """Samples of each cycle where all have the same number and phases, else 0."""
        sizes = np.bincount(self.segment)
        if (
            not self.periodic
            or np.ptp(sizes) > 0
            or np.ptp(self.place[self.rows][:: sizes[0]]) > SAME_PHASE
        ):
            return 0
        return int(sizes[0])


def find_onsets(trial: PreparedTrial, onsets: str | Sequence[float]) -> np.ndarray:
    """Start of every cycle [s]; onsets that are not those of the record, or of uneven cycles, are refused.

    Shapes: returns (cycles,).
    """
    time = trial.time
    if isinstance(onsets, str):
        trial.check_variable(onsets, "for cycle_onsets", NO_VARIABLE)
        phase = trial.samples[onsets]
        if phase.min() < -1e-6 or phase.max() > 1 + 1e-6:
            raise DataError(
                f"{onsets} goes from {phase.min():.3g} to {phase.max():.3g}, and the phase of a cycle goes from 0 to "
                "1: give the onsets of the cycles in seconds, or a variable with the phase."
            )
        starts = np.flatnonzero(np.diff(phase) < FALL) + 1
        # The phase tells where between two samples the cycle began.
        slope = np.median(np.diff(phase)[np.diff(phase) > 0]) * trial.rate if starts.size else 1.0
        values = time[starts] - phase[starts] / slope
    else:
        values = np.asarray(onsets, dtype=float)
    if values.ndim != 1 or values.size < 2:
        raise DataError(
            "there are fewer than two onsets of cycles: give the start of every cycle in seconds."
        )
    durations = np.diff(values)
    if not (durations > 0).all():
        k = int(np.argmin(durations > 0)) + 1
        raise DataError(
            f"onset {k + 1} of {values.size} ({values[k]:g} s) is not after the one before: sort them, and leave out "
            "those that are there twice or are no times."
        )
    cycle = float(np.median(durations))
    beyond = values[0] < time[0] - 1.5 * cycle or values[-1] > time[-1] + 1.5 * cycle
    missing = values[0] > time[0] + 2.5 * cycle or values[-1] < time[-1] - 2.5 * cycle
    if (beyond and missing) or cycle > time[-1] - time[
        0
    ]:  # those of a whole trial cover its segments
        raise DataError(
            f"the onsets go from {values[0]:g} to {values[-1]:g} s, the record from {time[0]:g} to {time[-1]:g} s: "
            "give them in seconds of the record, not milliseconds or samples; a segment keeps the times of its trial."
        )
    k = int(np.argmax(np.abs(np.log(durations / cycle))))
    if not cycle / UNEVEN <= durations[k] <= cycle * UNEVEN:
        raise DataError(
            f"the cycle that begins at {values[k]:g} s lasts {durations[k]:.3g} s, and the median one {cycle:.3g} s: "
            "is an onset missing there, or one too many? Mend the onsets, or cut the record to cycles of one kind."
        )
    return values


def make_course(
    trial: PreparedTrial, grid: Grid, onsets: str | Sequence[float] | None, schedule: str | None
) -> Course:
    """Course of a trial: over cycles if their onsets are known, over a scheduling variable, or over time."""
    if onsets is not None:
        return _follow_cycles(trial, grid, find_onsets(trial, onsets))
    values, rate = course_values(trial, grid, schedule), trial.rate / grid.factor
    length, margin = round(SEGMENT * rate), round(MARGIN * rate)
    count = (values.size - 2 * margin) // length
    if count < FEWEST_CYCLES:
        raise DataError(
            f"the record is too short: riv-tv without cycles needs {FEWEST_CYCLES * SEGMENT + 2 * MARGIN:g} s."
        )
    number = np.arange(count * length)
    rows = slice(margin, margin + number.size)
    if schedule is None:
        dimension, limits = "time", (float(values[rows.start]), float(values[rows.stop - 1]))
    else:
        dimension, limits = "schedule", _schedule_limits(trial, grid, schedule, rows)
    place = (values - limits[0]) / (limits[1] - limits[0])
    return Course(
        dimension, np.clip(place, 0.0, 1.0), limits, rows, number // length, number % length
    )


def _follow_cycles(trial: PreparedTrial, grid: Grid, onsets: np.ndarray) -> Course:
    """Course over the phase of cycles.

    Shapes: onsets (cycles + 1,).
    """
    time, half = trial.grid_times(grid), 0.5 / trial.rate
    edges = onsets[(onsets >= time[0] + MARGIN - half) & (onsets <= time[-1] - MARGIN + half)]
    if edges.size - 1 < FEWEST_CYCLES:
        raise DataError(
            f"too few whole cycles lie more than {MARGIN:g} s within the record: {max(edges.size - 1, 0)} with onsets "
            f"from {onsets[0]:g} to {onsets[-1]:g} s, and riv-tv needs {FEWEST_CYCLES}. Record more cycles."
        )
    first, stop = np.searchsorted(time, edges[[0, -1]] - half)
    segment = np.searchsorted(edges, time[first:stop] + half, side="right") - 1
    since = np.arange(segment.size) - np.searchsorted(segment, segment)
    return Course(
        "phase",
        cycle_place(time, onsets, half),
        (0.0, 1.0),
        slice(int(first), int(stop)),
        segment,
        since,
    )


def cycle_place(time: np.ndarray, onsets: np.ndarray, half: float) -> np.ndarray:
    """Phase of samples; before the first and after the last onset the next cycle goes on.

    Shapes: time (N,), onsets (cycles + 1,); returns (N,).
    """
    cycle = np.clip(np.searchsorted(onsets, time + half, side="right") - 1, 0, onsets.size - 2)
    phase = (time - onsets[cycle]) / np.diff(onsets)[cycle]
    inside = (phase >= 0) & (phase <= 1)
    # A sample just ahead of an onset that it belongs to would get the phase 1 - ε by the modulus.
    return np.where(inside, phase, np.where(np.abs(phase) < 1e-3, 0.0, np.mod(phase, 1.0)))


def course_values(trial: PreparedTrial, grid: Grid, schedule: str | None) -> np.ndarray:
    """Scheduling variable at the decimated samples, or, without one, their time from the first sample [s]."""
    if schedule is None:
        return trial.grid_times(grid) - float(trial.time[0])
    trial.check_variable(schedule, "for schedule", NO_VARIABLE)
    return trial.channel(schedule, grid)


def _schedule_limits(
    trial: PreparedTrial, grid: Grid, name: str, rows: slice
) -> tuple[float, float]:
    """Range of most samples of a scheduling variable, which must not hold the perturbation, as the measured angle does.

    Second differences leave movements of a second or longer out.
    """
    values = trial.channel(name, grid)
    low, high = np.quantile(values[rows], [OUTSIDE, 1.0 - OUTSIDE]).tolist()
    if not high - low > 1e-9 * max(abs(low), abs(high)):
        raise DataError(
            f"{name} does not vary between its 2nd and 98th percentile: a scheduling variable has to. Name another "
            "one, or leave out schedule for changes over time."
        )
    for channel in (name for name in ("position", "reference") if name in trial.trial):
        with np.errstate(invalid="ignore"):  # a signal without such changes has no correlation
            share = (
                np.corrcoef(np.diff(values, 2), np.diff(trial.channel(channel, grid), 2))[0, 1] ** 2
            )
        if share > COMMON:
            raise DataError(
                f"{name} follows the perturbation: {100 * share:.0f} % of its fast changes are those of the {channel}. "
                "It takes their effect out of the torque. Give its slow part, filtered below about 1 Hz."
            )
    return low, high


def trajectory_dataset(
    dimension: str, coordinate: np.ndarray, values: Mapping[str, np.ndarray], **schedule: str
) -> xr.Dataset:
    """Trajectories over phase, time or a scheduling variable, with units and names.

    `schedule` are `variable` and `variable_unit`, name and unit of the scheduling variable, where they are known.

    Shapes: coordinate (places,), values (places,).
    """
    variables = {}
    for name in NAMES:
        for end, text in ENDS.items() if name in values else ():
            attributes = {
                "units": QUANTITIES[name].unit,
                "long_name": text.format(QUANTITIES[name].name),
            }
            variables[name + end] = (dimension, values[name + end], attributes)
    unit, long_name = COORDINATES[dimension]
    attributes = {
        "units": schedule.get("variable_unit") or unit,
        "long_name": schedule.get("variable") or long_name,
    }
    stated = {name: text for name, text in schedule.items() if text}
    return xr.Dataset(variables, {dimension: (dimension, coordinate, attributes)}, stated)


def read_trajectories(fields: Fields) -> xr.Dataset:
    """Trajectories whose values a file holds."""
    dimension = next((name for name in COORDINATES if name in fields.values), "time")
    coordinate = fields.array(dimension)
    names = [name + end for name in NAMES for end in ENDS if name != "I" or name in fields.values]
    values = {name: fields.array(name, coordinate.size, finite=False) for name in names}
    stated = {
        name: fields.text(name) for name in ("variable", "variable_unit") if name in fields.values
    }
    return trajectory_dataset(dimension, coordinate, values, **stated)


@dataclass(frozen=True)
class Splines:
    """Uniform cubic B-splines over 0 … 1, or the indicators of equal intervals."""

    size: int  # number of splines; 4 at least for a basis of degree 3
    periodic: bool  # whether 1 is the same place as 0
    degree: int = 3  # 3 for cubic splines, 0 for indicators

    def __call__(self, place: np.ndarray) -> np.ndarray:
        """Values of the splines at places, shape (N, size); beyond 0 … 1 those at the next end."""
        from scipy.interpolate import (
            BSpline,
        )  # here, because its import takes time and only such joints need it

        intervals = self.size if self.periodic or self.degree == 0 else self.size - 3
        knots = np.arange(-self.degree, intervals + self.degree + 1.0)
        scaled = np.clip(place, 0.0, 1.0) * intervals
        values = BSpline.design_matrix(scaled, knots, self.degree).toarray()
        values[:, : values.shape[1] - self.size] += values[
            :, self.size :
        ]  # those beyond the end of a period
        return values[:, : self.size]

    @cached_property
    def penalty(self) -> np.ndarray:
        """Sum of the squares of second differences of the coefficients as a matrix; none for indicators."""
        if self.degree == 0:
            return np.zeros((self.size,) * 2)
        unit = np.eye(self.size)
        differences = np.diff(np.vstack([unit, unit[:2]]) if self.periodic else unit, 2, axis=0)
        return differences.T @ differences

    @property
    def rank(self) -> int:
        """Rank of the penalty: coefficients of a constant, and of a straight line if not periodic, cost nothing."""
        return 0 if self.degree == 0 else self.size - (1 if self.periodic else 2)
