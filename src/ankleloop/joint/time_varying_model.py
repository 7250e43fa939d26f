"""Model of a joint whose K, B and G are functions of phase, time or a scheduling variable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import xarray as xr
from scipy.fft import irfft, next_fast_len, rfft

from ankleloop.errors import DataError
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.model_inputs import ModelInputs
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import Grid, torque_dataset
from ankleloop.joint.time_varying_course import Splines, cycle_place, find_onsets, grid_times, schedule_place
from ankleloop.signals.decimation import decimate
from ankleloop.trials.group_files import Fields

PADDING = 1.0  # s
TRAJECTORIES = ("stiffness", "viscosity", "gain")
BEYOND = 0.05  # share of the samples beyond the limits of a scheduling variable from which on a warning says so


@dataclass(frozen=True, eq=False)
class TimeVaryingModel:
    """K, B, G and I as splines, and the low-pass of the reflex behind the gain."""

    inputs: ModelInputs  # delay and rates of its inputs
    dimension: str  # what K, B and G are functions of: "phase", "time" or "schedule"
    # Variable of a trial that holds the phase or the scheduling variable; empty where onsets come as numbers.
    variable: str
    # Phase, time from the first sample of a trial [s] or scheduling variable at the first and at the last place.
    limits: tuple[float, float]
    degree: int  # degree of the splines: 3, or 0 for indicators of intervals
    # Coefficients of the splines of K [N·m/rad], B [N·m·s/rad] and G [N·m·s/rad].
    coefficients: tuple[np.ndarray, np.ndarray, np.ndarray]
    inertia: np.ndarray  # shape (splines,): coefficients of the splines of I [kg·m²]; a single one where it is constant
    dynamics: ReflexDynamics  # Low-pass of unit gain
    torque_lag: float = 0.0  # lag of the torque channel behind the position [s]
    # Position at which the elastic torque is zero [rad]; None for the mean position of a trial.
    rest_position: float | None = None
    kind: ClassVar[str] = "time-varying"
    matrices: ClassVar[None] = None

    def parameters(self, place: np.ndarray) -> list[np.ndarray]:
        """K, B, G and I at places within 0 … 1, four arrays of the shape of `place`."""
        periodic = self.dimension == "phase"
        coefficients = (*self.coefficients, self.inertia)
        return [Splines(c.size, periodic, self.degree if c.size > 1 else 0)(place) @ c for c in coefficients]

    def predict(
        self, trial: xr.Dataset | PreparedTrial, cycle_onsets: str | Sequence[float] | None = None
    ) -> xr.Dataset:
        """Torques of a trial, from a state of rest."""
        prepared = prepare(trial)
        grid = prepared.grid(self.inputs.identification_rate, self.inputs.delay)
        return self.simulate(prepared, grid, self.place(prepared, grid, cycle_onsets))

    def place(self, trial: PreparedTrial, grid: Grid, cycle_onsets: str | Sequence[float] | None = None) -> np.ndarray:
        """Place of each decimated sample within 0 … 1."""
        if self.dimension == "time":
            return np.clip(self._time_place(trial, grid), 0.0, 1.0)
        if self.dimension == "schedule":
            return np.clip(schedule_place(trial, grid, self.variable, self.limits), 0.0, 1.0)
        onsets = cycle_onsets if cycle_onsets is not None else self.variable
        if isinstance(onsets, str) and not onsets:
            raise DataError("the model varies with the cycle: give predict the cycle_onsets of this trial.")
        return cycle_place(grid_times(trial, grid), find_onsets(trial, onsets), 0.5 / trial.rate)

    def _time_place(self, trial: PreparedTrial, grid: Grid) -> np.ndarray:
        """Time from the first sample of a trial as a share of the time that was fitted, shape (N,)."""
        time = grid_times(trial, grid) - float(trial.samples("time")[0])
        return (time - self.limits[0]) / (self.limits[1] - self.limits[0])

    def simulate(self, trial: PreparedTrial, grid: Grid, place: np.ndarray) -> xr.Dataset:
        """Torques of a trial whose samples are at known places.

        Shapes: place (N,).
        """
        stiffness, viscosity, gain, inertia = self.parameters(place)
        position, velocity, acceleration = trial.motion(grid)
        rest = position.mean() if self.rest_position is None else self.rest_position
        intrinsic = stiffness * (position - rest) + viscosity * velocity + inertia * acceleration
        drive = gain * decimate(np.maximum(0.0, trial.velocity(self.inputs.delay)), *grid)
        rate = self.inputs.identification_rate
        size = int(next_fast_len(grid.samples + round(PADDING * rate), real=True))
        s = 2j * np.pi * np.fft.rfftfreq(size, 1.0 / rate)
        lag = np.exp(-s * self.torque_lag)
        reflex = irfft(lag * self.dynamics.response(s)[0] * rfft(drive, size), size)[: grid.samples]
        if self.torque_lag:
            intrinsic = irfft(lag * rfft(intrinsic, size), size)[: grid.samples]
        intrinsic, reflex = intrinsic - intrinsic.mean(), reflex - reflex.mean()
        torques = {"net": intrinsic + reflex, "intrinsic": intrinsic, "reflex": reflex}
        return torque_dataset(grid_times(trial, grid), rate, **torques)

    def check_range(self, trial: PreparedTrial) -> list[str]:
        """Warning about values of the scheduling variable, or times, for which the splines were not fitted."""
        grid = trial.grid(self.inputs.identification_rate, self.inputs.delay)
        if self.dimension == "schedule":
            place, name = schedule_place(trial, grid, self.variable, self.limits), self.variable
        elif self.dimension == "time":
            place = self._time_place(trial, grid)
            name = "the time"
        else:
            return []
        outside = float(np.mean((place < 0) | (place > 1)))
        if outside <= BEYOND:
            return []
        return [
            f"{name} lies beyond the fitted range of {self.limits[0]:.3g} to {self.limits[1]:.3g} for "
            f"{100 * outside:.2g} % of the samples, which have the parameters of its end."
        ]

    def fields(self) -> dict[str, Any]:
        """Values by name, as files hold them."""
        coefficients = dict(zip((f"{name}_splines" for name in TRAJECTORIES), self.coefficients, strict=True))
        return {
            **self.inputs.fields(),
            **self.dynamics.values,
            **coefficients,
            "dimension": self.dimension,
            "variable": self.variable or "none",
            "limits": np.array(self.limits),
            "spline_degree": self.degree,
            "inertia": self.inertia,
            "torque_lag": self.torque_lag,
            **({} if self.rest_position is None else {"rest_position": self.rest_position}),
        }

    @classmethod
    def from_fields(cls, inputs: ModelInputs, fields: Fields) -> TimeVaryingModel:
        """The model whose values a file holds."""
        dimension, variable = fields.text("dimension"), fields.text("variable")
        if dimension not in ("phase", "time", "schedule"):
            raise DataError(f"{fields.source}: unknown dimension {dimension!r}; known: phase, time, schedule.")
        pole = fields.number("pole") if "pole" in fields.values else None
        low, high = fields.array("limits", 2).tolist()
        stiffness, viscosity, gain = (fields.array(f"{name}_splines") for name in TRAJECTORIES)
        return cls(
            inputs,
            dimension,
            "" if variable == "none" else variable,
            (low, high),
            int(fields.number("spline_degree")),
            (stiffness, viscosity, gain),
            fields.array("inertia"),
            ReflexDynamics(fields.number("omega_n"), fields.number("zeta"), pole),
            fields.number("torque_lag"),
            fields.number("rest_position") if "rest_position" in fields.values else None,
        )
