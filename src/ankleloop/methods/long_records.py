"""Records that do not fit into memory: streamed from their file, identified, and their torques written to another."""

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import h5netcdf
import h5py
import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.basis import fit_basis
from ankleloop.joint.estimate import TORQUES, Estimate
from ankleloop.joint.regressors import assembled, check_delay, recording_grid, recording_margins
from ankleloop.methods.moesp import MEMBERS, REGRESSION_TOLERANCE, direct_stiffness, reflex_path
from ankleloop.records.files import whole_file
from ankleloop.records.trial import check_speed
from ankleloop.signals.decimation import differentiate, differentiation_margin
from ankleloop.subspace.input_matrices import continued
from ankleloop.subspace.streaming import moesp_chunks

__all__ = ["LongRecord", "identify_file"]

CHUNK = 50_000  # identified samples at a time
SEPARATED = 100_000  # identified samples whose spectrum weighs the separation of the reflex path
VELOCITIES = 1_000_000  # at most so many, evenly spread, settle the basis
SUFFIXES = (".h5", ".hdf5", ".nc")


@dataclass(frozen=True)
class LongRecord:
    """A recording that stays in its HDF5 or NetCDF file, where every variable is one-dimensional.

    Parameters
    ----------
    path : path-like
        The file.
    sampling_rate : float, optional
        Sampling rate [Hz]; by default the attribute `sampling_rate` of the file.
    position, torque : str
        Its variables.
    reference : str or None
        Variable of the command to the servo, in the unit and with the sign of the position.
    position_unit : {"rad", "deg"}
        Unit of position and reference.
    position_sign, torque_sign : {1, -1}
        Factors that make the torque oppose stretch.
    """

    path: Path
    sampling_rate: float | None = None
    position: str = "position"
    torque: str = "torque"
    reference: str | None = "reference"
    position_unit: str = "rad"
    position_sign: int = 1
    torque_sign: int = 1

    def __post_init__(self):
        object.__setattr__(self, "path", Path(self.path))
        if self.path.suffix not in SUFFIXES:
            raise DataError(f"{self.path.name}: long records are read from {', '.join(SUFFIXES)}; convert it first.")
        if self.position_unit not in ("rad", "deg") or {self.position_sign, self.torque_sign} - {1, -1}:
            raise DataError(f"{self.path.name}: position_unit must be 'rad' or 'deg', and signs 1 or -1.")
        with h5py.File(self.path) as file:
            rate = file.attrs.get("sampling_rate") if self.sampling_rate is None else self.sampling_rate
            sizes = {name: file[name].shape if name in file else None for name in self.names.values()}
        for name, shape in sizes.items():
            if shape is None:
                raise DataError(f"{self.path.name}: there is no variable {name!r}.")
            if len(shape) != 1 or shape != sizes[self.position]:
                raise DataError(f"{self.path.name}: {name} has shape {shape}: all variables must be 1-D and alike.")
        if rate is None:
            raise DataError(f"{self.path.name}: the file states no sampling_rate: pass it in Hz.")
        object.__setattr__(self, "sampling_rate", float(np.ravel(rate)[0]))
        object.__setattr__(self, "samples", sizes[self.position][0])

    @property
    def names(self):
        """Variables of the file by what they are."""
        given = {"position": self.position, "torque": self.torque, "reference": self.reference}
        return {role: name for role, name in given.items() if name is not None}

    def read(self, start, stop, roles=None):
        """A piece of the record as a data set in rad and N·m.

        Parameters
        ----------
        start, stop : int
            Samples.
        roles : sequence of str, optional
            Which of position, torque and reference; all, by default.

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        DataError
            If a value is not finite.
        """
        angle = self.position_sign * (np.pi / 180.0 if self.position_unit == "deg" else 1.0)
        variables = {}
        with h5py.File(self.path) as file:
            for role in roles or self.names:
                values = file[self.names[role]][start:stop].astype(float)
                if not np.isfinite(values).all():
                    bad = start + int(np.flatnonzero(~np.isfinite(values))[0])
                    raise DataError(f"{self.path.name}: {self.names[role]} is not finite at sample {bad}: repair it.")
                variables[role] = ("time", values * (self.torque_sign if role == "torque" else angle))
        time = ("time", np.arange(start, min(stop, self.samples)) / self.sampling_rate)
        return xr.Dataset(variables, coords={"time": time}, attrs={"sampling_rate": self.sampling_rate})


