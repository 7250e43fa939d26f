"""Identification of records that do not fit into memory: chunk by chunk, with the torques written to a file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ankleloop.checks.data import check_data
from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import Basis, fit_basis
from ankleloop.joint.model_inputs import ModelInputs
from ankleloop.joint.models import StateSpaceModel
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import TORQUES, Regressors, decimation_grid, recording_margins
from ankleloop.methods.method import add_warnings, data_use
from ankleloop.methods.moesp import (
    MEMBERS,
    REGRESSION_TOLERANCE,
    MoespModelOptions,
    direct_stiffness,
    separate_reflex,
)
from ankleloop.options import Options, check_path, option
from ankleloop.signals.decimation import differentiate, differentiation_margin
from ankleloop.signals.statespace import simulate_states
from ankleloop.subspace.moesp import SubspaceEstimate, moesp_chunks
from ankleloop.trials.files import atomic_netcdf, check_output
from ankleloop.trials.long_record import LongRecord

if TYPE_CHECKING:
    import h5netcdf

CHUNK = 50_000  # identified samples
CHECKED_SAMPLES = 100_000  # identified samples whose data are checked at a time
SEPARATION_SAMPLES = 100_000  # identified samples whose spectrum weighs the separation of the reflex path
VELOCITIES = 1_000_000  # largest number of velocities, evenly spread, to which the basis is fitted

Progress = Callable[[str, float], object]


class _ChunkOptions(Options):
    """How a long record is read."""

    chunk: int = option(CHUNK, "identified samples that are in memory at a time", unit="samples", ge=1, le=10**9)
    overwrite: bool = option(False, "whether to replace a file of this name")


def identify_file(
    record: LongRecord,
    output: str | Path,
    method: str = "pr-moesp",
    *,
    chunk: int = CHUNK,
    progress: Progress | None = None,
    overwrite: bool = False,
    **options: Any,
) -> Estimate:
    """Identify a record of any length by a member of the MOESP family, in constant memory.

    In memory are the samples of a chunk and, while the basis is fitted, a million velocities at most.

    The record is read five times: for the checks of the data, the basis, the projection, the regression, and the
    torques. All of it is one identification: the result is that of `identify` on the whole record, up to rounding, but
    for the spectrum that weighs the separation of the reflex path, which is that of the beginning of the record.

    Parameters
    ----------
    record : LongRecord
        The record.
    output : path-like
        NetCDF file to write: net, intrinsic and reflex torque [N·m] over time [s]. It is never the file of the record.
    method : str
        "pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp" or "moesp".
    chunk : int
        Identified samples that are in memory at a time.
    progress : callable, optional
        Called with the name of the pass and its share that is done.
    overwrite : bool
        Whether to replace a file of this name; without it an existing file is refused.
    **options
        Options by name, see `ankleloop.methods.moesp.MoespModelOptions`.

    Returns
    -------
    Estimate
        Its torques are read from `output` when they are asked for, by number of sample (`isel`): their time has no
        index, which would have to be in memory. `diagnostics["vaf"]` [%] is that of the net torque, and
        `diagnostics["warnings"]` says what is wrong with the data, with the times of a part of a long record.

    Raises
    ------
    DataError
        If the record is unusable, too short, or lacks what the method needs; if `output` exists, is the file of the
        record, or cannot be written, which is checked before the record is read.
    TypeError, ValueError
        For an option of another name or type, or out of its range.

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
    output = check_path("identify_file", "output", output)
    if not isinstance(method, str) or method not in MEMBERS:
        raise DataError(f"long records are identified by {', '.join(MEMBERS)}, not by the method {method!r}.")
    chosen = MoespModelOptions.parse(f"method {method!r} of long records", **options)
    reading = _ChunkOptions.parse("identify_file", chunk=chunk, overwrite=overwrite)
    _check_arguments(record, progress)
    check_output(output, overwrite=reading.overwrite, inputs=[record.path])
    instruments, projection = MEMBERS[method]
    if instruments == "past-reference" and record.reference is None:
        raise DataError(f"{record.path.name}: {method} needs a reference: name its variable.")
    chunks = _Chunks(record, instruments == "past-reference", chosen, reading.chunk, progress)
    warnings = chunks.check()
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
    vaf = _write_torques(chunks, basis, model, output, method, reading.overwrite)
    path = separate_reflex(model.matrices, [beginning])
    inputs = ModelInputs.of(beginning)
    matrices = inputs.label(model.matrices)
    estimate = Estimate(
        method=method,
        # An index of the time would take it, and several times its size, into memory.
        torque=xr.open_dataset(output, engine="h5netcdf", decode_times=False, create_default_indexes=False),
        matrices=matrices,
        stiffness=direct_stiffness(model.matrices),
        reflex={"delay": chosen.delay, **path.valid_parameters},
        diagnostics={"singular_values": model.singular_values, **model.diagnostics, **path.diagnostics, "vaf": vaf},
        predictor=StateSpaceModel(inputs, matrices, model.initial_state),
    )
    return add_warnings(estimate, warnings)


