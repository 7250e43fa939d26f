"""Options and data of an identification, instruments among them: records in memory, or one that comes in chunks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import model_validator

from ankleloop.errors import DataError
from ankleloop.options import Options, option, show_value
from ankleloop.signals.reference import fit_lagged_response
from ankleloop.subspace.hankel import COLUMNS, HankelGram, HankelRows, block_hankel, generate_columns
from ankleloop.subspace.input_matrices import InputMatrices, OutputRegression, solve_regression, update_factor
from ankleloop.subspace.records import (
    are_merged,
    list_records,
    refuse_constant,
    refuse_not_finite,
    refuse_range,
    remove_means,
    scale_records,
)

Chunk = tuple[np.ndarray, np.ndarray, np.ndarray | None]  # inputs, outputs and reference
SIGNALS = ("input", "output", "reference")
Instruments = Literal["none", "past-input", "past-input-output", "past-reference"]
ProjectionForm = Literal["ordinary", "correlation"]
INSTRUMENT_SIGNALS: dict[Instruments, tuple[str, ...]] = {
    "none": (),
    "past-input": ("input",),
    "past-input-output": ("input", "output"),
    "past-reference": ("reference",),
}


class SubspaceOptions(Options):
    """Options of an identification, wherever its data are."""

    block_rows: int = option(description="block rows of the future, more than the order", ge=2, le=10000)
    order: int | None = option(description="order; None takes the largest drop of the singular values", ge=1, le=1000)
    instruments: Instruments = option(description="instrumental variables")
    projection: ProjectionForm = option(description="form of the projection")
    dt: float = option(description="sampling interval", unit="s", ge=1e-9, le=1e9)
    instrument_rows: int | None = option(
        None,
        "block rows of the past; None for block_rows, or for as many as the correlation form needs",
        ge=1,
        le=10000,
    )
    instrument_leads: int = option(
        0,
        "block rows by which the reference reaches into the future as well, at most block_rows: any shift of an "
        "external reference is a valid instrument, shifts of inputs and outputs into the future are not",
        ge=0,
        le=10000,
    )
    rank_tolerance: float = option(
        1e-8,
        "singular values below this fraction of the largest one count as zero; they are those of the inputs, in the "
        "correlation form those of the inputs times the instruments",
        ge=0,
        lt=1,
    )
    regression_tolerance: float = option(1e-10, "the same for the regression that gives B and D", ge=0, lt=1)
    names: tuple[Sequence[str], Sequence[str]] | None = option(
        None, "names of the inputs and of the outputs of the model", strict=False
    )

    @property
    def least_order(self) -> int:
        """The order, or the least one that is possible where the data decide."""
        return self.order or 1

    @model_validator(mode="after")
    def _check_rows(self) -> Self:
        rows, leads = self.block_rows, self.instrument_leads
        if rows <= self.least_order:
            raise ValueError(f"block_rows must be larger than the order ({self.least_order}), got {rows}.")
        if leads > rows:
            raise ValueError(f"instrument_leads must be between 0 and block_rows ({rows}), got {leads}.")
        if leads and self.instruments != "past-reference":
            raise ValueError(
                f"instrument_leads must be 0 unless instruments are made of the reference: with {self.instruments!r} "
                f"they would not be valid, got {leads}."
            )
        return self


class MemoryOptions(SubspaceOptions):
    """Options of an identification from records in memory."""

    input_matrices: Literal["least-squares", "instruments"] = option(
        "least-squares", "how B and D are estimated; with instruments, the inputs are predicted from the reference"
    )
    scaling: bool = option(
        True,
        "divide every channel by its standard deviation; without it the rank policy and the correlation form depend on "
        "the units of the channels",
    )
    offsets: bool = option(
        True,
        "remove means, and estimate an offset of each output; without it the data must be deviations from an "
        "equilibrium",
    )


class Source(ABC):
    """Records of inputs, outputs and reference side by side, each channel without its mean and of variance 1."""

    options: SubspaceOptions
    sizes: tuple[int, int, int]  # channels of inputs, outputs and reference
    scales: tuple[np.ndarray, np.ndarray]  # by which inputs and outputs were divided
    dynamic: ArrayLike | None = None
    lengths: list[int]  # samples of each record
    input_matrices = "least-squares"
    offsets = True
    open_loop = False

    @abstractmethod
    def generate_records(self, channels: int) -> Iterator[Iterable[np.ndarray]]:
        """The first channels of each record, in chunks."""

    @abstractmethod
    def compute_gram(self, rows: HankelRows) -> np.ndarray:
        """Inner products of the Hankel rows."""

    def predict_inputs(self) -> list[np.ndarray] | None:
        """Instruments for the regression of B and D."""
        return None

    def factor_rows(self, rows: HankelRows) -> np.ndarray:
        """Triangular factor of the Hankel rows, each less its mean over each record unless offsets are zero."""
        size = rows.indices.size
        total = np.zeros((size, size), order="F")
        for record in self.generate_records(rows.lags.size):
            # A row of ones before all others takes the means.
            factor = np.zeros((size + 1, size + 1), order="F")
            for columns in generate_columns(record, rows.window, rows.indices):
                ones = np.full((1, len(columns)), float(self.offsets))
                factor = update_factor(factor, np.concatenate([ones, columns.T]).T)
            total = update_factor(total, factor[1:, 1:].copy(order="F"))
        return total

    def estimate_input_matrices(self, A: np.ndarray, C: np.ndarray) -> InputMatrices:
        """B, D, initial states and offsets."""
        m, p, _ = self.sizes
        regression = OutputRegression(A, C, m, self.dynamic, len(self.lengths), offsets=self.offsets)
        predicted = self.predict_inputs()
        size = COLUMNS if predicted is None else max(self.lengths)  # samples at a time
        records = (
            ((x[k : k + size, :m], x[k : k + size, m:]) for x in record for k in range(0, len(x), size))
            for record in self.generate_records(m + p)
        )
        return solve_regression(regression, records, predicted, self.options.regression_tolerance)


class MemorySource(Source):
    """One record or merged records in memory.

    Parameters
    ----------
    u, y, reference, dynamic, predicted_inputs
        As `ankleloop.subspace.moesp.moesp` takes them.
    options : MemoryOptions
        Options of the identification.

    Raises
    ------
    DataError
        If records differ in length, or a channel is constant or not finite.
    """

    def __init__(
        self, u: Any, y: Any, reference: Any, dynamic: ArrayLike | None, predicted_inputs: Any, options: MemoryOptions
    ) -> None:
        self.options, self.scaling, self.offsets = options, options.scaling, options.offsets
        self.dynamic, self.input_matrices, self._predicted = dynamic, options.input_matrices, predicted_inputs
        self.merged = are_merged(u)
        inputs, outputs = list_records(u, self.merged, "input"), list_records(y, self.merged, "output")
        references = [] if reference is None else list_records(reference, self.merged, "reference")
        if predicted_inputs is not None and options.input_matrices != "instruments":
            raise ValueError(
                "predicted_inputs are instruments for B and D: use input_matrices='instruments' with them."
            )
        self.lengths = [len(record) for record in inputs]
        self._check_lengths(outputs, "output")
        self.inputs, u_scale = self._scale(inputs, "input")
        self.outputs, y_scale = self._scale(outputs, "output")
        self.scales, self._references = (u_scale, y_scale), references
        if references:
            self._check_lengths(references, "reference")
            self.open_loop = options.instruments == "past-reference" and all(map(np.array_equal, references, inputs))
        self.sizes = u_scale.size, y_scale.size, references[0].shape[1] if references else 0

    @cached_property
    def references(self) -> list[np.ndarray]:
        """Reference of each record, scaled; of no records where there is none."""
        return self.inputs if self.open_loop else self._scale(self._references, "reference")[0]

    def generate_records(self, channels: int) -> Iterator[Iterable[np.ndarray]]:
        """The first channels of each record, in one chunk."""
        signals = [self.inputs, self.outputs]
        if channels > sum(self.sizes[:2]):
            signals.append(self.references)
        for parts in zip(*signals, strict=True):
            yield [np.concatenate(parts, axis=1)]

    def compute_gram(self, rows: HankelRows) -> np.ndarray:
        """Inner products of the Hankel rows of all records that are long enough."""
        total = np.zeros((rows.indices.size, rows.indices.size))
        for (record,) in self.generate_records(rows.lags.size):
            if len(record) >= rows.window:
                gram = HankelGram(rows.window, rows.lags, subtract_means=self.offsets)
                gram.add(record)
                total += gram.matrix(rows.indices)
        return total

    def predict_inputs(self) -> list[np.ndarray] | None:
        """Noise-free predictions of the inputs in their scale, where they serve as instruments."""
        if self.input_matrices != "instruments":
            return None
        if self._predicted is not None:
            predicted = list_records(self._predicted, self.merged, "predicted_inputs")
            self._check_lengths(predicted, "predicted_inputs")
            if predicted[0].shape[1] != self.sizes[0]:
                raise DataError(
                    f"{self.sizes[0]} inputs, {predicted[0].shape[1]} predicted_inputs: pass a prediction of each."
                )
            predicted = remove_means(predicted) if self.offsets else predicted
            return [record / self.scales[0] for record in predicted]
        if not self._references:
            raise DataError("input_matrices='instruments' needs a reference: pass the external command of the loop.")
        return predict_from_reference(self.inputs, self.references)

    def _scale(self, records: list[np.ndarray], name: str) -> tuple[list[np.ndarray], np.ndarray]:
        """Records without their means, of unit variance; and the number by which each channel was divided."""
        return scale_records(records, name, scaling=self.scaling, subtract_means=self.offsets)

    def _check_lengths(self, others: list[np.ndarray], name: str) -> None:
        """Refuse signals whose records do not have the lengths of the inputs."""
        if len(others) != len(self.lengths):
            raise DataError(f"{len(self.lengths)} records of inputs, {len(others)} of the {name}: give one for each.")
        for k, (length, other) in enumerate(zip(self.lengths, others, strict=True)):
            if len(other) != length:
                number = f" in record {k}" if len(others) > 1 else ""
                raise DataError(
                    f"{length} samples of inputs, {len(other)} of the {name}{number}: cut them to one length."
                )


class ChunkSource(Source):
    """A record that is read again for each pass, in constant memory; its moments are known after the first pass.

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

    def __init__(
        self, chunks: Callable[[], Iterable[Chunk]], dynamic: ArrayLike | None, options: SubspaceOptions
    ) -> None:
        self._chunks, self.dynamic, self.options, self.lengths = chunks, dynamic, options, [0]
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
        refuse_not_finite([start], "channel")
        with np.errstate(over="ignore"):  # of what is refused
            # Moments of the first chunk, until those of the record are known.
            self.mean, deviation = start.mean(axis=0), start.std(axis=0)
        self.scale = np.where(np.ptp(start, axis=0) > 0.0, deviation, 1.0)
        for name, part in self._groups():
            refuse_range(self.scale[part], name)

    @property
    def scales(self) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[override]  # known after the first pass
        """Scales of inputs and outputs."""
        m, p, _ = self.sizes
        return self.scale[:m], self.scale[m : m + p]

    def generate_records(self, channels: int) -> Iterator[Iterable[np.ndarray]]:
        """The first channels of the record, in chunks, scaled by the moments that are known so far."""
        yield (x[:, :channels] for x in self._scale_chunks())

    def _scale_chunks(self) -> Iterator[np.ndarray]:
        samples = 0
        for chunk in self._chunks():
            x = _stack_channels(chunk)
            refuse_not_finite([x], "channel", samples)
            samples += len(x)
            yield (x - self.mean) / self.scale

    def compute_gram(self, rows: HankelRows) -> np.ndarray:
        """First pass: inner products of the Hankel rows, and the length and the moments of the record."""
        gram = HankelGram(rows.window, rows.lags)
        width = sum(self.sizes)
        sums, squares, samples = np.zeros(width), np.zeros(width), 0
        for x in self._scale_chunks():
            gram.add(x[:, : rows.lags.size])
            sums, squares, samples = sums + x.sum(axis=0), squares + np.sum(x**2, axis=0), samples + len(x)
        self.lengths = [samples]
        rows.count_columns(self.lengths)
        shift = sums / samples
        deviation = np.sqrt(np.maximum(squares / samples - shift**2, 0.0))
        self.mean, self.scale = self.mean + shift * self.scale, self.scale * deviation
        for name, part in self._groups():
            refuse_constant(self.scale[part], np.abs(self.mean[part]), name)
            refuse_range(self.scale[part], name)
        row_scale = deviation[rows.indices % rows.lags.size]
        return gram.matrix(rows.indices) / np.outer(row_scale, row_scale)

    def _groups(self) -> Iterator[tuple[str, slice]]:
        """Names of the signals and their channels side by side."""
        edges = np.cumsum([0, *self.sizes])
        yield from zip(("input", "output", "reference"), map(slice, edges, edges[1:]), strict=True)


