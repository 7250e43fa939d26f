"""Options and data of a subspace identification, instruments among them."""

from __future__ import annotations

from collections.abc import Sequence
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
MEAN_ROUNDING = 1e-13  # of a mean
Instruments = Literal["none", "past-input", "past-input-output", "past-reference"]
INSTRUMENT_SIGNALS: dict[Instruments, tuple[str, ...]] = {
    "none": (),
    "past-input": ("input",),
    "past-input-output": ("input", "output"),
    "past-reference": ("reference",),
}


def check_rows(block_rows: int, order: int | None, leads: int) -> None:
    """Refuse block rows that are too few for an order, or for leads of the instruments."""
    least = order or 1
    if block_rows <= least:
        raise ValueError(f"block_rows must be larger than the order ({least}), got {block_rows}.")
    if leads > block_rows:
        raise ValueError(
            f"instrument_leads must be between 0 and block_rows ({block_rows}), got {leads}."
        )


class SubspaceOptions(Options):
    """Options of a subspace identification."""

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
    stable: bool = option(
        True,
        "replace an unstable A by a stable one; without it an unstable plant in a stable loop is kept as it is",
    )

    @model_validator(mode="after")
    def _check_rows(self) -> Self:
        leads = self.instrument_leads
        check_rows(self.block_rows, self.order, leads)
        if leads and self.instruments != "past-reference":
            raise ValueError(
                f"instrument_leads must be 0 unless instruments are made of the reference: with {self.instruments!r} "
                f"they would not be valid, got {leads}."
            )
        return self


class HankelRows(NamedTuple):
    """Rows of future inputs U, instruments Z and future outputs Y, which a projection takes."""

    indices: np.ndarray  # of the rows in the Hankel matrix of all channels over the window
    sizes: tuple[int, int]  # rows of U and of Z
    window: int  # samples that one column reaches over
    lags: np.ndarray  # block rows that each channel reaches over