def _check_arguments(record: LongRecord, progress: object) -> None:
    if not isinstance(record, LongRecord):
        raise TypeError(f"record must be an ankleloop.LongRecord, got {type(record).__name__}: identify takes trials.")
    if not (progress is None or callable(progress)):
        raise TypeError(f"progress must be a function of a name and a share, or None, got {progress!r}.")


class _Chunks:
    """Regressors of a record, a chunk at a time: chunks overlap by the margins of the filters, their samples do not."""

    def __init__(
        self,
        record: LongRecord,
        has_reference: bool,
        options: MoespModelOptions,
        chunk: int,
        progress: Progress | None,
    ) -> None:
        self.record, self.options, self.chunk = record, options, chunk
        self.channels = ["position", "torque", "reference"][: 3 if has_reference else 2]
        self.progress = progress or (lambda name, share: None)
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

    def _read(self, start: int, stop: int, channels: Sequence[str]) -> xr.Dataset:
        return self.record.read(self.factor * start, self.factor * (stop - 1) + self.first + self._after + 1, channels)

    def check(self) -> list[str]:
        """Warnings about the data (`ankleloop.checks.data.check_data`), in parts that do not depend on chunks.

        A part of which nothing can be said is a warning; if the record is a single part, it is refused.
        """
        use = data_use(self.options, "reference" if "reference" in self.channels else None)
        edges = np.linspace(0, self.count, max(1, round(self.count / CHECKED_SAMPLES)) + 1).astype(int).tolist()
        warnings: list[str] = []
        for start, stop in pairwise(edges):
            part = PreparedTrial(self._read(start, stop, self.channels), validated=True)
            try:
                texts = check_data([part], use)
            except DataError as refusal:
                if len(edges) == 2:
                    raise
                texts = [str(refusal)]
            place = f"{start / self.rate:.4g} to {stop / self.rate:.4g} s: " if len(edges) > 2 else ""
            warnings += [place + text for text in texts]
            self.progress("checks", stop / self.count)
        return warnings

    def fit_basis(self) -> Basis:
        """Basis fitted to velocities that are evenly spread over the record, scaled by the largest of all."""
        step, velocities, largest = -(-self.record.samples // VELOCITIES), [], 0.0
        for first, velocity in self._velocities():
            largest = max(largest, float(np.abs(velocity).max()))
            velocities.append(velocity[-first % step :: step].copy())  # a view would keep all of it in memory
        basis = fit_basis(np.concatenate(velocities), self.options.basis or "chebyshev", self.options.degree)
        return replace(basis, scale=largest)

    def _velocities(self) -> Iterator[tuple[int, np.ndarray]]:
        """Delayed velocity at the recording rate as `differentiate` gives it for the whole record, with its number."""
        rate, delay, samples = self.record.rate, self.options.delay, self.record.samples
        before, after = differentiation_margin(rate, delay)
        longer = 2 * before + 2 * abs(after)  # than the kernel, so that it fits on the last piece
        after = max(after, 0)
        for start in range(before, samples - after, self.factor * self.chunk):
            stop = min(start + self.factor * self.chunk, samples - after)
            begin = max(start - longer, 0)
            position = self.record.read(begin, stop + after, ["position"])["position"].values
            velocity = differentiate(position, rate, delay)[start - begin : position.size - after]
            edges = before if start == before else 0, after if stop == samples - after else 0
            yield start - edges[0], np.pad(velocity, edges, mode="edge")
            self.progress("basis", stop / (samples - after))

    def regressors(self, basis: Basis, start: int, stop: int) -> Regressors:
        """Regressors of the identified samples from `start` to `stop`."""
        piece = self._read(start, stop, self.channels)
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


def _write_torques(
    chunks: _Chunks, basis: Basis, estimate: SubspaceEstimate, output: str | Path, method: str, overwrite: bool
) -> float:
    """Last pass: torques of the model, a chunk at a time; returns the VAF of the net torque [%]."""
    *input_means, torque_mean = chunks.sums / chunks.count
    model, state = estimate.matrices, estimate.initial_state.copy()
    energy, residual, total = 0.0, 0.0, 0.0
    with atomic_netcdf(output, overwrite=overwrite, inputs=[chunks.record.path]) as (file, sink):
        variables = _create_variables(file, chunks, method)
        for (start, stop), part in chunks.passes(basis, "torques"):
            u, path = part.inputs - input_means, model.select_inputs(part.reflex)
            intrinsic = u[:, ~part.reflex] @ model.D[0, ~part.reflex]
            states, state = simulate_states(path.A, np.ascontiguousarray(u[:, part.reflex] @ path.B.T), state)
            reflex = states @ path.C[0] + u[:, part.reflex] @ path.D[0]
            torques = {"time": part.time, "net": intrinsic + reflex, "intrinsic": intrinsic, "reflex": reflex}
            for name, values in torques.items():
                variables[name][start:stop] = values
            sink.check()
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
