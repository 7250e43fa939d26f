"""A trial together with what methods compute from it: derivatives, decimated channels, regressors."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from copy import copy
from dataclasses import is_dataclass
from functools import cached_property, wraps
from typing import Any, TypeVar, cast

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.apparatus import Apparatus
from ankleloop.joint.bases import BASES, FRICTION, Basis
from ankleloop.joint.regressors import (
    Grid,
    InputStep,
    Regressors,
    decimation_grid,
    split_torques,
)
from ankleloop.signals.decimation import decimate, decimation_factor, differentiate
from ankleloop.signals.gaps import find_filled_gaps
from ankleloop.signals.noise import VelocityNoise, measure_velocity_noise, remove_noise
from ankleloop.signals.responses import predict_decimated
from ankleloop.trials.trial import REQUIRED, validate

# s before a gap and after it that its filling reaches: filters of the decimation, and the memory of a reflex. Chosen:
# with 0.1 s after it G is off by 1 to 3 %, with 0.3 s by 1 % (12 records each, 29 % of them filled).
GAP_LEAD, GAP_MEMORY = 0.03, 0.3

Function = TypeVar("Function", bound=Callable[..., Any])


def once(function: Function) -> Function:
    """Decorate a function of a prepared trial: its value for each set of further arguments is computed once.

    Arrays of the value can be read only, because others get them as well.
    """

    @wraps(function)
    def compute_once(trial: PreparedTrial, *arguments: Any, **options: Any) -> Any:
        key = (function, *arguments, *options.items())
        if key not in trial.computed:
            value = function(trial, *arguments, **options)
            _protect(value)
            trial.computed[key] = value
        return trial.computed[key]

    return cast(Function, compute_once)


def _protect(value: Any) -> None:
    """Make arrays of a value read-only."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, list | tuple):
        for part in value:
            _protect(part)
    elif is_dataclass(value):
        _protect([*vars(value).values()])