def select_rows(options: SubspaceOptions, sizes: tuple[int, int, int]) -> HankelRows:
    """The rows of records that hold inputs, outputs and, possibly, a reference side by side.

    The instruments consist of some channels, of so many block rows before the future and within it.
    """
    inputs, outputs, references = sizes
    signals = INSTRUMENT_SIGNALS[options.instruments]
    if "reference" in signals and not references:
        raise DataError(
            "past-reference instruments need a reference: pass the external command of the loop."
        )
    are_instruments = np.repeat([name in signals for name in SIGNALS], sizes)
    instruments = np.flatnonzero(are_instruments)
    past = options.instrument_rows or options.block_rows
    if not instruments.size:
        past = 0
    elif options.instrument_rows is None and options.projection == "correlation":
        # This form spends m·s directions on the inputs; p·s more are for the outputs.
        past = max(past, -(-(inputs + outputs) * past // instruments.size))
    window = past + options.block_rows
    reach = past + options.instrument_leads
    starts = sum(sizes) * np.arange(window)
    future = starts[past:]
    input_rows = np.add.outer(future, np.arange(inputs))
    instrument_rows = np.add.outer(starts[:reach], instruments)
    output_rows = np.add.outer(future, inputs + np.arange(outputs))
    return HankelRows(
        indices=np.concatenate([input_rows, instrument_rows, output_rows], axis=None),
        sizes=(input_rows.size, instrument_rows.size),
        window=window,
        # Instruments reach into the past, all other channels into the future alone.
        lags=np.where(are_instruments, window, options.block_rows),
    )


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
    records = [np.column_stack([as_real(record, name)]) for record in (x if merged else [x])]
    if records[0].ndim != 2 or len({record.shape[1:] for record in records}) > 1:
        raise DataError(
            f"every record of the {name} must be (samples, channels), with the same channels."
        )
    if lengths is None:
        return records
    if len(records) != len(lengths):
        raise DataError(
            f"{len(lengths)} records of inputs, {len(records)} of the {name}: give one for each."
        )
    for k, (record, length) in enumerate(zip(records, lengths, strict=True)):
        if len(record) != length:
            place = f" in record {k}" if len(records) > 1 else ""
            raise DataError(
                f"{length} samples of inputs, {len(record)} of the {name}{place}: cut them to one length."
            )
    return records


class Records:
    """Records of inputs, outputs and a reference that serves as instrument, each without its mean and of variance 1."""

    def __init__(
        self, u: Any, y: Any, reference: Any, predicted: Any, options: SubspaceOptions
    ) -> None:
        self.merged = isinstance(u, (list, tuple)) and {np.ndim(record) for record in u} == {2}
        inputs = list_records(u, "input", self.merged)
        self.lengths = [len(record) for record in inputs]
        signals = [inputs, list_records(y, "output", self.merged, self.lengths)]
        references = []
        if reference is not None:
            references = list_records(reference, "reference", self.merged, self.lengths)
        if references and options.instruments == "past-reference":
            signals.append(references)
        m, p, *others = (channels[0].shape[1] for channels in signals)
        self.sizes = (m, p, sum(others))
        self.offsets = options.offsets
        self._scale(
            [np.concatenate(parts, axis=1) for parts in zip(*signals, strict=True)], options
        )
        self.predicted: list[np.ndarray] | None = None
        if options.input_matrices == "instruments":
            self.predicted = self._predict_inputs(references, predicted)
        elif predicted is not None:
            raise ValueError(
                "predicted_inputs are instruments for B and D: use input_matrices='instruments' with them."
            )

    def _scale(self, records: list[np.ndarray], options: SubspaceOptions) -> None:
        """Subtract the means of each record and divide by the scale of all; refuse what is not usable."""
        for number, record in enumerate(records):
            finite = np.isfinite(record)
            if not finite.all():
                sample, channel = np.argwhere(~finite)[0]
                place = f" of record {number}" if len(records) > 1 else ""
                fault = f"{self._name_channel(channel)} is not finite at sample {sample}{place}"
                raise DataError(f"{fault}: cut or repair the record.")
        means = np.array([np.einsum("tc->c", record) / len(record) for record in records])
        deviations = [record - mean for record, mean in zip(records, means, strict=True)]
        squares = [np.einsum("tc,tc->c", record, record) for record in deviations]
        deviation = np.sqrt(np.sum(squares, axis=0) / sum(self.lengths))
        constant = deviation <= MEAN_ROUNDING * np.abs(means).max(axis=0)
        if constant.any():
            name = self._name_channel(int(constant.argmax()))
            raise DataError(f"{name} is constant and carries no information: leave it out.")
        self.scale = deviation if options.scaling else np.ones_like(deviation)
        self.means = means if self.offsets else np.zeros_like(means)
        centred = deviations if self.offsets else records
        self.scaled = [record / self.scale for record in centred]

    def _name_channel(self, channel: int) -> str:
        """Signal of a channel, and its number there."""
        names = [
            f"{signal} {number}"
            for signal, size in zip(SIGNALS, self.sizes, strict=True)
            for number in range(size)
        ]
        return names[channel]

    def _predict_inputs(self, references: list[np.ndarray], predicted: Any) -> list[np.ndarray]:
        """Noise-free predictions of the inputs in their scale."""
        m = self.sizes[0]
        if predicted is None:
            if not references:
                raise DataError(
                    "input_matrices='instruments' needs a reference: pass the external command of the loop."
                )
            return predict_from_reference([record[:, :m] for record in self.scaled], references)
        predictions = list_records(predicted, "predicted_inputs", self.merged, self.lengths)
        if predictions[0].shape[1] != m:
            raise DataError(
                f"{m} inputs, {predictions[0].shape[1]} predicted_inputs: pass a prediction of each."
            )
        if self.offsets:
            predictions = [prediction - prediction.mean(axis=0) for prediction in predictions]
        return [prediction / self.scale[:m] for prediction in predictions]

    def compute_gram(self, rows: HankelRows) -> np.ndarray:
        """Inner products of the Hankel rows, each less its mean over each record unless offsets are zero."""
        grams = [
            hankel_gram(record, rows.window, rows.lags, subtract_means=self.offsets)
            for record in self.scaled
        ]
        return reduce(np.add, grams)[rows.indices][:, rows.indices]

    def factor_rows(self, rows: HankelRows) -> np.ndarray:
        """Triangular factor of the same rows."""
        # Rows of ones before all others take the means of the records.
        records = len(self.scaled)
        size = records + rows.indices.size
        factor = np.zeros((size, size), order="F")
        for number, record in enumerate(self.scaled):
            for hankel in generate_columns(record, rows.window):
                ones = np.zeros((records, hankel.shape[1]))
                ones[number] = self.offsets
                factor = update_factor(factor, np.vstack([ones, hankel[rows.indices]]).T)
        return factor[records:, records:]
