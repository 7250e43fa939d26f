"""How much of the reflex a second-order model takes for stiffness, where the two paths are correlated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ankleloop.joint.regressors import INTRINSIC_NAMES, Regressors

__all__ = ["path_bias", "stiffness_beside_reflex"]

REFLEX_LAGS = 0.4  # s
MOTION = len(INTRINSIC_NAMES)
DISCARDED = 1e-6  # of the largest singular value


def stiffness_beside_reflex(records: Sequence[Regressors]) -> float:
    """K by least squares, with the reflex as a finite response to the rectified velocity."""
    return _fit_stiffness(records, with_reflex=True)


def path_bias(records: Sequence[Regressors]) -> float:
    """How far K of a model without a reflex is off, because intrinsic inputs and reflex torque are correlated.

    This is the bias of one-pass methods, which fit the intrinsic path first and the reflex to what it leaves. A PRBS
    correlates the two paths, short pulses do not.
    """
    stiffness = stiffness_beside_reflex(records)
    return 100.0 * (_fit_stiffness(records, with_reflex=False) - stiffness) / abs(stiffness)


def _fit_stiffness(records: Sequence[Regressors], *, with_reflex: bool) -> float:
    """K by least squares, on the samples that have all lags of the reflex."""
    lags = round(REFLEX_LAGS * records[0].rate)
    inputs, torque = [], []
    for record in records:
        if record.torque.size > lags + 1:
            part = record.inputs[lags:, :MOTION]
            if with_reflex:
                lagged = np.lib.stride_tricks.sliding_window_view(record.inputs[:, MOTION], lags + 1)
                part = np.column_stack([part, lagged])
            inputs.append(part - part.mean(axis=0))
            torque.append(record.torque[lags:] - record.torque[lags:].mean())
    stacked = np.concatenate(inputs)
    scale = np.maximum(stacked.std(axis=0), np.finfo(float).tiny)
    values = np.linalg.lstsq(stacked / scale, np.concatenate(torque), rcond=DISCARDED)[0]
    return float(values[0] / scale[0])
