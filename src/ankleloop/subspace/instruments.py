"""Instrumental variables of the MOESP family: past signals that are uncorrelated with the future noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ankleloop.errors import DataError
from ankleloop.signals.reference import fit_lagged_response
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.options import Instruments
from ankleloop.subspace.records import remove_means

__all__ = ["INSTRUMENT_SIGNALS", "predict_from_reference", "select_channels"]

SIGNALS = ("input", "output", "reference")
INSTRUMENT_SIGNALS: dict[Instruments, tuple[str, ...]] = {
    "none": (),
    "past-input": ("input",),
    "past-input-output": ("input", "output"),
    "past-reference": ("reference",),
}


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
