"""Data sets of the comparison with other programs: linear systems, and the regressors of the paper."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy import signal

from ankleloop.joint.prepared import prepare
from ankleloop.signals.vaf import vaf
from ankleloop.simulation.simulate import simulate
from ankleloop.subspace import simulate_response

RATE = 100.0  # Hz
VALIDATION_SAMPLES = 5_000
SETTLING = 500  # samples before the inputs
TRANSIENT = 200  # samples after a start from rest, which are not scored
# Noise relative to each output, and edge of the inputs relative to half the sampling rate.
LINEAR = {
    "open loop": (0.1, None),
    "coloured inputs": (1e-2, 0.2),
    "narrow-band inputs": (1e-2, 0.1),
    "nearly noise-free": (1e-9, None),
}


class Case(NamedTuple):
    """A data set, one of `LINEAR` or "paper" (8 inputs), and the block rows with which it is identified.

    In open loop one output answers, else as many as there are inputs.
    """

    kind: str
    samples: int
    block_rows: int
    channels: int = 8

    def __str__(self):
        channels = (
            "" if self.kind in ("open loop", "paper") else f", {self.channels} × {self.channels}"
        )
        return f"{self.kind}{channels}, {self.samples:,} samples, {self.block_rows} block rows"


class Data(NamedTuple):
    """Inputs, outputs and reference of a data set, and inputs and outputs without noise that no program has seen."""

    u: np.ndarray
    y: np.ndarray
    reference: np.ndarray
    validation_u: np.ndarray
    validation_y: np.ndarray
    instruments: str = "past-reference"
    poles: np.ndarray | None = None  # of a linear system
    dynamic: np.ndarray | None = None  # which inputs drive the state, where that is known
    order: int = 2


@lru_cache
def make_data(case):
    """Data set of a case."""
    return _make_paper_data(case.samples) if case.kind == "paper" else _make_linear_data(case)


def _make_linear_data(case):
    rng = np.random.default_rng(2)
    noise, edge = LINEAR[case.kind]
    inputs, outputs = case.channels, 1 if case.kind == "open loop" else case.channels
    A = np.array([[0.6, 0.5], [-0.5, 0.6]])
    B, C, D = (
        rng.standard_normal(shape) for shape in ((2, inputs), (outputs, 2), (outputs, inputs))
    )
    records = []
    for samples in (case.samples, VALIDATION_SAMPLES):
        u = rng.standard_normal((samples + SETTLING, inputs))
        u = (signal.sosfilt(signal.butter(4, edge, output="sos"), u, axis=0) if edge else u)[
            SETTLING:
        ]
        records.append((u, simulate_response(A, B, C, D, u)))
    (u, clean), validation = records
    y = clean + noise * clean.std(axis=0) * rng.standard_normal(clean.shape)
    instruments = "past-reference" if case.kind == "open loop" else "past-input-output"
    return Data(u, y, u, *validation, instruments, poles=np.linalg.eigvals(A))


def _make_paper_data(samples, seed=1):
    """The inputs of the paper, Chebyshev terms among them, of a trial at 10 dB; for validation of one without noise."""
    options = {"delay": 0.04, "degree": 5, "identification_rate": RATE, "reference": "reference"}
    trial = simulate(seed=seed, duration=samples / RATE)
    measured = prepare(trial).regressors(basis="chebyshev", **options)
    other = simulate(seed=seed + 1, duration=VALIDATION_SAMPLES / RATE, snr_db=None, voluntary=0.0)
    clean = prepare(other).regressors(basis=measured.basis, **options)
    validation = (
        signals - signals.mean(axis=0) for signals in (clean.inputs, clean.torque[:, None])
    )
    signals = measured.inputs, measured.torque[:, None], measured.reference[:, None]
    return Data(*signals, *validation, dynamic=measured.reflex)


def score_model(data, A, B, C, D):
    """VAF on the validation data [%], of the worst output, and the largest error of a pole where they are known."""
    estimated = simulate_response(A, B, C, D, data.validation_u)
    if not np.isfinite(estimated).all():
        return -np.inf, np.nan
    pairs = zip(data.validation_y[TRANSIENT:].T, estimated[TRANSIENT:].T, strict=True)
    poles = [] if data.poles is None else data.poles
    errors = [np.abs(np.linalg.eigvals(A) - pole).min() for pole in poles]
    return min(vaf(y, y_estimated) for y, y_estimated in pairs), max(errors, default=np.nan)
