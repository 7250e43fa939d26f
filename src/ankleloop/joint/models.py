"""Models of the joint as data: their inputs, and all that is needed to compute the torques of another trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isqrt
from typing import Annotated, ClassVar, get_args

import numpy as np
import xarray as xr
from scipy.fft import irfft, next_fast_len, rfft

from ankleloop.errors import DataError
from ankleloop.joint.bases import Basis, read_basis
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.model_fields import Stored, as_variable, dump_fields, read_fields
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import (
    INTRINSIC_NAMES,
    MOTION,
    Grid,
    InputStep,
    Regressors,
    torque_dataset,
)
from ankleloop.joint.time_varying_course import Splines, course_values, cycle_place, find_onsets
from ankleloop.signals.decimation import (
    decimate,
    decimation_factor,
    decimation_margin,
    decimation_taps,
    velocity_taps,
)
from ankleloop.subspace.input_matrices import simulate_response
from ankleloop.subspace.matrices import Matrices
from ankleloop.trials.group_files import Fields

VELOCITY_RIPPLE = 0.01  # of the range of a basis: filters carry the velocity as far beyond
REFLEX_PADDING = 1.0  # s
# Of the samples, outside the limits of a scheduling variable, without a warning.
LARGEST_SHARE_OUTSIDE = 0.05
# Dimensions of matrices: a product along the common one, A.dot(x), is a product of matrices.
MATRIX_AXES = {
    "A": ("next_state", "state"),
    "B": ("next_state", "input"),
    "C": ("output", "state"),
    "D": ("output", "input"),
}


@dataclass(frozen=True, eq=False)
class ModelInputs:
    """Inputs of a model: position, velocity, acceleration, and basis functions of the delayed velocity."""

    basis: Basis  # basis functions, with the scale or the knots of the record that was fitted
    # Reflex delay, by which the velocity of the basis functions is late.
    delay: Annotated[float, Stored(unit="s")]
    identification_rate: Annotated[float, Stored(unit="Hz")]  # rate of the inputs
    # Rate of the record that was fitted; another trial may have another one.
    recording_rate: Annotated[float, Stored(unit="Hz")]
    # Step of the processing that was left out.
    omitted_step: Annotated[InputStep | None, Stored()] = None

    @classmethod
    def of(cls, regressors: Regressors) -> ModelInputs:
        """Those of regressors."""
        return cls(
            basis=replace(regressors.basis, quantiles=np.empty(0)),
            delay=regressors.delay,
            identification_rate=regressors.rate,
            recording_rate=regressors.grid.factor * regressors.rate,
            omitted_step=regressors.omitted_step,
        )

    def label(self, matrices: Matrices) -> Matrices:
        """Matrices with the names and delays of these inputs, and with their numbers in the order of C.

        The order in memory decides the last bits of a product: so a model from a file gives those of the first one.
        """
        A, B, C, D = (np.ascontiguousarray(getattr(matrices, name)) for name in MATRIX_AXES)
        terms = self.basis.names
        names = ((*INTRINSIC_NAMES, *terms), ("torque",))
        delays = (0.0,) * MOTION + (self.delay,) * len(terms)
        return Matrices(A, B, C, D, matrices.dt, names, delays)

    def regressors(self, trial: PreparedTrial) -> Regressors:
        """Inputs of another trial, with the basis, the delay and the rate of this model."""
        return trial.regressors(
            delay=self.delay,
            basis=self.basis,
            identification_rate=self.identification_rate,
            omitted_step=self.omitted_step,
        )

    def kernels(self) -> dict[str, xr.Variable]:
        """Kernels of `decimate` and `differentiate` as plain sums of kernel · x(n - lag) over recorded samples n.

        None where a step is left out.
        """
        if self.omitted_step is not None:
            return {}
        factor = decimation_factor(self.recording_rate, self.identification_rate)
        margin = decimation_margin(factor)
        kernels = []
        for derivative in range(MOTION):
            taps, half = decimation_taps(factor, derivative)
            kernels.append(self.identification_rate**derivative * np.pad(taps, margin - half))
        decimation_lags = np.arange(-margin, margin + 1)
        velocity_kernel, half, delay = velocity_taps(self.recording_rate, self.delay)
        velocity_lags = np.arange(-half, half + 1) + delay
        return {
            "decimation_kernel": as_variable(np.array(kernels), ("derivative", "decimation_lag")),
            "decimation_lag": as_variable(decimation_lags, "decimation_lag", "recorded samples"),
            "velocity_kernel": as_variable(velocity_kernel, "velocity_lag", "1/s"),
            "velocity_lag": as_variable(velocity_lags, "velocity_lag", "recorded samples"),
        }


@dataclass(frozen=True, eq=False)
class JointModel:
    """A model of the joint that predicts the torques of a trial."""

    inputs: ModelInputs  # how its inputs are made of a trial

    def predict(
        self, trial: PreparedTrial, cycle_onsets: str | Sequence[float] | None = None
    ) -> xr.Dataset:
        """Torques of a trial, from a state of rest; a joint that changes may need the onsets of its cycles."""
        return self.simulate(trial, self.inputs.regressors(trial))

    def simulate(self, trial: PreparedTrial, regressors: Regressors) -> xr.Dataset:
        """Torques of a trial with these regressors."""
        raise NotImplementedError

    def lags(self) -> dict[str, xr.Variable]:
        """Lags of responses, which other programs need; none."""
        return {}

    def check_range(self, trial: PreparedTrial) -> list[str]:
        """Warning about velocities for which the basis functions were not fitted."""
        basis = self.inputs.basis
        if basis.extrapolates:
            return []
        velocity = trial.velocity(self.inputs.delay)
        low, high = basis.limits
        margin = VELOCITY_RIPPLE * (high - low)
        if low - margin <= velocity.min() and velocity.max() <= high + margin:
            return []
        return [
            f"the velocity of this trial goes from {velocity.min():.3g} to {velocity.max():.3g} rad/s, and the "
            f"{basis.kind} basis was fitted from {low:.3g} to {high:.3g} rad/s: the reflex torque is extrapolated."
        ]


@dataclass(frozen=True, eq=False)
class StateSpaceModel(JointModel):
    """Linear model at the identification rate, as the MOESP family estimates it."""

    matrices: Matrices  # A, B, C, D from the inputs to the torque, in physical units, labelled by `inputs`
    # Shape (n,): state at the first sample of the record that was fitted. Torques of another trial start at rest.
    initial_state: Annotated[np.ndarray, Stored("state")]
    kind: ClassVar[str] = "state-space"

    def simulate(self, trial: PreparedTrial, regressors: Regressors) -> xr.Dataset:
        """Torques of a trial."""
        return simulate_torques(self.matrices, None, regressors)


@dataclass(frozen=True, eq=False)
class PhysicalModel(JointModel):
    """Physical parameters in continuous time, as refined instrumental variables estimate them."""

    # Shape (3,): K [N·m/rad], B [N·m·s/rad], I [kg·m²].
    stiffness: Annotated[np.ndarray, Stored("parameter")]
    # Shape (k,): torque per basis function.
    coefficients: Annotated[np.ndarray, Stored("basis_function")]
    dynamics: ReflexDynamics  # low-pass of unit gain behind the basis functions
    kind: ClassVar[str] = "physical"

    @cached_property
    def matrices(self) -> Matrices:
        """A, B, C, D at the identification rate, for inputs that are linear between samples."""
        rate = self.inputs.identification_rate
        A, B, C, D = self.dynamics.matrices(rate)
        input_matrix = np.hstack([np.zeros((len(A), MOTION)), B * self.coefficients])
        feedthrough = np.concatenate([self.stiffness, D.item() * self.coefficients])
        return self.inputs.label(Matrices(A, input_matrix, C, feedthrough[None, :], 1.0 / rate))

    def simulate(self, trial: PreparedTrial, regressors: Regressors) -> xr.Dataset:
        """Torques of a trial; the dynamics act at the recording rate."""
        intrinsic = regressors.centred[0] @ self.stiffness
        functions = self.inputs.basis(trial.velocity(self.inputs.delay))
        drive = self.coefficients @ functions
        matrices = self.dynamics.matrices(trial.rate)
        recorded = simulate_response(*matrices, drive[:, None])[:, 0]
        reflex = decimate(recorded, *regressors.grid)
        return sum_paths(regressors.time, regressors.rate, intrinsic, reflex)


@dataclass(frozen=True, eq=False)
class ResponseModel(JointModel):
    """Two impulse responses at the identification rate, as the parallel cascade estimates them."""

    # Shape (2 l + 1,): response to the position per sample, from l samples before it to l samples after it [N·m/rad].
    intrinsic: Annotated[
        np.ndarray, Stored("intrinsic_lag", name="intrinsic_response", unit="N·m/rad")
    ]
    # Shape (lags + 1,): response to the basis function of the delayed velocity per sample, from lag 0 on [N·m·s/rad].
    reflex: Annotated[np.ndarray, Stored("reflex_lag", name="reflex_response", unit="N·m·s/rad")]
    kind: ClassVar[str] = "impulse-responses"
    matrices: ClassVar[None] = None

    def lags(self) -> dict[str, xr.Variable]:
        """Lags of the responses."""
        rate = self.inputs.identification_rate
        leads = self.intrinsic.size // 2
        intrinsic_lags = np.arange(-leads, leads + 1) / rate
        reflex_lags = np.arange(self.reflex.size) / rate
        return {
            "intrinsic_lag": as_variable(intrinsic_lags, "intrinsic_lag", "s"),
            "reflex_lag": as_variable(reflex_lags, "reflex_lag", "s"),
        }

    def simulate(self, trial: PreparedTrial, regressors: Regressors) -> xr.Dataset:
        """Torques of a trial, where all lags of its inputs are recorded."""
        leads = self.intrinsic.size // 2
        samples = regressors.torque.size
        rows = slice(max(leads, self.reflex.size - 1), samples - leads)
        if rows.stop - rows.start < 2:
            raise DataError(
                f"the trial has {samples} samples, responses take {rows.start + leads}: record longer."
            )
        position = regressors.inputs[:, 0]
        drive = regressors.inputs[:, -1]
        intrinsic = np.convolve(position - position.mean(), self.intrinsic)[leads:][rows]
        reflex = np.convolve(drive - drive.mean(), self.reflex)[rows]
        return sum_paths(regressors.time[rows], regressors.rate, intrinsic, reflex)


@dataclass(frozen=True, eq=False)
class TimeVaryingModel(JointModel):
    """K, B, G and I as splines, and the low-pass of the reflex behind the gain."""

    # What K, B and G are functions of, and the variable of a trial that holds it; none where onsets come as numbers.
    dimension: Annotated[str, Stored()]
    variable: Annotated[str | None, Stored()]
    # Phase, time from the first sample of a trial [s] or scheduling variable at the first and at the last place.
    limits: Annotated[np.ndarray, Stored("end")]
    # Degree of the splines: 3, or 0 for indicators of intervals.
    degree: Annotated[int, Stored(name="spline_degree")]
    # Coefficients of the splines of K, B, G and I, of shape (splines,); a single one of I where it is constant.
    stiffness: Annotated[
        np.ndarray, Stored("stiffness_spline", name="stiffness_splines", unit="N·m/rad")
    ]
    viscosity: Annotated[
        np.ndarray, Stored("viscosity_spline", name="viscosity_splines", unit="N·m·s/rad")
    ]
    gain: Annotated[np.ndarray, Stored("gain_spline", name="gain_splines", unit="N·m·s/rad")]
    inertia: Annotated[np.ndarray, Stored("inertia_spline", name="inertia_splines", unit="kg·m²")]
    dynamics: ReflexDynamics  # low-pass of unit gain
    # Lag of the torque channel behind the position.
    torque_lag: Annotated[float, Stored(unit="s")] = 0.0
    # Position at which the elastic torque is zero; None for the mean position of a trial.
    rest_position: Annotated[float | None, Stored(unit="rad")] = None
    kind: ClassVar[str] = "time-varying"
    matrices: ClassVar[None] = None

    def parameters(self, place: np.ndarray) -> dict[str, np.ndarray]:
        """K, B, G and I at places, each of the shape of `place`; beyond 0 … 1 those of the next end."""
        coefficients = {
            "K": self.stiffness,
            "B": self.viscosity,
            "G": self.gain,
            "I": self.inertia,
        }
        periodic = self.dimension == "phase"
        parameters = {}
        for name, values in coefficients.items():
            degree = self.degree if values.size > 1 else 0
            parameters[name] = Splines(values.size, periodic, degree)(place) @ values
        return parameters

    def predict(
        self, trial: PreparedTrial, cycle_onsets: str | Sequence[float] | None = None
    ) -> xr.Dataset:
        """Torques of a trial, from a state of rest."""
        grid = trial.grid(self.inputs.identification_rate, self.inputs.delay)
        if self.dimension != "phase":
            return self.torques(trial, grid, self._compute_place(trial, grid))
        onsets = self.variable if cycle_onsets is None else cycle_onsets
        if onsets is None:
            raise DataError(
                "the model varies with the cycle: give predict the cycle_onsets of this trial."
            )
        place = cycle_place(trial.grid_times(grid), find_onsets(trial, onsets), 0.5 / trial.rate)
        return self.torques(trial, grid, place)

    def _compute_place(self, trial: PreparedTrial, grid: Grid) -> np.ndarray:
        """Time or scheduling variable as a share of the range that was fitted, shape (N,); not clipped."""
        low, high = self.limits
        return (course_values(trial, grid, self.variable) - low) / (high - low)

    def torques(self, trial: PreparedTrial, grid: Grid, place: np.ndarray) -> xr.Dataset:
        """Torques of a trial whose samples are at known places.

        Shapes: place (N,).
        """
        parameters = self.parameters(place)
        position, velocity, acceleration = trial.motion(grid)
        rest = position.mean() if self.rest_position is None else self.rest_position
        elastic = parameters["K"] * (position - rest)
        viscous = parameters["B"] * velocity
        intrinsic = elastic + viscous + parameters["I"] * acceleration
        (rectified,) = self.inputs.basis(trial.velocity(self.inputs.delay))
        drive = parameters["G"] * decimate(rectified, *grid)
        rate = self.inputs.identification_rate
        size = next_fast_len(grid.samples + round(REFLEX_PADDING * rate), real=True)
        s = 2j * np.pi * np.fft.rfftfreq(size, 1.0 / rate)
        lag = np.exp(-s * self.torque_lag)
        spectra = lag * rfft([intrinsic, drive], size)
        spectra[1] *= self.dynamics.response(s)[0]
        torques = irfft(spectra, size)[:, : grid.samples]
        return sum_paths(trial.grid_times(grid), rate, *torques)

    def check_range(self, trial: PreparedTrial) -> list[str]:
        """Warning about values of the scheduling variable, or times, for which the splines were not fitted."""
        if self.dimension == "phase":
            return []
        grid = trial.grid(self.inputs.identification_rate, self.inputs.delay)
        place = self._compute_place(trial, grid)
        outside = np.mean((place < 0) | (place > 1))
        if outside <= LARGEST_SHARE_OUTSIDE:
            return []
        name = self.variable or "the time"
        low, high = self.limits
        return [
            f"{name} lies beyond the fitted range of {low:.3g} to {high:.3g} for {100 * outside:.2g} % of the samples."
        ]


@dataclass(frozen=True, eq=False)
class ApparatusModel(JointModel):
    """An apparatus without a subject: what moves with the position, and friction that has the sign of the velocity."""

    # Shape (3,): K [N·m/rad], B [N·m·s/rad], I [kg·m²].
    stiffness: Annotated[np.ndarray, Stored("parameter")]
    friction: Annotated[float, Stored(unit="N·m")]
    kind: ClassVar[str] = "apparatus"
    matrices: ClassVar[None] = None

    def simulate(self, trial: PreparedTrial, regressors: Regressors) -> xr.Dataset:
        """Torques of a trial; that of the reflex is zero."""
        torque = regressors.inputs @ np.append(self.stiffness, self.friction)
        return sum_paths(regressors.time, regressors.rate, torque, np.zeros(torque.size))


Model = StateSpaceModel | PhysicalModel | ResponseModel | TimeVaryingModel | ApparatusModel
MODEL_KINDS: dict[str, type[Model]] = {model.kind: model for model in get_args(Model)}


def read_model(fields: Fields) -> Model:
    """The model whose `kind` and fields a file holds."""
    kind = fields.text("kind")
    inputs = read_fields(ModelInputs, fields, basis=read_basis(fields))
    if kind != StateSpaceModel.kind:
        return read_fields(MODEL_KINDS[kind], fields, inputs=inputs)
    n = isqrt(fields.array("A").size)
    m = MOTION + len(inputs.basis.names)
    shapes = {"A": (n, n), "B": (n, m), "C": (1, n), "D": (1, m)}
    A, B, C, D = (fields.array(name, *shape) for name, shape in shapes.items())
    matrices = inputs.label(Matrices(A, B, C, D, 1.0 / inputs.identification_rate))
    return read_fields(StateSpaceModel, fields, inputs=inputs, matrices=matrices)


def dump_model(model: Model) -> dict[str, str | xr.Variable]:
    """Kinds and fields of a model and of its basis, from which it is read."""
    fields = {"kind": model.kind, "basis": model.inputs.basis.kind, **dump_fields(model)}
    if model.matrices is not None:
        for name, axes in MATRIX_AXES.items():
            fields[name] = as_variable(getattr(model.matrices, name), axes)
    return fields


def model_dataset(model: Model) -> xr.Dataset:
    """Fields of a model, and what other programs need to compute its torques without the library."""
    fields = dump_model(model) | model.inputs.kernels() | model.lags()
    names: dict[str, Sequence[str]] = {"basis_function": list(model.inputs.basis.names)}
    matrices = model.matrices
    if matrices is not None and matrices.names:
        names["input"], names["output"] = map(list, matrices.names)
        fields["input_delay"] = as_variable(np.array(matrices.input_delays), "input", "s")
    texts = {name: value for name, value in fields.items() if isinstance(value, str)}
    variables = {name: value for name, value in fields.items() if name not in texts}
    return xr.Dataset(variables, names, texts)


def simulate_torques(
    model: Matrices, initial_state: np.ndarray | None, regressors: Regressors
) -> xr.Dataset:
    """Torques of a linear model with the inputs of one path at a time; the initial state belongs to the reflex.

    Shapes: initial_state (n,).
    """
    motion, drive = regressors.centred
    intrinsic = _simulate_columns(model, slice(MOTION), motion, None)
    reflex = _simulate_columns(model, slice(MOTION, None), drive, initial_state)
    if not np.isfinite([intrinsic, reflex]).all():
        raise DataError(
            "the estimated torques are not finite: the model does not suit the record; lower its order."
        )
    return sum_paths(regressors.time, regressors.rate, intrinsic, reflex)


def _simulate_columns(
    model: Matrices, columns: slice, signals: np.ndarray, state: np.ndarray | None
) -> np.ndarray:
    """Torque by some of the inputs alone."""
    B = model.B[:, columns]
    D = model.D[:, columns]
    return simulate_response(model.A, B, model.C, D, signals, state)[:, 0]


def sum_paths(
    time: np.ndarray, rate: float, intrinsic: np.ndarray, reflex: np.ndarray
) -> xr.Dataset:
    """Torques of both paths less their means, and their sum, over time.

    Shapes: (N,).
    """
    intrinsic = intrinsic - intrinsic.mean()
    reflex = reflex - reflex.mean()
    return torque_dataset(time, rate, net=intrinsic + reflex, intrinsic=intrinsic, reflex=reflex)