class PreparedTrial:
    """A valid trial that computes each derivative, decimated channel and regressor once.

    Methods and scores take it in the place of a trial; they share what one of them has computed. So nothing of it can
    be edited: arrays of `trial`, and those that it computes, raise ValueError when they are written to. Its samples are
    those of the data set that was given, not a copy: to change them, change a copy of that and prepare it anew.

    >>> from ankleloop.simulation.simulate import simulate
    >>> trial = PreparedTrial(simulate(seed=1, duration=5.0))
    >>> trial.regressors(delay=0.04, basis="rectifier", identification_rate=100.0).inputs.shape
    (432, 4)
    >>> trial.trial["position"].values[:] = 0.0
    Traceback (most recent call last):
      ...
    ValueError: assignment destination is read-only
    """

    def __init__(self, trial: xr.Dataset) -> None:
        self.trial = validate(trial).copy(deep=False)
        for variable in self.trial.variables.values():
            if not isinstance(variable, xr.IndexVariable):
                samples = variable.values.view()
                samples.flags.writeable = False
                variable.data = samples
        self.rate = float(self.trial.attrs["sampling_rate"])
        self.apparatus = Apparatus.carried_by(self.trial)  # what is subtracted of the torque
        # As recorded, by name, shape (samples,).
        self.samples = {
            str(name): variable.values for name, variable in self.trial.variables.items()
        }
        self.time = self.samples["time"]  # of every sample [s], shape (samples,)
        # Values by what they were computed of. None may refer to the trial: it would stay in memory until Python next
        # searches for reference cycles.
        self.computed: dict[Hashable, Any] = {}

    def check_variable(self, name: str, option: str | None = None) -> None:
        """Refuse a variable that the trial does not have: the reference, or what another option names."""
        if name in self.trial:
            return
        known = ", ".join(map(str, self.trial))
        if option is None:
            raise DataError(
                f"the trial has no variable {name!r} to serve as reference; it has {known}. Give the command of the "
                "servo as reference, or reference='position' for an open-loop record."
            )
        raise DataError(
            f"the trial has no variable {name!r} for {option}; it has {known}. Name one of these, or read another one "
            "with the trial: variables of read_trial, a further array of new_trial.",
            remedy={"variables": None},
        )

    def grid(self, identification_rate: float, delay: float) -> Grid:
        """Grid of all decimated samples that no filter edge touches; see `decimation_grid`."""
        return decimation_grid(self.time.size, self.rate, identification_rate, delay)

    def grid_times(self, grid: Grid) -> np.ndarray:
        """Times of the decimated samples [s], shape (N,)."""
        return self.time[grid.first : grid.first + grid.factor * grid.samples : grid.factor]

    @once
    def channel(self, name: str, grid: Grid) -> np.ndarray:
        """A variable, decimated; the torque less that of the apparatus. Shape (N,)."""
        values = decimate(self.samples[name], *grid)
        if name == "torque" and self.apparatus is not None:
            values -= self.apparatus_inputs(grid) @ self.apparatus.linear
        return values

    def apparatus_inputs(self, grid: Grid) -> np.ndarray:
        """Position, velocity, acceleration and the sign of the velocity, decimated; shape (N, 4)."""
        return _make_inputs(self, 0.0, FRICTION, grid, None)

    def channel_at(self, name: str, time: np.ndarray, identification_rate: float) -> np.ndarray:
        """A variable at the times of an estimate [s], through the decimation that the data of the estimate had.

        Shapes: time (N,); returns (N,).
        """
        factor = decimation_factor(self.rate, identification_rate)
        first = round((time[0] - self.time[0]) * self.rate)
        return self.channel(name, Grid(factor, first, time.size))

    @once
    def gaps(self, name: str) -> np.ndarray:
        """First sample of each gap of a channel that was filled, and the sample after it, shape (gaps, 2)."""
        return find_filled_gaps(self.samples[name], self.rate)

    @once
    def recorded(self, grid: Grid) -> np.ndarray:
        """Which decimated samples no filled gap of position or torque reaches, shape (N,)."""
        time = self.grid_times(grid)
        recorded = np.ones(time.size, dtype=bool)
        for name in REQUIRED:
            for start, stop in self.gaps(name):
                first = np.searchsorted(time, self.time[start] - GAP_LEAD)
                last = np.searchsorted(time, self.time[stop - 1] + GAP_MEMORY)
                recorded[first:last] = False
        return recorded

    @cached_property
    def velocity_noise(self) -> VelocityNoise | None:
        """Noise of the velocity; None where it cannot be judged, as beside the steps at the ends of filled gaps."""
        if len(self.gaps("position")):
            return None
        return measure_velocity_noise(self.samples["position"], self.samples["torque"], self.rate)

    @once
    def velocity(self, delay: float) -> np.ndarray:
        """Velocity at the recording rate, delayed [rad/s], less noise above its band; shape (samples,)."""
        position = self.samples["position"]
        if self.velocity_noise is not None and self.velocity_noise.dominates:
            position = remove_noise(position, self.rate)
        return differentiate(position, self.rate, delay)

    @once
    def motion(self, grid: Grid) -> tuple[np.ndarray, ...]:
        """Position, velocity and acceleration, decimated: three arrays of shape (N,)."""
        position = self.samples["position"]
        return tuple(
            decimate(position, *grid, rate=self.rate, derivative=order) for order in range(3)
        )

    @once
    def fit_basis(self, kind: str, terms: int, delay: float) -> Basis:
        """Basis of so many functions, fitted to the delayed velocity."""
        return BASES[kind].fit(self.velocity(delay), terms)

    @once
    def regressors(
        self,
        *,
        delay: float,
        basis: str | Basis,
        degree: int = 1,
        identification_rate: float,
        reference: str | None = None,
        omitted_step: InputStep | None = None,
    ) -> Regressors:
        """Differentiate, delay, expand and decimate the trial.

        Velocity for the nonlinearity is taken at the recording rate through a wide differentiator, delayed and
        expanded there; every term is decimated only then, because a rectifier after decimation is another rectifier.
        `reference` names a variable that the load cannot reach; it is decimated, too, for instruments made of it. A
        method that uses one has it as an option, by which its estimates say what they rest on.
        """
        if reference is not None:
            self.check_variable(reference)
        grid = self.grid(identification_rate, delay)
        if isinstance(basis, str):
            basis = self.fit_basis(basis, BASES[basis].count_terms(degree), delay)
        return Regressors(
            time=self.grid_times(grid),
            inputs=_make_inputs(self, delay, basis, grid, omitted_step),
            torque=self.channel("torque", grid),
            basis=basis,
            delay=delay,
            rate=float(identification_rate),
            grid=grid,
            reference=None if reference is None else self.channel(reference, grid),
            reference_name=reference,
            omitted_step=omitted_step,
        )

    def predict_inputs(self, regressors: Regressors) -> np.ndarray:
        """Inputs as they would be without fed-back torque: rebuilt from the position that the reference explains.

        Shapes: returns (N, 3 + k), on the samples of the regressors.
        """
        return predict_inputs([self], [regressors])[0]


