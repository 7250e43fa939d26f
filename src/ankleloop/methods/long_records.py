"""Identification of records that do not fit into memory: chunk by chunk, with the torques written to a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ankleloop.checks.data import check_data
from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import fit_basis
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import (
    TORQUES,
    Regressors,
    decimation_grid,
    recording_margins,
    torque_dataset,
)
from ankleloop.methods.method import INPUTS, add_warnings, data_use
from ankleloop.methods.moesp import (
    MEMBERS,
    MoespModelOptions,
    describe_model,
    separate_reflex,
    subspace_arguments,
)
from ankleloop.options import check_flag, check_integer, check_path
from ankleloop.signals.decimation import differentiate, differentiation_margin
from ankleloop.signals.statespace import simulate_states
from ankleloop.subspace.moesp import SubspaceEstimate, moesp_chunks
from ankleloop.trials.files import atomic_netcdf, check_output
from ankleloop.trials.readers import LongRecord

if TYPE_CHECKING:
    import h5netcdf

CHUNK = 50_000  # identified samples that are in memory
CHECKED_SAMPLES = 100_000  # identified samples whose data are checked at a time
SEPARATION_SAMPLES = (
    100_000  # identified samples whose spectrum weighs the separation of the reflex path
)
VELOCITIES = 1_000_000  # largest number of velocities, evenly spread, to which the basis is fitted


def identify_file(
    record: LongRecord,
    output: str | Path,
    method: str = "pr-moesp",
    *,
    chunk: int = CHUNK,
    overwrite: bool = False,
    **options: Any,
) -> Estimate:
    """Identify a record of any length by a member of the MOESP family, in constant memory.

    In memory are the samples of a chunk and, while the basis is fitted, a million velocities at most. The record is
    read five times: for the checks of the data, the basis, the projection, the regression, and the torques. The result
    is that of `identify` on the whole record, up to rounding, but for the spectrum that weighs the separation of the
    reflex path, which is that of the beginning of the record.

    Parameters
    ----------
    record : LongRecord
    output : path-like
        NetCDF file to write: net, intrinsic and reflex torque [N·m] over time [s]. It is never the file of the record.
    method : str
        "pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp" or "moesp".
    chunk : int
        Identified samples that are in memory at a time.
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
    if method not in list(MEMBERS):
        raise DataError(
            f"long records are identified by {', '.join(MEMBERS)}, not by the method {method!r}."
        )
    chosen = MoespModelOptions.parse(f"method {method!r} of long records", **options)
    check_integer("identify_file", "chunk", chunk, "samples", ge=1)
    check_flag("identify_file", "overwrite", overwrite)
    if not isinstance(record, LongRecord):
        raise TypeError(
            f"record must be an ankleloop.LongRecord, got {type(record).__name__}: identify takes trials."
        )
    check_output(output, overwrite=overwrite, source=record.path)
    reference = "reference" if MEMBERS[method][0] == "past-reference" else None
    if reference and record.reference is None:
        raise DataError(f"{record.path.name}: {method} needs a reference: name its variable.")
    chunks = _Chunks(record, reference, chosen, chunk)
    data_warnings = chunks.check()
    chunks.fit_basis()
    beginning = chunks.regressors(0, min(SEPARATION_SAMPLES, chunks.grid.samples))
    model = moesp_chunks(chunks.signals, **subspace_arguments(chosen, beginning, method))
    with atomic_netcdf(output, overwrite=overwrite) as file:
        file.attrs.update(
            {"method": method, "identification_rate": beginning.rate, "source": record.path.name}
        )
        vaf = chunks.write_torques(model, file)
    # An index of the time would take it, and several times its size, into memory.
    torque = xr.open_dataset(
        output, engine="h5netcdf", decode_times=False, create_default_indexes=False
    )
    path = separate_reflex(model, [beginning])
    estimate = describe_model(method, model, beginning, model.initial_state, path, torque)
    estimate.diagnostics["vaf"] = vaf
    add_warnings(estimate, data_warnings)
    return estimate


