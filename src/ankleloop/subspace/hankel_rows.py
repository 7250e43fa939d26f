"""Rows of the Hankel matrices that a projection takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ankleloop.errors import DataError
from ankleloop.subspace.hankel_factor import HankelFactor
from ankleloop.subspace.hankel_gram import HankelGram

__all__ = ["HankelRows"]


@dataclass(frozen=True)
class HankelRows:
    """Rows of future inputs U, instruments Z and future outputs Y.

    They are taken from records that hold inputs, outputs and, possibly, a reference side by side.

    Parameters
    ----------
    inputs, outputs : int
        Numbers of channels.
    instruments : ndarray of int
        Channels that the instruments consist of.
    block_rows : int
        Block rows of the future.
    past, leads : int
        Block rows of the instruments before the future and within it.
    """

    inputs: int
    outputs: int
    instruments: np.ndarray
    block_rows: int
    past: int
    leads: int

    @property
    def channels(self) -> int:
        """Channels of the records: the reference is among them only where the instruments consist of it."""
        return max(self.inputs + self.outputs, int(self.instruments.max(initial=-1)) + 1)

    @property
    def window(self) -> int:
        """Samples that one column reaches over."""
        return self.past + self.block_rows

    @property
    def sizes(self) -> tuple[int, int]:
        """Rows of U and of Z."""
        return self.inputs * self.block_rows, self.instruments.size * (self.past + self.leads)

    @property
    def total(self) -> int:
        """Rows of U, Z and Y."""
        return sum(self.sizes) + self.outputs * self.block_rows

    @property
    def matrices(self) -> tuple[tuple[np.ndarray, int, int], ...]:
        """Channels, first block row and number of block rows of U, Z and Y."""
        u, y = np.arange(self.inputs), self.inputs + np.arange(self.outputs)
        future = self.past, self.block_rows
        return (u, *future), (self.instruments, 0, self.past + self.leads), (y, *future)

    def start_gram(self, channels: int) -> HankelGram:
        """Start the Gram matrix of a record with this number of channels, to which its samples are then added."""
        return HankelGram(self.window, self._list_lags(channels))

    def start_factor(self, channels: int, *, subtract_means: bool = True) -> HankelFactor:
        """Start the triangular factor of such a record."""
        return HankelFactor(self.window, self._list_lags(channels), subtract_means=subtract_means)

    def _list_lags(self, channels: int) -> np.ndarray:
        """Block rows that each channel reaches over."""
        lags = np.full(channels, self.block_rows)
        lags[self.instruments] = self.window  # they reach into the past, all other channels into the future alone
        return lags

    def list_indices(self, channels: int) -> np.ndarray:
        """Rows of U, Z and Y in the Hankel matrix of a record with this number of channels over the window."""
        starts = channels * np.arange(self.window)
        return np.concatenate([np.add.outer(starts[i : i + count], part).ravel() for part, i, count in self.matrices])

    def count_products(self, channels: int, columns: int) -> int:
        """Products that the inner products take, of records with this number of channels."""
        return channels**2 * self.window * columns

    def count_columns(self, lengths: Sequence[int]) -> int:
        """Columns of the Hankel matrices of all records."""
        columns = sum(max(0, length - self.window + 1) for length in lengths)
        if columns < self.total:
            raise DataError(
                f"the record of {' + '.join(map(str, lengths))} samples is shorter than its Hankel window: "
                f"{self.total} Hankel rows need at least {self.total + self.window - 1} samples. Record longer, or use "
                "fewer block_rows or instrument_rows."
            )
        return columns
