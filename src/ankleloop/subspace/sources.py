"""Options and data of an identification, instruments among them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import model_validator

from ankleloop.errors import DataError
from ankleloop.options import Options, as_real, option, show_value
from ankleloop.signals.responses import predict_from_reference
from ankleloop.subspace.hankel import generate_columns, hankel_gram
from ankleloop.subspace.input_matrices import update_factor

SIGNALS = ("input", "output", "reference")
ROUNDING = 1e-13  # of a mean
Instruments = Literal["none", "past-input", "past-input-output", "past-reference"]
INSTRUMENT_SIGNALS: dict[Instruments, tuple[str, ...]] = {
    "none": (),
    "past-input": ("input",),
    "past-input-output": ("input", "output"),
    "past-reference": ("reference",),
}


class SubspaceOptions(Options):
    """Options of an identification, wherever its data are."""

    block_rows: int = option(
        description="block rows of the future, more than the order", ge=2, le=10000
    )
    order: int | None = option(
        description="order; None takes the largest drop of the singular values", ge=1, le=1000
    )
    instruments: Instruments = option(description="instrumental variables")
    projection: Literal["ordinary", "correlation"] = option(description="form of the projection")
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
    regression_tolerance: float = option(
        1e-10, "the same for the regression that gives B and D", ge=0, lt=1
    )
    names: tuple[Sequence[str], Sequence[str]] | None = option(
        None, "names of the inputs and of the outputs of the model", strict=False
    )

    @model_validator(mode="after")
    def _check_rows(self) -> Self:
        rows, leads, order = self.block_rows, self.instrument_leads, self.order or 1
        if rows <= order:
            raise ValueError(f"block_rows must be larger than the order ({order}), got {rows}.")
        if leads > rows:
            raise ValueError(
                f"instrument_leads must be between 0 and block_rows ({rows}), got {leads}."
            )
        if leads and self.instruments != "past-reference":
            raise ValueError(
                f"instrument_leads must be 0 unless instruments are made of the reference: with {self.instruments!r} "
                f"they would not be valid, got {leads}."
            )
        return self


class MemoryOptions(SubspaceOptions):
    """Options of an identification from records in memory."""

    input_matrices: Literal["least-squares", "instruments"] = option(
        "least-squares",
        "how B and D are estimated; with instruments, the inputs are predicted from the reference",
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


class HankelRows(NamedTuple):
    """Rows of future inputs U, instruments Z and future outputs Y, which a projection takes."""

    indices: np.ndarray  # of the rows in the Hankel matrix of all channels over the window
    sizes: tuple[int, int]  # rows of U and of Z
    window: int  # samples that one column reaches over
    lags: np.ndarray  # block rows that each channel reaches over


def select_rows(
    options: SubspaceOptions, sizes: tuple[int, int, int], *, open_loop: bool = False
) -> HankelRows:
    """The rows of records that hold inputs, outputs and, possibly, a reference side by side.

    The instruments consist of some channels, of so many block rows before the future and within it. In open loop the
    reference is the inputs.
    """
    inputs, outputs, references = sizes
    signals = INSTRUMENT_SIGNALS["past-input" if open_loop else options.instruments]
    if "reference" in signals and not references:
        raise DataError(
            "past-reference instruments need a reference: pass the external command of the loop."
        )
    instruments = np.flatnonzero(np.repeat([name in signals for name in SIGNALS], sizes))
    past = options.instrument_rows or options.block_rows
    if not instruments.size:
        past = 0
    elif options.instrument_rows is None and options.projection == "correlation":
        # This form spends m·s directions on the inputs; p·s more are for the outputs.
        past = max(past, -(-(inputs + outputs) * past // instruments.size))
    window, reach = past + options.block_rows, past + options.instrument_leads
    starts = sum(sizes) * np.arange(window)
    parts = (
        (starts[past:], np.arange(inputs)),
        (starts[:reach], instruments),
        (starts[past:], np.arange(inputs, inputs + outputs)),
    )
    indices = np.concatenate([np.add.outer(rows, part).ravel() for rows, part in parts])
    lags = np.full(sum(sizes), options.block_rows)
    lags[instruments] = window  # they reach into the past, all other channels into the future alone
    return HankelRows(
        indices, (inputs * options.block_rows, instruments.size * reach), window, lags
    )


class Source:
    """Records of inputs, outputs and a reference that serves as instrument, each without its mean and of variance 1."""

    sizes: tuple[int, int, int]  # channels of inputs, outputs and reference
    scale: np.ndarray  # by which the channels were divided
    lengths: list[int]  # samples of each record
    records: Iterable[Iterable[np.ndarray]]  # the channels of each record, in chunks
    predicted: list[np.ndarray] | None = None  # instruments for the regression of B and D
    offsets = True
    open_loop = False  # whether the reference is the inputs

    def name_channel(self, channel: int) -> str:
        """Signal of a channel, and its number there."""
        return [
            f"{name} {k}"
            for name, size in zip(SIGNALS, self.sizes, strict=True)
            for k in range(size)
        ][channel]

    def refuse_not_finite(self, x: np.ndarray, first: int, place: str = "") -> None:
        """Refuse numbers that are not finite; the samples count from a first one."""
        finite = np.isfinite(x)
        if not finite.all():
            t, channel = np.argwhere(~finite)[0]
            fault = f"{self.name_channel(channel)} is not finite at sample {first + t}{place}"
            raise DataError(f"{fault}: cut or repair the record.")

    def refuse_constant(self, deviation: np.ndarray, mean: np.ndarray) -> None:
        """Refuse channels that deviate from their mean by rounding alone, shapes (channels,)."""
        constant = deviation <= ROUNDING * mean
        if constant.any():
            name = self.name_channel(int(constant.argmax()))
            raise DataError(f"{name} is constant and carries no information: leave it out.")

    def compute_gram(self, rows: HankelRows) -> np.ndarray:
        """Inner products of the Hankel rows, each less its mean over each record unless offsets are zero."""
        grams = (
            hankel_gram(record, rows.window, rows.lags, subtract_means=self.offsets)
            for record in self.records
        )
        return reduce(np.add, grams)[rows.indices][:, rows.indices]

    def factor_rows(self, rows: HankelRows) -> np.ndarray:
        """Triangular factor of the same rows."""
        # Rows of ones before all others take the means of the records.
        records = len(self.lengths)
        factor = np.zeros((records + rows.indices.size,) * 2, order="F")
        for number, record in enumerate(self.records):
            for columns in generate_columns(record, rows.window, rows.indices):
                ones = np.zeros((records, len(columns)))
                ones[number] = self.offsets
                factor = update_factor(factor, np.concatenate([ones, columns.T]).T)
        return factor[records:, records:]


def list_records(
    x: Any, name: str, merged: bool, lengths: Sequence[int] | None = None
) -> list[np.ndarray]:
    """List the records of a signal as two-dimensional arrays, which have the lengths of the inputs.

    Shapes: x (N,); returns (N, m).
    """
    if merged and not isinstance(x, (list, tuple)):
        raise DataError(
            f"the {name} must be a list of records as the inputs are, got {show_value(x)}."
        )
    records = [as_real(record, name) for record in (x if merged else [x])]
    records = [record[:, None] if record.ndim == 1 else record for record in records]
    for k, record in enumerate(records):
        if record.ndim != 2 or record.shape[1] != records[0].shape[1]:
            raise DataError(
                f"record {k} of the {name} has shape {record.shape}, record 0 {records[0].shape}: every record "
                "must be (samples, channels), with the same channels."
            )
    if lengths is not None and len(records) != len(lengths):
        raise DataError(
            f"{len(lengths)} records of inputs, {len(records)} of the {name}: give one for each."
        )
    for k, (record, length) in enumerate(zip(records, lengths or [], strict=False)):
        if len(record) != length:
            number = f" in record {k}" if len(records) > 1 else ""
            raise DataError(
                f"{length} samples of inputs, {len(record)} of the {name}{number}: cut them to one length."
            )
    return records


class MemorySource(Source):
    """One record or merged records in memory, as `ankleloop.subspace.moesp.moesp` takes them."""

    def __init__(
        self, u: Any, y: Any, reference: Any, predicted: Any, options: MemoryOptions
    ) -> None:
        merged = (
            isinstance(u, (list, tuple))
            and len(u) > 0
            and all(np.ndim(record) == 2 for record in u)
        )
        inputs = list_records(u, "input", merged)
        self.lengths = [len(record) for record in inputs]
        signals = [inputs, list_records(y, "output", merged, self.lengths)]
        references = (
            [] if reference is None else list_records(reference, "reference", merged, self.lengths)
        )
        if references and options.instruments == "past-reference":
            self.open_loop = all(map(np.array_equal, references, inputs))
            if not self.open_loop:
                signals.append(references)
        m, p, *others = (records[0].shape[1] for records in signals)
        self.sizes, self.offsets = (m, p, sum(others)), options.offsets
        records = [np.concatenate(parts, axis=1) for parts in zip(*signals, strict=True)]
        for k, record in enumerate(records):
            self.refuse_not_finite(
                record, 0, f" of record {k}" if merged and len(records) > 1 else ""
            )
        means = [np.einsum("tc->c", record) / len(record) for record in records]
        deviations = [record - mean for record, mean in zip(records, means, strict=True)]
        squares = sum(np.einsum("tc,tc->c", deviation, deviation) for deviation in deviations)
        deviation = np.sqrt(squares / max(sum(self.lengths), 1))
        self.refuse_constant(deviation, np.abs(means).max(axis=0))
        self.scale = deviation if options.scaling else np.ones_like(deviation)
        self.records = [
            [record / self.scale] for record in (deviations if self.offsets else records)
        ]
        if options.input_matrices == "instruments":
            scaled = [record[:, :m] for (record,) in self.records]
            self.predicted = self._predict_inputs(scaled, references, predicted, merged)
        elif predicted is not None:
            raise ValueError(
                "predicted_inputs are instruments for B and D: use input_matrices='instruments' with them."
            )

    def _predict_inputs(
        self, inputs: list[np.ndarray], references: list[np.ndarray], predicted: Any, merged: bool
    ) -> list[np.ndarray]:
        """Noise-free predictions of the inputs in their scale."""
        if predicted is None:
            if not references:
                raise DataError(
                    "input_matrices='instruments' needs a reference: pass the external command of the loop."
                )
            return predict_from_reference(inputs, references)
        records = list_records(predicted, "predicted_inputs", merged, self.lengths)
        m = self.sizes[0]
        if records[0].shape[1] != m:
            raise DataError(
                f"{m} inputs, {records[0].shape[1]} predicted_inputs: pass a prediction of each."
            )
        return [
            (record - self.offsets * record.mean(axis=0)) / self.scale[:m] for record in records
        ]