class _Chunks:
    """Regressors of a record, a chunk at a time: chunks overlap by the margins of the filters, their samples do not."""

    def __init__(
        self, record: LongRecord, reference: str | None, options: MoespModelOptions, chunk: int
    ) -> None:
        self.record, self.reference, self.options = record, reference, options
        self.chunk = chunk  # identified samples
        self.grid = decimation_grid(
            record.samples, record.rate, options.identification_rate, options.delay
        )
        self.edges = [*range(0, self.grid.samples, chunk), self.grid.samples]

    def _read(self, start: int, stop: int) -> PreparedTrial:
        """What the identified samples from `start` to `stop` are made of."""
        factor, first, _ = self.grid
        after = recording_margins(self.record.rate, factor, self.options.delay)[1]
        channels, last = (
            ["position", "torque", *filter(None, [self.reference])],
            factor * (stop - 1) + first + after,
        )
        return PreparedTrial(self.record.read(factor * start, last + 1, channels), validated=True)

    def check(self) -> list[str]:
        """Warnings about the data (`ankleloop.checks.data.check_data`), in parts that do not depend on chunks.

        A part of which nothing can be said is a warning; if the record is a single part, it is refused.
        """
        use, rate = data_use(self.options, self.reference), self.options.identification_rate
        count = max(1, round(self.grid.samples / CHECKED_SAMPLES))
        warnings: list[str] = []
        for start, stop in pairwise(
            np.linspace(0, self.grid.samples, count + 1).astype(int).tolist()
        ):
            try:
                texts = check_data([self._read(start, stop)], use)
            except DataError as refusal:
                if count == 1:
                    raise
                texts = [str(refusal)]
            place = f"{start / rate:.4g} to {stop / rate:.4g} s: " if count > 1 else ""
            warnings += [place + text for text in texts]
        return warnings

    def fit_basis(self) -> None:
        """Fit the basis to velocities that are evenly spread over the record, scaled by the largest of all."""
        record, options = self.record, self.options
        step, velocities, largest = -(-record.samples // VELOCITIES), [], 0.0
        margin = 2 * sum(
            map(abs, differentiation_margin(record.rate, options.delay))
        )  # more than the kernel is long
        for start, stop in pairwise(
            [*range(0, record.samples, self.grid.factor * self.chunk), record.samples]
        ):
            begin = max(start - margin, 0)
            position = record.read(begin, stop + margin, ["position"])["position"].values
            velocity = differentiate(position, record.rate, options.delay)[
                start - begin : stop - begin
            ]
            largest = max(largest, float(np.abs(velocity).max()))
            velocities.append(
                velocity[-start % step :: step].copy()
            )  # a view would keep all of it in memory
        basis = fit_basis(np.concatenate(velocities), options.basis or "chebyshev", options.degree)
        self.basis = replace(basis, scale=largest)

    def regressors(self, start: int, stop: int) -> Regressors:
        """Regressors of the identified samples from `start` to `stop`."""
        inputs = self.options.model_dump(include=INPUTS)
        return self._read(start, stop).regressors(
            **inputs, basis=self.basis, reference=self.reference
        )

    def signals(self) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray | None]]:
        """Inputs, torque and reference of all chunks; the sums of inputs and torque are kept for their means."""
        self.sums = np.zeros(1)  # of inputs and torque over this pass
        for start, stop in pairwise(self.edges):
            part = self.regressors(start, stop)
            torque = part.torque[:, None]
            self.sums = self.sums + np.hstack([part.inputs, torque]).sum(axis=0)
            yield part.inputs, torque, None if part.reference is None else part.reference[:, None]

    def write_torques(self, estimate: SubspaceEstimate, file: h5netcdf.File) -> float:
        """Last pass: torques of the model, a chunk at a time; returns the VAF of the net torque [%]."""
        count, empty = self.grid.samples, np.empty(0)
        file.dimensions = {"time": count}
        template = torque_dataset(
            empty, self.options.identification_rate, **dict.fromkeys(TORQUES, empty)
        )
        for name, variable in template.variables.items():
            stored = file.create_variable(
                str(name), ("time",), float, chunks=(min(self.chunk, count),)
            )
            stored.attrs.update(variable.attrs)
        *input_means, torque_mean = self.sums / count
        model, state = estimate.matrices, estimate.initial_state.copy()
        energy, residual, total = 0.0, 0.0, 0.0
        for start, stop in pairwise(self.edges):
            part = self.regressors(start, stop)
            u, path = part.inputs - input_means, model.select_inputs(part.reflex)
            intrinsic = u[:, ~part.reflex] @ model.D[0, ~part.reflex]
            A, B, drive = map(np.ascontiguousarray, (path.A, path.B, u[:, part.reflex]))
            states, state = simulate_states(A, B, drive, state)
            reflex = states @ path.C[0] + u[:, part.reflex] @ path.D[0]
            torques = {
                "time": part.time,
                "net": intrinsic + reflex,
                "intrinsic": intrinsic,
                "reflex": reflex,
            }
            for name, values in torques.items():
                file.variables[name][start:stop] = values
            measured = part.torque - torque_mean
            error = measured - torques["net"]
            energy, residual, total = (
                energy + measured @ measured,
                residual + error @ error,
                total + reflex.sum(),
            )
        mean = total / count
        for start, stop in pairwise(self.edges):
            for name in (
                "net",
                "reflex",
            ):  # the intrinsic torque has no mean, because its inputs have none
                file.variables[name][start:stop] -= mean
        return float(100.0 * (1.0 - (residual / count - mean**2) / (energy / count)))
