"""Merged records: several records of one system, which no Hankel column and no state may join."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.options import as_real, show_value

ROUNDING = 1e-13  # of a mean


def list_records(x: Any, name: str, merged: bool, lengths: Sequence[int] | None = None) -> list[np.ndarray]:
    """List the records of a signal as two-dimensional arrays, which have the lengths of the inputs.

    Shapes: x (N,); returns (N, m).
    """
    if merged and not isinstance(x, (list, tuple)):
        raise DataError(f"the {name} must be a list of records as the inputs are, got {show_value(x)}.")
    records = [as_real(record, name) for record in (x if merged else [x])]
    records = [record[:, None] if record.ndim == 1 else record for record in records]
    for k, record in enumerate(records):
        if record.ndim != 2 or record.shape[1] != records[0].shape[1]:
            raise DataError(
                f"record {k} of the {name} has shape {record.shape}, record 0 {records[0].shape}: every record "
                "must be (samples, channels), with the same channels."
            )
    if lengths is not None and len(records) != len(lengths):
        raise DataError(f"{len(lengths)} records of inputs, {len(records)} of the {name}: give one for each.")
    for k, (record, length) in enumerate(zip(records, lengths or [], strict=False)):
        if len(record) != length:
            number = f" in record {k}" if len(records) > 1 else ""
            raise DataError(f"{length} samples of inputs, {len(record)} of the {name}{number}: cut them to one length.")
    return records


def scale_records(
    records: Sequence[np.ndarray], name: str, *, scaling: bool = True, subtract_means: bool = True
) -> tuple[list[np.ndarray], np.ndarray]:
    """Remove the means of every record and scale each channel to unit variance over all records.

    Shapes: records (N, m); returns (m,).
    """
    refuse_not_finite(records, name)
    deviations = [record - record.mean(axis=0) for record in records]
    squares = sum(np.einsum("tc,tc->c", deviation, deviation) for deviation in deviations)
    scale = np.sqrt(squares / max(sum(map(len, records)), 1))
    refuse_constant(scale, np.max([np.abs(record.mean(axis=0)) for record in records], axis=0), name)
    divisor = scale if scaling else np.ones_like(scale)
    return [record / divisor for record in (deviations if subtract_means else records)], divisor


def refuse_constant(scale: np.ndarray, size: np.ndarray, name: str) -> None:
    """Refuse channels that deviate from their mean by rounding alone.

    Shapes: scale, size (m,).
    """
    constant = scale <= ROUNDING * size
    if constant.any():
        raise DataError(f"{name} {constant.argmax()} is constant and carries no information: leave it out.")


def refuse_not_finite(records: Sequence[np.ndarray], name: str, first: int = 0) -> None:
    """Refuse numbers that are not finite; the samples count from a first one."""
    for k, record in enumerate(records):
        if not np.isfinite(record).all():
            t, channel = np.argwhere(~np.isfinite(record))[0]
            number = f" of record {k}" if len(records) > 1 else ""
            raise DataError(f"{name} {channel} is not finite at sample {first + t}{number}: cut or repair the record.")
