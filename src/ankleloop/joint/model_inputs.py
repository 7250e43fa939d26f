"""How the inputs of a model are made of a trial: what a model needs beside its matrices or parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast, get_args

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.hammerstein import BASES, Basis
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import INTRINSIC_NAMES, MOTION, InputStep, Regressors
from ankleloop.signals.decimation import decimation_factor, decimation_margin, decimation_taps, velocity_taps
from ankleloop.subspace.matrices import Matrices
from ankleloop.trials.group_files import Fields

BEYOND = 1.01  # of the range of a basis: less is the ripple of its filters


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

    def regressors(self, trial: xr.Dataset | PreparedTrial) -> Regressors:
        """Inputs of another trial, with the basis, the delay and the rate of this model."""
        return prepare(trial).regressors(
            delay=self.delay,
            basis=self.basis,
            identification_rate=self.identification_rate,
            omitted_step=self.omitted_step,
        )

    def check_range(self, trial: xr.Dataset | PreparedTrial) -> list[str]:
        """Warning about velocities for which the basis functions were not fitted."""
        if self.basis.kind == "rectifier":
            return []
        knots, scale = self.basis.knots, self.basis.scale
        low, high = (float(knots[0]), float(knots[-1])) if self.basis.kind == "spline" else (-scale, scale)
        velocity = prepare(trial).velocity(self.delay)
        margin = (BEYOND - 1.0) * (high - low)
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
