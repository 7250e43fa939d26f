"""Data of an identification from a record that comes in chunks, in constant memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.arguments import show_value
from ankleloop.errors import DataError
from ankleloop.subspace.hankel_factor import update_factor
from ankleloop.subspace.hankel_rows import HankelRows
from ankleloop.subspace.input_matrices import InputMatrices, OutputRegression, solve_least_squares
from ankleloop.subspace.options import SubspaceOptions
from ankleloop.subspace.records import refuse_constant, refuse_range

__all__ = ["Chunk", "ChunkSource"]

Chunk = tuple[np.ndarray, np.ndarray, np.ndarray | None]  # inputs, outputs and reference


class ChunkSource:
    """A record that is read again for each pass; after the first pass each channel is without its mean, of variance 1.

    Parameters
    ----------
    chunks, dynamic
        As `ankleloop.subspace.moesp.moesp_chunks` takes them.
    options : SubspaceOptions
        Options of the identification.

    Raises
    ------
    DataError
        If the record has no chunks, or a channel is constant or not finite.
    """

    input_matrices: str = "least-squares"
    open_loop = False

    def __init__(
        self, chunks: Callable[[], Iterable[Chunk]], dynamic: ArrayLike | None, options: SubspaceOptions
    ) -> None:
        self._chunks, self.dynamic, self.options = chunks, dynamic, options
        if not callable(chunks):
            raise TypeError(
                f"moesp_chunks: chunks must be a function that returns an iterator, got {show_value(chunks)}."
            )
        first = next(iter(chunks()), None)
        if first is None:
            raise DataError("the record has no chunks.")
        u, y, reference = first
        self.sizes = u.shape[1], y.shape[1], 0 if reference is None else reference.shape[1]
        start = _stack_channels(first)
        with np.errstate(over="ignore", invalid="ignore"):  # of what is refused below, or in the first pass
            self.mean, self.scale = start.mean(axis=0), start.std(axis=0)
            self.scale[start.max(axis=0) == start.min(axis=0)] = 1.0
        if np.isfinite(start).all():
            self._check_scale()

    @property
    def scales(self) -> tuple[np.ndarray, np.ndarray]:
        """Scales of inputs and outputs."""
        m, p, _ = self.sizes
        return self.scale[:m], self.scale[m : m + p]

    def __iter__(self) -> Iterator[np.ndarray]:
        """Chunks of inputs, outputs and reference side by side, scaled by the moments that are known so far."""
        samples = 0
        for chunk in self._chunks():
            x = _stack_channels(chunk)
            if not np.isfinite(x).all():
                t, channel = np.argwhere(~np.isfinite(x))[0]
                raise DataError(f"channel {channel} is not finite at sample {samples + t}: cut or repair the record.")
            samples += len(x)
            yield (x - self.mean) / self.scale

    def compute_gram(self, rows: HankelRows) -> tuple[np.ndarray, int]:
        """First pass: inner products of the Hankel rows, the number of columns, and the moments of the record."""
        width = sum(self.sizes)
        gram, sums, squares, samples = rows.start_gram(width), np.zeros(width), np.zeros(width), 0
        for x in self:
            gram.add(x)
            sums, squares, samples = sums + x.sum(axis=0), squares + np.einsum("tc,tc->c", x, x), samples + len(x)
        columns = rows.count_columns([samples])
        deviation = self._update_moments(sums / samples, squares / samples)
        indices = rows.list_indices(width)
        row_scale = deviation[indices % width]
        return gram.matrix(indices) / np.outer(row_scale, row_scale), columns

    def _update_moments(self, shift: np.ndarray, mean_squares: np.ndarray) -> np.ndarray:
        """Take over the moments of the whole record; returns the factors by which the scales have changed."""
        deviation = np.sqrt(np.maximum(mean_squares - shift**2, 0.0))
        self.mean, self.scale = self.mean + shift * self.scale, self.scale * deviation
        for name, part in self._groups():
            refuse_constant(self.scale[part], np.abs(self.mean[part]), name)
        self._check_scale()
        return deviation

    def _groups(self) -> Iterator[tuple[str, slice]]:
        """Names of the signals and their channels side by side."""
        edges = np.cumsum([0, *self.sizes])
        yield from zip(("input", "output", "reference"), map(slice, edges, edges[1:]), strict=True)

    def _check_scale(self) -> None:
        """Refuse channels whose squares overflow or vanish."""
        for name, part in self._groups():
            refuse_range(self.scale[part], name)

    def factor_rows(self, rows: HankelRows) -> np.ndarray:
        """Triangular factor of the Hankel rows, chunk after chunk."""
        width = sum(self.sizes)
        factor = rows.start_factor(width)
        for chunk in self:
            factor.add(chunk)
        return factor.matrix(rows.list_indices(width))

    def estimate_input_matrices(self, A: np.ndarray, C: np.ndarray) -> InputMatrices:
        """Last pass: B, D and initial state by a triangular factor of their regressors, which each chunk updates."""
        m, p, _ = self.sizes
        regression = OutputRegression(A, C, m, self.dynamic)
        R = np.zeros((regression.unknowns + 1,) * 2, order="F")
        outputs = np.zeros(0)

        def take_inputs() -> Iterator[np.ndarray]:  # itertools.tee would hold the last 57 chunks
            nonlocal outputs
            for x in self:
                outputs = x[:, m : m + p].reshape(-1)
                yield x[:, :m]

        for phi in regression.generate_regressors(take_inputs()):
            R = update_factor(R, np.column_stack([phi, outputs]))
        return regression.unpack(solve_least_squares(R[:-1, :-1], R[:-1, -1], self.options.regression_tolerance))


def _stack_channels(chunk: Chunk) -> np.ndarray:
    return np.column_stack([part for part in chunk if part is not None])