def _stack_channels(chunk: Chunk) -> np.ndarray:
    return np.column_stack([part for part in chunk if part is not None])


def select_channels(instruments: Instruments, sizes: tuple[int, int, int]) -> np.ndarray:
    """Select the channels that instruments consist of, from records of inputs, outputs and reference side by side."""
    signals = INSTRUMENT_SIGNALS[instruments]
    if "reference" in signals and not sizes[2]:
        raise DataError("past-reference instruments need a reference: pass the external command of the loop.")
    return np.flatnonzero(np.repeat([name in signals for name in SIGNALS], sizes))


def predict_from_reference(
    signals: Sequence[np.ndarray], references: Sequence[np.ndarray], leads: int = 15, lags: int = 80
) -> list[np.ndarray]:
    """Predict signals from leads and lags of the reference: the prediction is free of noise that is fed back.

    The leads are needed because zero-phase filters leak the future into the past.

    Shapes: signals (N, m), references (N, q); returns (N, m).
    """
    taps, q = leads + lags + 1, references[0].shape[1]
    if sum(max(0, len(record) - taps + 1) for record in references) < taps * q:
        samples = " + ".join(str(len(record)) for record in references)
        raise DataError(
            f"a record of {samples} samples is too short to predict its inputs from {taps} leads and lags "
            "of the reference: record longer, or use input_matrices='least-squares'."
        )
    response = fit_lagged_response(references, signals, leads, lags)[::-1].reshape(taps * q, -1)
    edges = ((lags, leads), (0, 0))
    return [
        block_hankel(np.pad(record, edges), 0, taps, len(record)).T @ response for record in remove_means(references)
    ]
