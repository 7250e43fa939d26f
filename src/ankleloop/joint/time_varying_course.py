"""What the parameters of a joint vary with, place and segment of each sample; splines and trajectories over it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import Grid
from ankleloop.quantities import QUANTITIES
from ankleloop.trials.group_files import Fields

RECORD_MARGIN = 0.75  # s at either end of a record that responses and filters touch
END_MARGIN = 0.25  # s at the end of short trials, where only leads and filters reach
FEWEST_CYCLES = 8
SEGMENT_LENGTH = 1.0  # s: segments of a record without cycles, which count as independent
# Share of the samples of a scheduling variable that lie beyond its range, at either end.
SHARE_BEYOND_RANGE = 0.02
# Of a cycle to the median one, or of that to a cycle: beyond it an onset is missing, or one too many.
LARGEST_CYCLE_RATIO = 1.8
SAME_PHASE = 1e-4
# Share of its fast changes that a scheduling variable may have in common with the position.
LARGEST_COMMON_SHARE = 0.5
PHASE_FALL = -0.5  # of a phase from 0 to 1, where a cycle begins
# Unit and name of what parameters vary with.
COORDINATES = {
    "phase": ("1", "phase of the cycle"),
    "time": ("s", "time from the first sample"),
    "schedule": ("", "scheduling variable"),
}
SCHEDULE_TEXTS = ("variable", "variable_unit")
CURVES = ("K", "B", "G", "I")  # I where it varies
# Names of a trajectory and of the ends of its band, by what follows the symbol of the parameter.
ENDS = {
    "": "{}",
    "_low": "lower end of the 95 % band of the {}",
    "_high": "upper end of the 95 % band of the {}",
}


# Start of every cycle [s], the variable that holds the phase, or onsets of each of several trials.
Onsets = str | Sequence[float] | Sequence[Sequence[float]] | None


@dataclass(frozen=True, eq=False)
class Course:
    """Place of each decimated sample within what the parameters vary with, and the samples that count.

    The samples of several trials stand one after the other.
    """

    dimension: str  # "phase", "time" or "schedule"
    place: np.ndarray  # shape (N,): place, from 0 to 1
    # Phase, time from the first sample of the record [s] or scheduling variable at the places 0 and 1.
    limits: tuple[float, float]
    rows: slice | np.ndarray  # samples that count, or their numbers
    # Shape (rows,): number of the cycle, or of the segment of a record without cycles, of each of them.
    segment: np.ndarray
    trials: tuple[Course, ...] = ()  # courses of the trials, where there are several

    @property
    def parts(self) -> tuple[Course, ...]:
        """Course of each trial."""
        return self.trials or (self,)

    @property
    def row_numbers(self) -> np.ndarray:
        """Numbers of the samples that count, shape (rows,)."""
        return np.arange(self.place.size)[self.rows]

    @property
    def periodic(self) -> bool:
        """Whether place 1 is place 0 again."""
        return self.dimension == "phase"

    @cached_property
    def since(self) -> np.ndarray:
        """Samples since the onset of the cycle, or of the segment, shape (rows,)."""
        return np.arange(self.segment.size) - np.searchsorted(self.segment, self.segment)

    @cached_property
    def segments(self) -> int:
        """Number of cycles or segments."""
        return int(self.segment[-1]) + 1 if self.segment.size else 0

    @cached_property
    def equal_cycles(self) -> int:
        """Samples of each cycle where all have the same number and phases, else 0."""
        sizes = np.bincount(self.segment)
        first_phases = self.place[self.rows][self.since == 0]
        same_phases = np.ptp(sizes) == 0 and np.ptp(first_phases) <= SAME_PHASE
        return int(sizes[0]) if self.periodic and same_phases else 0


def find_onsets(trial: PreparedTrial, onsets: str | Sequence[float]) -> np.ndarray:
    """Start of every cycle [s]; onsets that are not those of the record, or of uneven cycles, are refused.

    Shapes: returns (cycles,).
    """
    values = _read_onsets(trial, onsets)
    if values.ndim != 1 or values.size < 2:
        raise DataError(
            "there are fewer than two onsets of cycles: give the start of every cycle in seconds."
        )
    durations = np.diff(values)
    if not (durations > 0).all():
        k = np.argmin(durations > 0) + 1
        raise DataError(
            f"onset {k + 1} of {values.size} ({values[k]:g} s) is not after the one before: sort them, and leave out "
            "those that are there twice or are no times."
        )
    cycle = np.median(durations)
    first = trial.time[0]
    last = trial.time[-1]
    is_beyond = values[0] < first - 1.5 * cycle or values[-1] > last + 1.5 * cycle
    is_missing = values[0] > first + 2.5 * cycle or values[-1] < last - 2.5 * cycle
    # Onsets of a whole trial cover its segments.
    if (is_beyond and is_missing) or cycle > last - first:
        raise DataError(
            f"the onsets go from {values[0]:g} to {values[-1]:g} s, the record from {first:g} to {last:g} s: "
            "give them in seconds of the record, not milliseconds or samples; a segment keeps the times of its trial."
        )
    k = np.argmax(np.abs(np.log(durations / cycle)))
    if not cycle / LARGEST_CYCLE_RATIO <= durations[k] <= cycle * LARGEST_CYCLE_RATIO:
        raise DataError(
            f"the cycle that begins at {values[k]:g} s lasts {durations[k]:.3g} s, and the median one {cycle:.3g} s: "
            "is an onset missing there, or one too many? Mend the onsets, or cut the record to cycles of one kind."
        )
    return values


def _read_onsets(trial: PreparedTrial, onsets: str | Sequence[float]) -> np.ndarray:
    """Onsets as they are given [s]; where a variable holds the phase, it tells where between two samples they are."""
    if not isinstance(onsets, str):
        return np.asarray(onsets, dtype=float)
    trial.check_variable(onsets, "cycle_onsets")
    phase = trial.samples[onsets]
    if phase.min() < -1e-6 or phase.max() > 1 + 1e-6:
        raise DataError(
            f"{onsets} goes from {phase.min():.3g} to {phase.max():.3g}, and the phase of a cycle goes from 0 to "
            "1: give the onsets of the cycles in seconds, or a variable with the phase."
        )
    steps = np.diff(phase)
    starts = np.flatnonzero(steps < PHASE_FALL) + 1
    if not starts.size:
        return np.empty(0)
    slope = np.median(steps[steps > 0]) * trial.rate
    return trial.time[starts] - phase[starts] / slope


def make_course(
    trials: Sequence[PreparedTrial],
    grids: Sequence[Grid],
    onsets: Onsets,
    schedule: str | None,
) -> Course:
    """Course of trials: over cycles if their onsets are known, over a scheduling variable, or over time in a trial."""
    each = split_onsets(onsets, len(trials))
    if onsets is not None:
        courses = [
            _follow_cycles(trial, grid, find_onsets(trial, own))
            for trial, grid, own in zip(trials, grids, each, strict=True)
        ]
    else:
        courses = _follow_variable(trials, grids, schedule)
    course = _merge_courses(courses)
    if course.segments < FEWEST_CYCLES:
        raise DataError(_describe_short(trials, course, each))
    return course


def split_onsets(onsets: Onsets, count: int) -> list[Any]:
    """Onsets of each of several trials: those of all are the same, unless there is a sequence for each."""
    is_sequence = onsets is not None and not isinstance(onsets, str)
    if not is_sequence or not any(map(np.ndim, cast(Any, onsets))):
        return [onsets] * count
    each = list(cast(Any, onsets))
    if len(each) != count:
        raise DataError(
            f"there are onsets of cycles for {len(each)} trials, and {count} trials: give a sequence of onsets for "
            "each trial."
        )
    return each


def _describe_short(trials: Sequence[PreparedTrial], course: Course, onsets: Sequence[Any]) -> str:
    """Why trials have too few cycles or segments."""
    if not course.periodic:
        if len(trials) > 1:
            return (
                f"{course.segments} whole seconds of the {len(trials)} trials remain beside their filters, and riv-tv "
                f"needs {FEWEST_CYCLES}: take more trials."
            )
        least = FEWEST_CYCLES * SEGMENT_LENGTH + 2 * RECORD_MARGIN
        return f"the record is too short: riv-tv without cycles needs {least:g} s."
    first = find_onsets(trials[0], onsets[0])
    return (
        f"too few whole cycles lie more than {RECORD_MARGIN:g} s within the record: {course.segments} with "
        f"onsets from {first[0]:g} to {first[-1]:g} s, and riv-tv needs {FEWEST_CYCLES}. Record more cycles."
    )


def _follow_variable(
    trials: Sequence[PreparedTrial], grids: Sequence[Grid], schedule: str | None
) -> list[Course]:
    """Courses of trials over a scheduling variable, or over time, with common limits."""
    pairs = list(zip(trials, grids, strict=True))
    values = [course_values(trial, grid, schedule) for trial, grid in pairs]
    rate = trials[0].rate / grids[0].factor
    rows = [_count_segments(part.size, rate, merged=len(trials) > 1) for part in values]
    limits: list[float] = []
    for (trial, grid), part, (samples, _) in zip(pairs, values, rows, strict=True):
        if schedule is None:
            limits += part[samples][[0, -1]].tolist()
        else:
            limits += _schedule_limits(trial, grid, schedule, samples)
    low = min(limits)
    high = max(limits)
    courses = []
    for part, (samples, segment) in zip(values, rows, strict=True):
        courses.append(
            Course(
                dimension="time" if schedule is None else "schedule",
                place=np.clip((part - low) / (high - low), 0.0, 1.0),
                limits=(low, high),
                rows=samples,
                segment=segment,
            )
        )
    return courses


def _count_segments(size: int, rate: float, *, merged: bool) -> tuple[slice, np.ndarray]:
    """Samples of a record that count, and the number of the segment of each of them.

    They are whole segments; of merged trials, which may be as short as a movement, the last one is longer.
    """
    length = round(SEGMENT_LENGTH * rate)
    margin = round(RECORD_MARGIN * rate)
    end_margin = round(END_MARGIN * rate) if merged else margin
    usable = size - margin - end_margin
    if usable < length:
        least = SEGMENT_LENGTH + size / rate - usable / rate
        raise DataError(
            f"{size / rate:.3g} s of a record remain beside its filters, and riv-tv needs {least:.3g} s: record longer."
        )
    segments = usable // length
    samples = usable if merged else segments * length
    number = np.minimum(np.arange(samples) // length, segments - 1)
    return slice(margin, margin + samples), number


def _merge_courses(courses: Sequence[Course]) -> Course:
    """Courses of trials, one after the other."""
    first = courses[0]
    if len(courses) == 1:
        return first
    rows = []
    segments = []
    samples = 0
    count = 0
    for course in courses:
        rows.append(samples + course.row_numbers)
        segments.append(count + course.segment)
        samples += course.place.size
        count += course.segments
    return Course(
        dimension=first.dimension,
        place=np.concatenate([course.place for course in courses]),
        limits=first.limits,
        rows=np.concatenate(rows),
        segment=np.concatenate(segments),
        trials=tuple(courses),
    )


def _follow_cycles(trial: PreparedTrial, grid: Grid, onsets: np.ndarray) -> Course:
    """Course over the phase of cycles.

    Shapes: onsets (cycles + 1,).
    """
    time = trial.grid_times(grid)
    half = 0.5 / trial.rate
    first_time = time[0] + RECORD_MARGIN - half
    last_time = time[-1] - RECORD_MARGIN + half
    edges = onsets[(onsets >= first_time) & (onsets <= last_time)]
    if edges.size < 2:
        edges = np.full(2, first_time)  # no whole cycle
    start, stop = np.searchsorted(time, edges[[0, -1]] - half)
    cycle = np.searchsorted(edges, time[start:stop] + half, side="right") - 1
    return Course(
        dimension="phase",
        place=cycle_place(time, onsets, half),
        limits=(0.0, 1.0),
        rows=slice(start, stop),
        segment=cycle,
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
        return trial.grid_times(grid) - trial.time[0]
    trial.check_variable(schedule, "schedule")
    return trial.channel(schedule, grid)


def _schedule_limits(
    trial: PreparedTrial, grid: Grid, name: str, rows: slice | np.ndarray
) -> tuple[float, float]:
    """Range of most samples of a scheduling variable, which must not hold the perturbation, as the measured angle does.

    Second differences leave movements of a second or longer out.
    """
    values = trial.channel(name, grid)
    low, high = np.quantile(values[rows], [SHARE_BEYOND_RANGE, 1.0 - SHARE_BEYOND_RANGE])
    if not high - low > 1e-9 * max(abs(low), abs(high)):
        raise DataError(
            f"{name} does not vary between its 2nd and 98th percentile: a scheduling variable has to. Name another "
            "one, or leave out schedule for changes over time."
        )
    changes = np.diff(values, 2)
    for channel in ("position", "reference"):
        if channel not in trial.trial:
            continue
        with np.errstate(invalid="ignore"):  # a signal without such changes has no correlation
            correlation = np.corrcoef(changes, np.diff(trial.channel(channel, grid), 2))[0, 1]
        share = correlation**2
        if share > LARGEST_COMMON_SHARE:
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
    for name in CURVES:
        if name not in values:
            continue
        quantity = QUANTITIES[name]
        for end, text in ENDS.items():
            attributes = {"units": quantity.unit, "long_name": text.format(quantity.name)}
            variables[name + end] = (dimension, values[name + end], attributes)
    unit, long_name = COORDINATES[dimension]
    attributes = {
        "units": schedule.get("variable_unit") or unit,
        "long_name": schedule.get("variable") or long_name,
    }
    known = {name: text for name, text in schedule.items() if text}
    return xr.Dataset(variables, {dimension: (dimension, coordinate, attributes)}, known)


def read_trajectories(fields: Fields) -> xr.Dataset:
    """Trajectories whose values a file holds."""
    dimension = next((name for name in COORDINATES if name in fields.values), "time")
    coordinate = fields.array(dimension)
    schedule = {name: fields.text(name) for name in SCHEDULE_TEXTS if name in fields.values}
    values = {
        name: fields.array(name, coordinate.size, finite=False)
        for name in fields.values.keys() - {dimension, *SCHEDULE_TEXTS}
    }
    return trajectory_dataset(dimension, coordinate, values, **schedule)


@dataclass(frozen=True)
class Splines:
    """Uniform cubic B-splines over 0 … 1, or the indicators of equal intervals."""

    size: int  # number of splines; 4 at least for a basis of degree 3
    periodic: bool  # whether 1 is the same place as 0
    degree: int = 3  # 3 for cubic splines, 0 for indicators

    def __call__(self, place: np.ndarray) -> np.ndarray:
        """Values of the splines at places, shape (N, size); beyond 0 … 1 those at the next end."""
        # Here, because its import takes time and only such joints need it.
        from scipy.interpolate import BSpline

        intervals = self.size if self.periodic or self.degree == 0 else self.size - 3
        knots = np.arange(-self.degree, intervals + self.degree + 1.0)
        scaled = np.clip(place, 0.0, 1.0) * intervals
        values = BSpline.design_matrix(scaled, knots, self.degree).toarray()
        beyond = values[:, self.size :]  # the end of a period
        values[:, : beyond.shape[1]] += beyond
        return values[:, : self.size]

    @cached_property
    def penalty(self) -> np.ndarray:
        """Sum of the squares of second differences of the coefficients as a matrix; none for indicators."""
        if self.degree == 0:
            return np.zeros((self.size,) * 2)
        coefficients = np.eye(self.size)
        if self.periodic:
            coefficients = np.vstack([coefficients, coefficients[:2]])
        differences = np.diff(coefficients, 2, axis=0)
        return differences.T @ differences

    @cached_property
    def rank(self) -> int:
        """Rank of the penalty: coefficients of a constant, and of a straight line if not periodic, cost nothing."""
        return int(np.linalg.matrix_rank(self.penalty))