def predict_inputs(
    trials: Sequence[PreparedTrial], records: Sequence[Regressors]
) -> list[np.ndarray]:
    """Inputs of trials as they would be without fed-back torque, by one response of the position to the reference.

    A response of each trial's own would follow the noise of a short trial.

    Shapes: returns (N, 3 + k), on the samples of the regressors of each trial.
    """
    return _predict_inputs(trials[0], tuple(trials[1:]), tuple(records))


@once
def _predict_inputs(
    first_trial: PreparedTrial,
    others: tuple[PreparedTrial, ...],
    records: tuple[Regressors, ...],
) -> list[np.ndarray]:
    """The same; the first trial keeps them."""
    trials = [first_trial, *others]
    first = records[0]
    name = str(first.reference_name)
    if name == "position":  # an open-loop record: the reference explains all of it
        return [record.inputs for record in records]
    positions = predict_decimated(
        [record.inputs[:, 0] for record in records],
        [trial.samples[name] for trial in trials],
        [record.grid for record in records],
        first_trial.rate,
    )
    inputs = []
    for trial, record, position in zip(trials, records, positions, strict=True):
        predicted = copy(trial)  # with its noise: both velocities go through one filter
        predicted.samples = trial.samples | {"position": position}
        predicted.computed = {}
        inputs.append(
            _make_inputs(predicted, first.delay, first.basis, record.grid, first.omitted_step)
        )
    return inputs


def make_regressors(
    trials: Sequence[PreparedTrial], *, basis: str, degree: int, delay: float, **options: Any
) -> list[Regressors]:
    """Regressors of each trial, with one basis for all of them."""
    common: str | Basis = basis
    if len(trials) > 1:
        velocity = np.concatenate([trial.velocity(delay) for trial in trials])
        common = BASES[basis].fit(velocity, degree)
    return [
        trial.regressors(basis=common, degree=degree, delay=delay, **options) for trial in trials
    ]


@once
def _make_inputs(
    trial: PreparedTrial,
    delay: float,
    basis: Basis,
    grid: Grid,
    omitted_step: InputStep | None,
) -> np.ndarray:
    """Inputs, which regressors with any reference share."""
    velocity = trial.velocity(delay)
    if omitted_step == "early-nonlinearity":
        terms = basis(decimate(velocity, *grid))
    else:
        terms = decimate(basis(velocity), *grid)
    motion = trial.motion(grid)
    if omitted_step == "kernel-derivatives":
        motion = _take_differences(trial, grid)
    return np.column_stack([*motion, *terms])


# A trial, or several that are merged.
Trials = xr.Dataset | PreparedTrial | Sequence[xr.Dataset | PreparedTrial]


def prepare(trial: xr.Dataset | PreparedTrial) -> PreparedTrial:
    """A trial as a `PreparedTrial`, which is returned unchanged if it is one.

    >>> from ankleloop import identify, simulate
    >>> trial = prepare(simulate(seed=1, duration=20.0))
    >>> [identify(trial, method).method for method in ("riv", "pr-moesp")]  # they share derivatives and spectra
    ['riv', 'pr-moesp']
    """
    return trial if isinstance(trial, PreparedTrial) else PreparedTrial(trial)


def prepare_trials(trial: Any) -> list[PreparedTrial]:
    """A trial, or each of a list of trials, as a `PreparedTrial`."""
    parts = trial if isinstance(trial, (list, tuple)) else [trial]
    return [prepare(part) for part in parts]


def sample_channel(
    trials: Sequence[PreparedTrial], name: str, torque: xr.Dataset
) -> list[np.ndarray]:
    """A variable of each trial at the samples of estimated torques, shapes (N,)."""
    rate = torque.attrs["identification_rate"]
    parts = split_torques(torque)
    if len(parts) != len(trials):
        raise DataError(
            f"the estimate has the torques of {len(parts)} trials, and {len(trials)} are given: give those that were "
            "identified, in their order."
        )
    return [
        trial.channel_at(name, part["time"].values, rate)
        for trial, part in zip(trials, parts, strict=True)
    ]


def _take_differences(trial: PreparedTrial, grid: Grid) -> tuple[np.ndarray, ...]:
    """Decimated position, its central differences, and those of these.

    The kernel of the position is shorter than those of its derivatives: it reaches two samples further.
    """
    first = grid.first - 2 * grid.factor
    position = decimate(trial.samples["position"], grid.factor, first, grid.samples + 4)
    interval = grid.factor / trial.rate
    velocity = np.gradient(position, interval)
    acceleration = np.gradient(velocity, interval)
    return position[2:-2], velocity[2:-2], acceleration[2:-2]
