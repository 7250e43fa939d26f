"""Models of the joint as data: all that is needed to compute the torques of another trial."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import isqrt
from typing import Any, ClassVar

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.model_inputs import ModelInputs
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import MOTION, Regressors, torque_dataset
from ankleloop.joint.time_varying_model import TimeVaryingModel
from ankleloop.signals.decimation import decimate
from ankleloop.subspace.input_matrices import simulate_response
from ankleloop.subspace.matrices import Matrices
from ankleloop.trials.group_files import Fields

Trial = xr.Dataset | PreparedTrial


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
        torques = simulate_torques(self.matrices, None, regressors)
        return torque_dataset(regressors.time, regressors.rate, **torques)

    def fields(self) -> dict[str, Any]:
        """Values by name, as files hold them."""
        m = self.matrices
        return {**self.inputs.fields(), "A": m.A, "B": m.B, "C": m.C, "D": m.D, "initial_state": self.initial_state}

    @classmethod
    def from_fields(cls, inputs: ModelInputs, fields: Fields) -> StateSpaceModel:
        """The model whose values a file holds."""
        n, m = isqrt(fields.array("A").size), len(inputs.names)
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
        reflex -= reflex.mean()
        torques = {"net": intrinsic + reflex, "intrinsic": intrinsic, "reflex": reflex}
        return torque_dataset(regressors.time, regressors.rate, **torques)

    def fields(self) -> dict[str, Any]:
        """Values by name, as files hold them."""
        values = {"stiffness": self.stiffness, "coefficients": self.coefficients}
        return {**self.inputs.fields(), **values, **self.dynamics.values}

    @classmethod
    def from_fields(cls, inputs: ModelInputs, fields: Fields) -> PhysicalModel:
        """The model whose values a file holds."""
        pole = fields.number("pole") if "pole" in fields.values else None
        dynamics = ReflexDynamics(fields.number("omega_n"), fields.number("zeta"), pole)
        coefficients = fields.array("coefficients", len(inputs.basis.names))
        return cls(inputs, fields.array("stiffness", MOTION), coefficients, dynamics)


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
        torques = {
            "intrinsic": _respond(regressors.inputs[:, 0], self.intrinsic, -leads)[rows],
            "reflex": _respond(regressors.inputs[:, -1], self.reflex, 0)[rows],
        }
        torques = {name: torque - torque.mean() for name, torque in torques.items()}
        net = torques["intrinsic"] + torques["reflex"]
        return torque_dataset(regressors.time[rows], regressors.rate, net=net, **torques)

    def fields(self) -> dict[str, Any]:
        """Values by name, as files hold them."""
        return {**self.inputs.fields(), "intrinsic_response": self.intrinsic, "reflex_response": self.reflex}

    @classmethod
    def from_fields(cls, inputs: ModelInputs, fields: Fields) -> ResponseModel:
        """The model whose values a file holds."""
        return cls(inputs, fields.array("intrinsic_response"), fields.array("reflex_response"))


Model = StateSpaceModel | PhysicalModel | ResponseModel | TimeVaryingModel
KINDS: Mapping[str, type[Model]] = {
    model.kind: model for model in (StateSpaceModel, PhysicalModel, ResponseModel, TimeVaryingModel)
}


def model_from_fields(fields: Fields) -> Model:
    """The model whose `kind` and `fields` a file holds."""
    kind = fields.text("kind")
    if kind not in KINDS:
        raise DataError(f"{fields.source}: unknown kind of model {kind!r}; known: {', '.join(KINDS)}.")
    return KINDS[kind].from_fields(ModelInputs.from_fields(fields), fields)


def simulate_torques(
    model: Matrices, initial_state: np.ndarray | None, regressors: Regressors
) -> dict[str, np.ndarray]:
    """Torques of a linear model with the inputs of one path at a time; the initial state belongs to the reflex.

    Shapes: initial_state (n,); returns (N,).
    """
    motion, drive = regressors.centred
    paths = {}
    for name, u, mask, state in (
        ("intrinsic", motion, ~regressors.reflex, None),
        ("reflex", drive, regressors.reflex, initial_state),
    ):
        path = model.select_inputs(mask)
        if state is None and not path.B.any():
            torque = u @ path.D[0]
        else:
            torque = simulate_response(path.A, path.B, path.C, path.D, u, state)[:, 0]
        paths[name] = torque - torque.mean()
    if not all(np.all(np.isfinite(torque)) for torque in paths.values()):
        raise DataError("the estimated torques are not finite: the model does not suit the record; lower its order.")
    return {"net": paths["intrinsic"] + paths["reflex"], **paths}


def _respond(x: np.ndarray, response: np.ndarray, first_lag: int) -> np.ndarray:
    """Torque of an impulse response from its first lag on."""
    return np.convolve(x - x.mean(), response)[-first_lag:][: x.size]
