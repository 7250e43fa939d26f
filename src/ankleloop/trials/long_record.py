"""A record that does not fit into memory: it stays in its file, and is read in chunks."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.options import check_path, show_fields
from ankleloop.trials.containers import TIME, find_suffix
from ankleloop.trials.files import stamp_file
from ankleloop.trials.readers import choose_rate, parse_options
from ankleloop.trials.reading_options import ReadingOptions
from ankleloop.trials.reading_process import read_channels
from ankleloop.trials.trial import check_sizes
from ankleloop.trials.validation import check_samples

SUFFIXES = (".h5", ".hdf5", ".nc", ".flb")
BLOCK = 250_000  # samples read at a time: each access to the file costs more than so many numbers


class LongRecord:
    """A recording that stays in its HDF5, NetCDF or FLB file, read as `ankleloop.read_trial` reads a short one.

    When the record is made, all of its samples are read and checked: one pass more than those of an identification.
    This and all other reading is left to another process with limits of time and memory, because a damaged file can
    crash or halt the HDF5 library; such a file gives a `DataError`. A file that is changed later is refused. True
    torques of a simulation are not read.

    Parameters
    ----------
    path : path-like
        The file. Variables in groups are named `group/position`.
    sampling_rate : float, optional
        Sampling rate [Hz]; by default that of the file, as `read_trial` finds it.
    position, torque : str
        Its variables.
    reference : str or None
        Variable of the command to the servo, in the unit and with the sign of the position.
    position_unit : {"rad", "deg"}
        Unit of position and reference.
    position_sign, torque_sign : {1, -1}
        Factors that make the torque oppose stretch.
    case : int, optional
        The trial of an FLB file that has several, counted from 1.
    variables : mapping of str to str, optional
        Further variables, read as the file has them: the name in the pieces that `read` gives, and that in the file.

    Raises
    ------
    DataError
        For another kind of file, and wherever `read_trial` refuses a file, with the same words.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop.trials.trial import new_trial, save_trial
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_trial(new_trial([0.0, 0.01, 0.02], [0.0, 1.0, 2.0], 100.0), f"{folder}/trial.nc")
    ...     record = LongRecord(f"{folder}/trial.nc", reference=None)
    ...     print(record.samples, record.rate, record.read(1, 3).torque.values)
    3 100.0 [1. 2.]
    """

    @show_fields(ReadingOptions)
    def __init__(
        self,
        path: str | os.PathLike[str],
        sampling_rate: float | None = None,
        *,
        reference: str | None = "reference",
        **mapping: Any,
    ) -> None:
        self.path = check_path("LongRecord", "path", path)
        source = self.path.name
        ReadingOptions.check_names("LongRecord", mapping)
        self.options = parse_options(source, sampling_rate=sampling_rate, reference=reference, **mapping)
        self.reference = self.options.reference
        if find_suffix(self.path) not in SUFFIXES:
            raise DataError(f"{source}: long records are read from {', '.join(SUFFIXES)}; convert it first.")
        self._channels = read_channels(self.path, self.options, part=(0, 1))
        self._stamp = stamp_file(self.path)
        self._block = lru_cache(2)(self._read_block)
        self.rate = choose_rate(self._channels, self.options, self._read_times, source=source)
        sizes = {role: math.prod(self._channels[role].shape) for role in self._roles}
        check_sizes(sizes, source=source)
        self.samples = sizes["position"]
        starts = range(0, self.samples, BLOCK)
        check_samples((self._block(self._roles, start) for start in starts), self.rate, source=source)

    def read(self, start: int, stop: int, channels: Sequence[str] | None = None) -> xr.Dataset:
        """A piece of the record as a data set in rad and N·m.

        Parameters
        ----------
        start, stop : int
            Samples: the first, and the one before which the piece ends, at the end of the record at the latest.
        channels : sequence of str, optional
            Which of position, torque, reference and the further variables; all, by default.

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        DataError
            If the file has been changed since the record was made, or cannot be read any more.
        ValueError
            For a piece without samples.
        """
        roles = tuple(channels or self._roles)
        if not 0 <= start < min(stop, self.samples):
            raise ValueError(
                f"{self.path.name}: there are no samples {start} to {stop}: the record has {self.samples} samples."
            )
        stop = min(stop, self.samples)
        first = start - start % BLOCK
        blocks = [self._block(roles, block) for block in range(first, stop, BLOCK)]
        joined = {role: np.concatenate([block[role] for block in blocks]) for role in roles}
        variables = {role: ("time", values[start - first : stop - first].copy()) for role, values in joined.items()}
        time = ("time", np.arange(start, stop) / self.rate)
        return xr.Dataset(variables, coords={"time": time}, attrs={"sampling_rate": self.rate})

    @property
    def _roles(self) -> tuple[str, ...]:
        """Channels and further variables."""
        return (*self.options.channels, *self.options.further)

    def _read_times(self) -> Iterator[np.ndarray]:
        """Times as the file has them, in parts."""
        samples = math.prod(self._channels[TIME].shape)
        for start in range(0, samples, BLOCK):
            yield self._fetch([TIME], start, min(start + BLOCK, samples))[TIME]

    def _read_block(self, roles: tuple[str, ...], start: int) -> dict[str, np.ndarray]:
        """Samples in rad and N·m; more than are asked for are read, because the next ones are asked for next."""
        block = self._fetch(roles, start, min(start + BLOCK, self.samples))
        return {role: values * self.options.factor(role) for role, values in block.items()}

    def _fetch(self, roles: Sequence[str], start: int, stop: int) -> dict[str, np.ndarray]:
        """Samples as the file has them."""
        pieces = read_channels(self.path, self.options, part=(int(start), int(stop)), roles=list(roles))
        if stamp_file(self.path) != self._stamp:
            raise DataError(
                f"{self.path.name}: the file has been changed since the record was made: make it again from a copy."
            )
        return {role: piece.values for role, piece in pieces.items()}
