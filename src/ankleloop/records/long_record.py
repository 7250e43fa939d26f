"""A record that does not fit into memory: it stays in its file, and is read in chunks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.records.reading_options import ReadingOptions

__all__ = ["LongRecord"]

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

    Raises
    ------
    DataError
        For another kind of file, a missing variable, variables of different lengths, or a missing sampling rate.
    """

    path: Path
    sampling_rate: float | None = None
    position: str = "position"
    torque: str = "torque"
    reference: str | None = "reference"
    position_unit: str = "rad"
    position_sign: int = 1
    torque_sign: int = 1
    options: ReadingOptions = field(init=False, repr=False)
    rate: float = field(init=False, repr=False)
    samples: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        path = Path(self.path)
        if path.suffix not in SUFFIXES:
            raise DataError(f"{path.name}: long records are read from {', '.join(SUFFIXES)}; convert it first.")
        values = {name: getattr(self, name) for name in ReadingOptions.model_fields}
        try:
            options = ReadingOptions.parse(path.name, **values)
        except ValueError as error:
            raise DataError(f"{path.name}: {error}") from None
        rate, samples = _read_extent(path, options)
        extent = {"sampling_rate": rate, "rate": rate, "samples": samples}
        for name, value in {"path": path, "options": options, **extent}.items():
            object.__setattr__(self, name, value)

    def read(self, start: int, stop: int, channels: Sequence[str] | None = None) -> xr.Dataset:
        """A piece of the record as a data set in rad and N·m.

        Parameters
        ----------
        start, stop : int
            Samples.
        channels : sequence of str, optional
            Which of position, torque and reference; all, by default.

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        DataError
            If a value is not finite.
        """
        variables = {}
        with h5py.File(self.path) as file:
            for channel in channels or self.options.variables:
                name = self.options.variables[channel]
                values = file[name][start:stop].astype(float)
                if not np.isfinite(values).all():
                    bad = start + int(np.flatnonzero(~np.isfinite(values))[0])
                    raise DataError(f"{self.path.name}: {name} is not finite at sample {bad}: repair it.")
                variables[channel] = ("time", values * self.options.factor(channel))
        time = ("time", np.arange(start, min(stop, self.samples)) / self.rate)
        return xr.Dataset(variables, coords={"time": time}, attrs={"sampling_rate": self.rate})


def _read_extent(path: Path, options: ReadingOptions) -> tuple[float, int]:
    """Sampling rate [Hz] and length of the record in a file."""
    with h5py.File(path) as file:
        rate = file.attrs.get("sampling_rate") if options.sampling_rate is None else options.sampling_rate
        shapes = {name: file[name].shape if name in file else None for name in options.variables.values()}
    for name, shape in shapes.items():
        if shape is None:
            raise DataError(f"{path.name}: there is no variable {name!r}.")
        if len(shape) != 1 or shape != shapes[options.position]:
            raise DataError(f"{path.name}: {name} has shape {shape}: all variables must be 1-D and alike.")
        (samples,) = shape
    if rate is None:
        raise DataError(f"{path.name}: the file states no sampling_rate: pass it in Hz.")
    return float(np.ravel(rate)[0]), samples
