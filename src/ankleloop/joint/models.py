"""Models of the joint as data: their inputs, and all that is needed to compute the torques of another trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isqrt
from typing import Any, ClassVar, cast, get_args

import numpy as np
import xarray as xr
from scipy.fft import irfft, next_fast_len, rfft

from ankleloop.errors import DataError
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.hammerstein import BASES, Basis
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import INTRINSIC_NAMES, MOTION, Grid, InputStep, Regressors, torque_dataset
from ankleloop.joint.time_varying_course import Splines, course_values, cycle_place, find_onsets
from ankleloop.signals.decimation import decimate, decimation_factor, decimation_margin, decimation_taps, velocity_taps
from ankleloop.subspace.input_matrices import simulate_response
from ankleloop.subspace.matrices import Matrices
from ankleloop.trials.group_files import Fields

Trial = xr.Dataset | PreparedTrial
RIPPLE = 0.01  # of the range of a basis: its filters carry the velocity as far beyond
PADDING = 1.0  # s
BEYOND = 0.05  # share of the samples beyond the limits of a scheduling variable from which on a warning says so


def as_variable(value: Any, *dimensions: str, unit: str = "") -> xr.Variable:
    """A value of a file with its dimensions and its unit."""
    return xr.Variable(dimensions, value, {"units": unit} if unit else {})


@dataclass(frozen=True, eq=False)
class ModelInputs:
    """Inputs of a model: position, velocity, acceleration, and basis functions of the delayed velocity."""

    basis: Basis  # basis functions, with the scale or the knots of the record that was fitted
    delay: float  # reflex delay [s], by which the velocity is delayed before it enters the basis functions
    identification_rate: float  # rate of the inputs [Hz]
    recording_rate: float  # rate of the record that was fitted [Hz]; another trial may have another one
    omitted_step: InputStep | None = None  # step of the processing that was left out

    @classmethod
    def of(cls, regressors: Regressors, delay: float | None = None) -> ModelInputs:
        """Those of regressors."""
        return cls(
            replace(regressors.basis, quantiles=np.empty(0)),  # they only serve pictures
            regressors.delay if delay is None else float(delay),
            regressors.rate,
            regressors.grid.factor * regressors.rate,
            regressors.omitted_step,
        )

    def label(self, matrices: Matrices) -> Matrices:
        """Matrices with the names and delays of these inputs, and with their numbers in the order of C.

        The order in memory decides the last bits of a product: so a model from a file gives those of the first one.
        """
        A, B, C, D = (np.ascontiguousarray(part) for part in (matrices.A, matrices.B, matrices.C, matrices.D))
        terms = self.basis.names
        delays = (0.0,) * MOTION + (self.delay,) * len(terms)
        return Matrices(A, B, C, D, matrices.dt, ((*INTRINSIC_NAMES, *terms), ("torque",)), delays)

    def regressors(self, trial: Trial) -> Regressors:
        """Inputs of another trial, with the basis, the delay and the rate of this model."""
        return prepare(trial).regressors(
            delay=self.delay,
            basis=self.basis,
            identification_rate=self.identification_rate,
            omitted_step=self.omitted_step,
        )

    def check_range(self, trial: Trial) -> list[str]:
        """Warning about velocities for which the basis functions were not fitted."""
        if self.basis.kind == "rectifier":
            return []
        knots, scale = self.basis.knots, self.basis.scale
        low, high = (float(knots[0]), float(knots[-1])) if self.basis.kind == "spline" else (-scale, scale)
        velocity = prepare(trial).velocity(self.delay)
        margin = RIPPLE * (high - low)
        outside = (velocity < low - margin) | (velocity > high + margin)
        if not outside.any():
            return []
        return [
            f"the velocity of this trial goes from {velocity.min():.3g} to {velocity.max():.3g} rad/s, and the "
            f"{self.basis.kind} basis was fitted from {low:.3g} to {high:.3g} rad/s: for {100 * outside.mean():.2g} % "
            "of the samples the reflex torque is an extrapolation."
        ]

    def fields(self) -> dict[str, str | xr.Variable]:
        """Texts and variables by name, as files hold them."""
        return {
            "basis": self.basis.kind,
            "degree": as_variable(self.basis.degree),
            "basis_scale": as_variable(self.basis.scale, unit="rad/s"),
            "basis_knots": as_variable(self.basis.knots, "knot", unit="rad/s"),
            "delay": as_variable(self.delay, unit="s"),
            "identification_rate": as_variable(self.identification_rate, unit="Hz"),
            "recording_rate": as_variable(self.recording_rate, unit="Hz"),
            "omitted_step": self.omitted_step or "none",
        }

    @classmethod
    def from_fields(cls, fields: Fields) -> ModelInputs:
        """The inputs whose values a file holds."""
        kind, step = fields.text("basis"), fields.text("omitted_step")
        for name, value, known in (("basis", kind, BASES), ("omitted_step", step, ("none", *get_args(InputStep)))):
            if value not in known:
                raise DataError(f"{fields.source}: unknown {name} {value!r}; known: {', '.join(known)}.")
        basis = Basis(kind, int(fields.number("degree")), fields.number("basis_scale"), fields.array("basis_knots"))
        return cls(
            basis,
            fields.number("delay"),
            fields.number("identification_rate"),
            fields.number("recording_rate"),
            None if step == "none" else cast(InputStep, step),
        )

    def kernels(self) -> dict[str, xr.Variable]:
        """Kernels of `decimate` and `differentiate` as plain sums of kernel · x(n - lag) over recorded samples n.

        None where a step is left out.
        """
        if self.omitted_step is not None:
            return {}
        factor, kernels = decimation_factor(self.recording_rate, self.identification_rate), []
        margin = decimation_margin(factor)
        for derivative in range(3):
            taps, half = decimation_taps(factor, derivative)
            kernels.append(np.pad(taps, margin - half) * self.identification_rate**derivative)
        taps, half, whole = velocity_taps(self.recording_rate, self.delay)
        decimation_lags, velocity_lags = np.arange(-margin, margin + 1), np.arange(-half, half + 1) + whole
        return {
            "decimation_kernel": as_variable(np.array(kernels), "derivative", "decimation_lag"),
            "decimation_lag": as_variable(decimation_lags, "decimation_lag", unit="recorded samples"),
            "velocity_kernel": as_variable(taps, "velocity_lag", unit="1/s"),
            "velocity_lag": as_variable(velocity_lags, "velocity_lag", unit="recorded samples"),
        }


@dataclass(frozen=True, eq=False)
class StateSpaceModel:
    """Linear model at the identification rate, as the MOESP family estimates it."""

    inputs: ModelInputs  # how its inputs are made of a trial
    matrices: Matrices  # A, B, C, D from the inputs to the torque, in physical units, labelled by `inputs`
    # Shape (n,): state at the first sample of the record that was fitted. Torques of another trial start at rest.
    initial_state: np.ndarray
    kind: ClassVar[str] = "state-space"

    def predict(self, trial: Trial) -> xr.Dataset:
        """Torques of a trial, from a state of rest."""
        regressors = self.inputs.regressors(trial)
        return torque_dataset(regressors.time, regressors.rate, **simulate_torques(self.matrices, None, regressors))

    def fields(self) -> dict[str, str | xr.Variable]:
        """Texts and variables by name, as files hold them beside those of the inputs."""
        return {**_matrix_fields(self.matrices), "initial_state": as_variable(self.initial_state, "state")}

    @classmethod
    def from_fields(cls, inputs: ModelInputs, fields: Fields) -> StateSpaceModel:
        """The model whose values a file holds."""
        n, m = isqrt(fields.array("A").size), MOTION + len(inputs.basis.names)
        shapes = {"A": (n, n), "B": (n, m), "C": (1, n), "D": (1, m)}
        A, B, C, D = (fields.array(name, *shape) for name, shape in shapes.items())
        matrices = inputs.label(Matrices(A, B, C, D, 1.0 / inputs.identification_rate))
        return cls(inputs, matrices, fields.array("initial_state", n))


@dataclass(frozen=True, eq=False)
class PhysicalModel:
    """Physical parameters in continuous time, as refined instrumental variables estimate them."""

    inputs: ModelInputs  # how its inputs are made of a trial
    stiffness: np.ndarray  # shape (3,): K [N·m/rad], B [N·m·s/rad], I [kg·m²]
    coefficients: np.ndarray  # shape (k,): torque per basis function
    dynamics: ReflexDynamics  # Low-pass of unit gain behind the basis functions
    kind: ClassVar[str] = "physical"

    @cached_property
    def matrices(self) -> Matrices:
        """A, B, C, D at the identification rate, for inputs that are linear between samples."""
        rate = self.inputs.identification_rate
        A, B, C, D = self.dynamics.matrices(rate)
        B = np.hstack([np.zeros((len(A), MOTION)), B * self.coefficients])
        D = np.concatenate([self.stiffness, D.item() * self.coefficients])[None, :]
        return self.inputs.label(Matrices(A, B, C, D, 1.0 / rate))

    def predict(self, trial: Trial) -> xr.Dataset:
        """Torques of a trial, from a state of rest."""
        prepared = prepare(trial)
        return self.simulate(prepared, self.inputs.regressors(prepared))

    def simulate(self, trial: PreparedTrial, regressors: Regressors) -> xr.Dataset:
        """Torques of a trial; the dynamics act at the recording rate."""
        intrinsic = regressors.centred[0] @ self.stiffness
        drive = self.coefficients @ self.inputs.basis(trial.velocity(self.inputs.delay))
        recorded = simulate_response(*self.dynamics.matrices(trial.rate), drive[:, None])[:, 0]
        reflex = decimate(recorded, *regressors.grid)
        return torque_dataset(regressors.time, regressors.rate, **sum_paths(intrinsic, reflex))

    def fields(self) -> dict[str, str | xr.Variable]:
        """Texts and variables by name, as files hold them beside those of the inputs."""
        return {
            "stiffness": as_variable(self.stiffness, "parameter"),
            "coefficients": as_variable(self.coefficients, "basis_function"),
            **_dynamics_fields(self.dynamics),
            **_matrix_fields(self.matrices),
        }

    @classmethod
    def from_fields(cls, inputs: ModelInputs, fields: Fields) -> PhysicalModel:
        """The model whose values a file holds."""
        coefficients = fields.array("coefficients", len(inputs.basis.names))
        return cls(inputs, fields.array("stiffness", MOTION), coefficients, _read_dynamics(fields))


@dataclass(frozen=True, eq=False)
class ResponseModel:
    """Two impulse responses at the identification rate, as the parallel cascade estimates them."""

    inputs: ModelInputs  # how its inputs are made of a trial
    # Shape (2 l + 1,): response to the position per sample, from l samples before it to l samples after it [N·m/rad].
    intrinsic: np.ndarray
    # Shape (lags + 1,): response to the basis function of the delayed velocity per sample, from lag 0 on [N·m·s/rad].
    reflex: np.ndarray
    kind: ClassVar[str] = "impulse-responses"
    matrices: ClassVar[None] = None

    def predict(self, trial: Trial) -> xr.Dataset:
        """Torques of a trial, where all lags of its inputs are recorded."""
        return self.simulate(self.inputs.regressors(trial))

    def simulate(self, regressors: Regressors) -> xr.Dataset:
        """Torques of a trial, where all lags of its inputs are recorded."""
        leads = self.intrinsic.size // 2
        rows = slice(max(leads, self.reflex.size - 1), regressors.torque.size - leads)
        if rows.stop - rows.start < 2:
            raise DataError(
                f"the trial has {regressors.torque.size} samples; the impulse responses take {rows.start} before and "
                f"{leads} after each of them: record longer."
            )
        position, drive = regressors.inputs[:, 0], regressors.inputs[:, -1]
        intrinsic = np.convolve(position - position.mean(), self.intrinsic)[leads:][rows]
        reflex = np.convolve(drive - drive.mean(), self.reflex)[rows]
        return torque_dataset(regressors.time[rows], regressors.rate, **sum_paths(intrinsic, reflex))

    def fields(self) -> dict[str, str | xr.Variable]:
        """Texts and variables by name, as files hold them beside those of the inputs."""
        rate, leads = self.inputs.identification_rate, self.intrinsic.size // 2
        return {
            "intrinsic_response": as_variable(self.intrinsic, "intrinsic_lag", unit="N·m/rad"),
            "intrinsic_lag": as_variable(np.arange(-leads, leads + 1) / rate, "intrinsic_lag", unit="s"),
            "reflex_response": as_variable(self.reflex, "reflex_lag", unit="N·m·s/rad"),
            "reflex_lag": as_variable(np.arange(self.reflex.size) / rate, "reflex_lag", unit="s"),
        }

    @classmethod
    def from_fields(cls, inputs: ModelInputs, fields: Fields) -> ResponseModel:
        """The model whose values a file holds."""
        return cls(inputs, fields.array("intrinsic_response"), fields.array("reflex_response"))


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

    def predict(self, trial: Trial, cycle_onsets: str | Sequence[float] | None = None) -> xr.Dataset:
        """Torques of a trial, from a state of rest."""
        prepared = prepare(trial)
        grid = prepared.grid(self.inputs.identification_rate, self.inputs.delay)
        return self.simulate(prepared, grid, self.place(prepared, grid, cycle_onsets))

    def place(self, trial: PreparedTrial, grid: Grid, cycle_onsets: str | Sequence[float] | None = None) -> np.ndarray:
        """Place of each decimated sample within 0 … 1."""
        if self.dimension != "phase":
            return np.clip(self._share(trial, grid), 0.0, 1.0)
        onsets = cycle_onsets if cycle_onsets is not None else self.variable
        if isinstance(onsets, str) and not onsets:
            raise DataError("the model varies with the cycle: give predict the cycle_onsets of this trial.")
        return cycle_place(trial.grid_times(grid), find_onsets(trial, onsets), 0.5 / trial.rate)

    def _share(self, trial: PreparedTrial, grid: Grid) -> np.ndarray:
        """Time or scheduling variable as a share of the range that was fitted, shape (N,); not clipped."""
        values = course_values(trial, grid, self.variable if self.dimension == "schedule" else None)
        return (values - self.limits[0]) / (self.limits[1] - self.limits[0])

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
        return torque_dataset(trial.grid_times(grid), rate, **sum_paths(intrinsic, reflex))

    def check_range(self, trial: PreparedTrial) -> list[str]:
        """Warning about values of the scheduling variable, or times, for which the splines were not fitted."""
        if self.dimension == "phase":
            return []
        share = self._share(trial, trial.grid(self.inputs.identification_rate, self.inputs.delay))
        outside = float(np.mean((share < 0) | (share > 1)))
        if outside <= BEYOND:
            return []
        name = self.variable if self.dimension == "schedule" else "the time"
        return [
            f"{name} lies beyond the fitted range of {self.limits[0]:.3g} to {self.limits[1]:.3g} for "
            f"{100 * outside:.2g} % of the samples, which have the parameters of its end."
        ]

    def fields(self) -> dict[str, str | xr.Variable]:
        """Texts and variables by name, as files hold them beside those of the inputs."""
        stiffness, viscosity, gain = self.coefficients
        rest = {} if self.rest_position is None else {"rest_position": as_variable(self.rest_position, unit="rad")}
        return {
            **_dynamics_fields(self.dynamics),
            "stiffness_splines": as_variable(stiffness, "stiffness_spline", unit="N·m/rad"),
            "viscosity_splines": as_variable(viscosity, "viscosity_spline", unit="N·m·s/rad"),
            "gain_splines": as_variable(gain, "gain_spline", unit="N·m·s/rad"),
            "inertia": as_variable(self.inertia, "inertia", unit="kg·m²"),
            "dimension": self.dimension,
            "variable": self.variable or "none",
            "limits": as_variable(np.array(self.limits), "end"),
            "spline_degree": as_variable(self.degree),
            "torque_lag": as_variable(self.torque_lag, unit="s"),
            **rest,
        }

    @classmethod
    def from_fields(cls, inputs: ModelInputs, fields: Fields) -> TimeVaryingModel:
        """The model whose values a file holds."""
        dimension, variable = fields.text("dimension"), fields.text("variable")
        if dimension not in ("phase", "time", "schedule"):
            raise DataError(f"{fields.source}: unknown dimension {dimension!r}; known: phase, time, schedule.")
        low, high = fields.array("limits", 2).tolist()
        stiffness, viscosity, gain = (fields.array(f"{name}_splines") for name in ("stiffness", "viscosity", "gain"))
        return cls(
            inputs,
            dimension,
            "" if variable == "none" else variable,
            (low, high),
            int(fields.number("spline_degree")),
            (stiffness, viscosity, gain),
            fields.array("inertia"),
            _read_dynamics(fields),
            fields.number("torque_lag"),
            fields.number("rest_position") if "rest_position" in fields.values else None,
        )


Model = StateSpaceModel | PhysicalModel | ResponseModel | TimeVaryingModel
KINDS: Mapping[str, type[Model]] = {
    model.kind: model for model in (StateSpaceModel, PhysicalModel, ResponseModel, TimeVaryingModel)
}


def model_fields(model: Model) -> dict[str, str | xr.Variable]:
    """Kind, texts and variables of a model by name, as files hold them."""
    return {"kind": model.kind, **model.inputs.fields(), **model.fields()}


def model_from_fields(fields: Fields) -> Model:
    """The model whose `kind` and `fields` a file holds."""
    kind = fields.text("kind")
    if kind not in KINDS:
        raise DataError(f"{fields.source}: unknown kind of model {kind!r}; known: {', '.join(KINDS)}.")
    return KINDS[kind].from_fields(ModelInputs.from_fields(fields), fields)


def _matrix_fields(m: Matrices) -> dict[str, xr.Variable]:
    """Matrices with dimensions by which a product along the common one, A.dot(x), is a product of matrices."""
    return {
        "A": as_variable(m.A, "next_state", "state"),
        "B": as_variable(m.B, "next_state", "input"),
        "C": as_variable(m.C, "output", "state"),
        "D": as_variable(m.D, "output", "input"),
        "input_delay": as_variable(np.array(m.input_delays), "input", unit="s"),
    }


def _dynamics_fields(dynamics: ReflexDynamics) -> dict[str, xr.Variable]:
    return {name: as_variable(value) for name, value in dynamics.values.items()}


def _read_dynamics(fields: Fields) -> ReflexDynamics:
    pole = fields.number("pole") if "pole" in fields.values else None
    return ReflexDynamics(fields.number("omega_n"), fields.number("zeta"), pole)


def simulate_torques(
    model: Matrices, initial_state: np.ndarray | None, regressors: Regressors
) -> dict[str, np.ndarray]:
    """Torques of a linear model with the inputs of one path at a time; the initial state belongs to the reflex.

    Shapes: initial_state (n,); returns (N,).
    """
    paths = []
    masks, states = (~regressors.reflex, regressors.reflex), (None, initial_state)
    for u, mask, state in zip(regressors.centred, masks, states, strict=True):
        B, D = model.B[:, mask], model.D[:, mask]
        torque = simulate_response(model.A, B, model.C, D, u, state)[:, 0]
        if not np.isfinite(torque).all():
            raise DataError(
                "the estimated torques are not finite: the model does not suit the record; lower its order."
            )
        paths.append(torque)
    return sum_paths(*paths)


def sum_paths(intrinsic: np.ndarray, reflex: np.ndarray) -> dict[str, np.ndarray]:
    """Torques of both paths less their means, and their sum.

    Shapes: (N,).
    """
    intrinsic, reflex = intrinsic - intrinsic.mean(), reflex - reflex.mean()
    return {"net": intrinsic + reflex, "intrinsic": intrinsic, "reflex": reflex}
