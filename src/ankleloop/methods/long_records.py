"""Identification of records that do not fit into memory: chunk by chunk, with the torques written to a file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.basis import Basis, fit_basis
from ankleloop.joint.estimate import TORQUES, Estimate
from ankleloop.joint.model_inputs import ModelInputs
from ankleloop.joint.models import StateSpaceModel
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import Regressors, decimation_grid, recording_margins
from ankleloop.methods.moesp import (
    MEMBERS,
    REGRESSION_TOLERANCE,
    MoespModelOptions,
    direct_stiffness,
    separate_reflex,
)
from ankleloop.records.files import atomic_file
from ankleloop.records.long_record import LongRecord
from ankleloop.records.validation import check_speed
from ankleloop.signals.decimation import differentiate, differentiation_margin
from ankleloop.subspace.input_matrices import continue_response
from ankleloop.subspace.moesp import SubspaceEstimate, moesp_chunks

__all__ = ["identify_file"]

CHUNK = 50_000  # identified samples
SEPARATION_SAMPLES = 100_000  # identified samples whose spectrum weighs the separation of the reflex path
VELOCITIES = 1_000_000  # largest number of velocities, evenly spread, to which the basis is fitted

Progress = Callable[[str, float], object]


def identify_file(
    record: LongRecord,
    output: str | Path,
    method: str = "pr-moesp",
    *,
    chunk: int = CHUNK,
    progress: Progress | None = None,
    **options: Any,
) -> Estimate:
    """Identify a record of any length by a member of the MOESP family, in constant memory.

    The record is read four times: for the basis, the projection, the regression, and the torques. All of it is one
    identification: the result is that of `identify` on the whole record, up to rounding, but for the spectrum that
    weighs the separation of the reflex path, which is that of the beginning of the record.

    Parameters
    ----------
    record : LongRecord
        The record.
    output : path-like
        NetCDF file to write: net, intrinsic and reflex torque [N·m] over time [s].
    method : str
        "pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp" or "moesp".
    chunk : int
        Identified samples that are in memory at a time.
    progress : callable, optional
        Called with the name of the pass and its share that is done.
    **options
        Options by name, see `ankleloop.methods.moesp.MoespModelOptions`.

    Returns
    -------
    Estimate
        Its torques are read from `output` when they are asked for, by number of sample (`isel`): their time has no
        index, which would have to be in memory. `diagnostics["vaf"]` [%] is that of the net torque.

    Raises
    ------
    DataError
        If the record is unusable, too short, or lacks what the method needs.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop import save_trial, simulate
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_trial(simulate(seed=1, duration=30.0), f"{folder}/trial.nc")
    ...     estimate = identify_file(LongRecord(f"{folder}/trial.nc"), f"{folder}/torques.nc", chunk=500)
    >>> 120 < estimate.stiffness["K"] < 180
    True
    """
    if method not in MEMBERS:
        raise DataError(f"long records are identified by {', '.join(MEMBERS)}, not by {method!r}.")
    chosen = MoespModelOptions.parse(f"method {method!r} of long records", **options)
    instruments, projection = MEMBERS[method]
    if instruments != "past-reference":
        record = replace(record, reference=None)
    elif record.reference is None:
        raise DataError(f"{record.path.name}: {method} needs a reference: name its variable.")
    chunks = _Chunks(record, chosen, chunk, progress or (lambda name, share: None))
    basis = chunks.fit_basis()
    beginning = chunks.regressors(basis, 0, min(SEPARATION_SAMPLES, chunks.count))
    model = moesp_chunks(
        lambda: chunks.signals(basis),
        chosen.block_rows,
        chosen.order,
        instruments,
        chosen.projection or projection,
        1.0 / chosen.identification_rate,
        instrument_rows=chosen.instrument_rows,
        instrument_leads=chosen.instrument_leads,
        dynamic=beginning.reflex,
        rank_tolerance=chosen.rank_tolerance,
        regression_tolerance=REGRESSION_TOLERANCE,
        names=(beginning.names, ("torque",)),
    )
    vaf = _write_torques(chunks, basis, model, output, method)
    path = separate_reflex(model.matrices, [beginning])
    inputs = ModelInputs.of(beginning)
    matrices = inputs.label(model.matrices)
    return Estimate(
        method=method,
        # An index of the time would take it, and several times its size, into memory.
        torque=xr.open_dataset(output, engine="h5netcdf", decode_times=False, create_default_indexes=False),
        matrices=matrices,
        stiffness=direct_stiffness(model.matrices),
        reflex={"delay": chosen.delay, **path.parameters},
        diagnostics={"singular_values": model.singular_values, **model.diagnostics, **path.diagnostics, "vaf": vaf},
        predictor=StateSpaceModel(inputs, matrices, model.initial_state),
    )


class _Chunks:
    """Regressors of a record, a chunk at a time: chunks overlap by the margins of the filters, their samples do not."""

    def __init__(self, record: LongRecord, options: MoespModelOptions, chunk: int, progress: Progress) -> None:
        self.record, self.options, self.chunk, self.progress = record, options, chunk, progress
        self.rate = options.identification_rate
        self.factor, self.first, self.count = decimation_grid(record.samples, record.rate, self.rate, options.delay)
        self._after = recording_margins(record.rate, self.factor, options.delay)[1]
        self.sums = np.zeros(1)
        self._passes = 0

    def _bounds(self, name: str) -> Iterator[tuple[int, int]]:
        """First and last identified sample of each chunk, with a report of the pass and its share."""
        for start in range(0, self.count, self.chunk):
            stop = min(start + self.chunk, self.count)
            yield start, stop
            self.progress(name, stop / self.count)

    def _read(self, start: int, stop: int, channels: Sequence[str] | None = None) -> xr.Dataset:
        return self.record.read(self.factor * start, self.factor * (stop - 1) + self.first + self._after + 1, channels)

    def fit_basis(self) -> Basis:
        """Basis fitted to velocities that are evenly spread over the record, scaled by the largest of all."""
        rate, delay = self.record.rate, self.options.delay
        before, after = differentiation_margin(rate, delay)
        step, velocities, largest = -(-self.record.samples // VELOCITIES), [], 0.0
        for bounds in self._bounds("basis"):
            piece = self._read(*bounds, ["position"])
            check_speed(piece, source=self.record.path.name, first=self.factor * bounds[0])
            position = piece["position"].values
            velocity = differentiate(position, rate, delay)[before : position.size - after]
            largest = max(largest, float(np.abs(velocity).max()))
            velocities.append(velocity[::step].copy())  # a view would keep all of it in memory
        basis = fit_basis(np.concatenate(velocities), self.options.basis or "chebyshev", self.options.degree)
        return replace(basis, scale=largest)

    def regressors(self, basis: Basis, start: int, stop: int) -> Regressors:
        """Regressors of the identified samples from `start` to `stop`."""
        piece = self._read(start, stop)
        return PreparedTrial(piece, validated=True).regressors(
            delay=self.options.delay,
            basis=basis,
            identification_rate=self.rate,
            reference="reference" if "reference" in piece else None,
        )

    def passes(self, basis: Basis, name: str) -> Iterator[tuple[tuple[int, int], Regressors]]:
        """Bounds and regressors of all chunks."""
        for bounds in self._bounds(name):
            yield bounds, self.regressors(basis, *bounds)

    def signals(self, basis: Basis) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray | None]]:
        """Inputs, torque and reference of all chunks; the sums of inputs and torque are kept for their means."""
        self.sums = np.zeros(1)
        for _, part in self.passes(basis, f"pass {self._passes + 1}"):
            torque = part.torque[:, None]
            self.sums = self.sums + np.hstack([part.inputs, torque]).sum(axis=0)
            yield part.inputs, torque, None if part.reference is None else part.reference[:, None]
        self._passes += 1


def _write_torques(chunks: _Chunks, basis: Basis, estimate: SubspaceEstimate, output: str | Path, method: str) -> float:
    """Last pass: torques of the model, a chunk at a time; returns the VAF of the net torque [%]."""
    *input_means, torque_mean = chunks.sums / chunks.count
    model, state = estimate.matrices, estimate.initial_state.copy()
    energy, residual, total = 0.0, 0.0, 0.0
    with atomic_file(output) as partial, h5netcdf.File(partial, "w") as file:
        variables = _create_variables(file, chunks, method)
        for (start, stop), part in chunks.passes(basis, "torques"):
            u, path = part.inputs - input_means, model.select_inputs(part.reflex)
            intrinsic = u[:, ~part.reflex] @ model.D[0, ~part.reflex]
            reflex, state = continue_response(path.A, path.B, path.C, path.D, u[:, part.reflex], state)
            reflex = reflex[:, 0]
            torques = {"time": part.time, "net": intrinsic + reflex, "intrinsic": intrinsic, "reflex": reflex}
            for name, values in torques.items():
                variables[name][start:stop] = values
            measured = part.torque - torque_mean
            error = measured - torques["net"]
            energy, residual, total = energy + measured @ measured, residual + error @ error, total + reflex.sum()
        mean = total / chunks.count
        for start in range(0, chunks.count, chunks.chunk):
            for name in ("net", "reflex"):  # the intrinsic torque has no mean, because its inputs have none
                variables[name][start : start + chunks.chunk] = variables[name][start : start + chunks.chunk] - mean
    return float(100.0 * (1.0 - (residual / chunks.count - mean**2) / (energy / chunks.count)))


def _create_variables(file: h5netcdf.File, chunks: _Chunks, method: str) -> dict[str, h5netcdf.Variable]:
    """Variables of the file of torques, which are filled chunk by chunk."""
    file.dimensions = {"time": chunks.count}
    file.attrs.update({"method": method, "identification_rate": chunks.rate, "source": chunks.record.path.name})
    descriptions = {"time": ("s", "time")} | {name: ("N·m", f"estimated {name} torque") for name in TORQUES}
    variables = {}
    for name, (unit, long_name) in descriptions.items():
        variables[name] = file.create_variable(name, ("time",), float, chunks=(min(chunks.chunk, chunks.count),))
        variables[name].attrs.update({"units": unit, "long_name": long_name})
    return variables
