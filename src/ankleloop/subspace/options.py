"""Options of the MOESP family, declared once for data in memory and in chunks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Self

from pydantic import model_validator

from ankleloop.options import Options, option

Instruments = Literal["none", "past-input", "past-input-output", "past-reference"]
ProjectionForm = Literal["ordinary", "correlation"]


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