def identify_file(
    record,
    output,
    method="pr-moesp",
    *,
    order=2,
    block_rows=15,
    delay=0.04,
    basis="chebyshev",
    degree=5,
    identification_rate=100.0,
    projection=None,
    instrument_rows=None,
    instrument_leads=0,
    rank_tolerance=1e-5,
    chunk=CHUNK,
    progress=None,
):
    """Identify a record of any length by a member of the MOESP family, in constant memory.

    The record is read four times: for the basis, the projection, the regression, and the torques. All of it is one
    identification: the result is that of `identify` on the whole record, up to rounding, but for the spectrum that
    weighs the separation of the reflex path, which is that of its beginning.

    Parameters
    ----------
    record : LongRecord
        The record.
    output : path-like
        NetCDF file to write: net, intrinsic and reflex torque [N·m] over time [s].
    method : str
        "pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp" or "moesp".
    order, block_rows, delay, basis, degree, identification_rate, projection, instrument_rows, instrument_leads
        As `ankleloop.methods.moesp.identify_moesp` takes them.
    rank_tolerance : float
        As `ankleloop.methods.moesp.identify_moesp` takes it.
    chunk : int
        Identified samples that are in memory at a time.
    progress : callable, optional
        Called with the name of the pass and the share of it that is done.

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
    check_delay(delay)
    instruments, usual_projection = MEMBERS[method]
    if instruments != "past-reference":
        record = replace(record, reference=None)
    elif record.reference is None:
        raise DataError(f"{record.path.name}: {method} needs a reference: name its variable.")
    pieces = _Pieces(record, delay, identification_rate, chunk, progress or (lambda name, share: None))
    settled = pieces.basis(basis, degree)
    beginning = pieces.regressors(settled, 0, min(SEPARATED, pieces.count))
    found = moesp_chunks(
        lambda: pieces.signals(settled),
        block_rows,
        order,
        instruments,
        projection or usual_projection,
        1.0 / identification_rate,
        instrument_rows=instrument_rows,
        instrument_leads=instrument_leads,
        dynamic=beginning.reflex,
        rank_tolerance=rank_tolerance,
        regression_tolerance=REGRESSION_TOLERANCE,
        names=(beginning.names, ("torque",)),
    )
    vaf = _write_torques(pieces, settled, found, output, method)
    path = reflex_path(found.matrices, [beginning])
    return Estimate(
        method=method,
        # An index of the time would take it, and several times its size, into memory.
        torque=xr.open_dataset(output, engine="h5netcdf", decode_times=False, create_default_indexes=False),
        matrices=found.matrices,
        stiffness=direct_stiffness(found.matrices),
        reflex={"delay": float(delay), **path.parameters},
        diagnostics={"singular_values": found.singular_values, **found.diagnostics, **path.diagnostics, "vaf": vaf},
    )


class _Pieces:
    """Regressors of a record, a chunk at a time: chunks overlap by what the filters need, their samples do not."""

    def __init__(self, record, delay, rate, chunk, progress):
        self.record, self.delay, self.rate, self.chunk, self.progress = record, delay, rate, chunk, progress
        extent = SimpleNamespace(attrs={"sampling_rate": record.sampling_rate}, sizes={"time": record.samples})
        self.factor, self.first, self.count = recording_grid(extent, rate, delay)
        self._after = recording_margins(record.sampling_rate, self.factor, delay)[1]
        self.sums, self._passes = None, 0

    def _bounds(self, name):
        """First and last identified sample of each chunk, with a report of the pass and its share."""
        for start in range(0, self.count, self.chunk):
            stop = min(start + self.chunk, self.count)
            yield start, stop
            self.progress(name, stop / self.count)

    def _read(self, start, stop, roles=None):
        return self.record.read(self.factor * start, self.factor * (stop - 1) + self.first + self._after + 1, roles)

    def basis(self, kind, degree):
        """Basis settled on velocities that are evenly spread over the record, and on the largest of all."""
        before, after = differentiation_margin(self.record.sampling_rate, self.delay)
        step, kept, largest = -(-self.record.samples // VELOCITIES), [], 0.0
        for bounds in self._bounds("basis"):
            piece = self._read(*bounds, ["position"])
            check_speed(piece, source=self.record.path.name, first=self.factor * bounds[0])
            position = piece["position"].values
            velocity = differentiate(position, self.record.sampling_rate, self.delay)[before : position.size - after]
            largest = max(largest, float(np.abs(velocity).max()))
            kept.append(velocity[::step].copy())  # not a view, which would keep all of it
        return replace(fit_basis(np.concatenate(kept), kind, degree), scale=largest)

    def regressors(self, basis, start, stop):
        """Regressors of some identified samples."""
        piece = self._read(start, stop)
        reference = "reference" if "reference" in piece else None
        return assembled(piece, self.delay, basis, None, self.rate, reference)

    def __call__(self, basis, name):
        """Regressors of all chunks."""
        for bounds in self._bounds(name):
            yield bounds, self.regressors(basis, *bounds)

    def signals(self, basis):
        """Inputs, torque and reference of all chunks; sums of the first two are kept for their means."""
        self.sums = 0.0
        for _, part in self(basis, f"pass {self._passes + 1}"):
            torque = part.torque[:, None]
            self.sums = self.sums + np.hstack([part.inputs, torque]).sum(axis=0)
            yield part.inputs, torque, None if part.reference is None else part.reference[:, None]
        self._passes += 1


def _write_torques(pieces, basis, found, output, method):
    """Last pass: torques of the model, a chunk at a time; returns the VAF of the net torque."""
    *input_means, torque_mean = pieces.sums / pieces.count
    model, state = found.matrices, found.initial_state.copy()
    energy, left, total = 0.0, 0.0, 0.0
    with whole_file(output) as partial, h5netcdf.File(partial, "w") as file:
        variables = _torque_variables(file, pieces, method)
        for (start, stop), part in pieces(basis, "torques"):
            u, driven = part.inputs - input_means, model.of_inputs(part.reflex)
            intrinsic = u[:, ~part.reflex] @ model.D[0, ~part.reflex]
            reflex, state = continued(driven.A, driven.B, driven.C, driven.D, u[:, part.reflex], state)
            reflex = reflex[:, 0]
            torques = {"time": part.time, "net": intrinsic + reflex, "intrinsic": intrinsic, "reflex": reflex}
            for name, values in torques.items():
                variables[name][start:stop] = values
            measured = part.torque - torque_mean
            error = measured - torques["net"]
            energy, left, total = energy + measured @ measured, left + error @ error, total + reflex.sum()
        mean = total / pieces.count
        for start in range(0, pieces.count, pieces.chunk):
            for name in ("net", "reflex"):  # the intrinsic torque has no mean, because its inputs have none
                variables[name][start : start + pieces.chunk] = variables[name][start : start + pieces.chunk] - mean
    return float(100.0 * (1.0 - (left / pieces.count - mean**2) / (energy / pieces.count)))


def _torque_variables(file, pieces, method):
    """Variables of the file of torques, which are filled chunk by chunk."""
    file.dimensions = {"time": pieces.count}
    file.attrs.update({"method": method, "identification_rate": float(pieces.rate), "source": pieces.record.path.name})
    described = {"time": ("s", "time")} | {name: ("N·m", f"estimated {name} torque") for name in TORQUES}
    variables = {}
    for name, (unit, long_name) in described.items():
        variables[name] = file.create_variable(name, ("time",), float, chunks=(min(pieces.chunk, pieces.count),))
        variables[name].attrs.update({"units": unit, "long_name": long_name})
    return variables
