"""Data sets of the benchmarks: open-loop data with white or coloured inputs, and the regressors of the paper."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy import signal

from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import Regressors
from ankleloop.signals.vaf import vaf
from ankleloop.simulation.simulate import simulate
from ankleloop.subspace import simulate_response

RATE = 100.0  # Hz
VALIDATION_SAMPLES = 5_000
SETTLING = 500  # samples before a coloured input
BANDS = {"coloured inputs": 0.2, "narrow-band inputs": 0.1}  # edge of the inputs, relative to half the sampling rate
TRANSIENT = 200  # samples after a start from rest, which are not scored


class Case(NamedTuple):
    """A data set and the block rows with which it is identified.

    `kind` is "open loop", "paper", "nearly noise-free" or one of `BANDS`; "paper" has 8 inputs.
    """

    kind: str
    samples: int
    block_rows: int
    channels: int = 8


@dataclass(frozen=True)
class Data:
    """Inputs, outputs and reference of a data set, and validation data without noise.

    Parameters
    ----------
    u, y, reference : ndarray, shape (N, channels)
        Data of the identification.
    order : int
        Order of the model.
    poles : ndarray or None
        Poles of the system, where it is linear.
    validation_u, validation_y : ndarray, shape (M, channels)
        Data without noise that no program has seen.
    instruments : str
        Instruments of ankleloop.
    regressors : Regressors, optional
        Regressors of a trial that u and y belong to.
    """

    u: np.ndarray
    y: np.ndarray
    reference: np.ndarray
    order: int
    poles: np.ndarray | None
    validation_u: np.ndarray
    validation_y: np.ndarray
    instruments: str = "past-reference"
    regressors: Regressors | None = None


@lru_cache
def make_open_loop_data(samples, inputs=8, seed=0):
    """White inputs of a second-order system with one output and 20 dB of white noise; the inputs are the reference."""
    rng = np.random.default_rng(seed)
    real, imaginary = 0.85 * np.cos(0.6), 0.85 * np.sin(0.6)
    A = np.array([[real, imaginary], [-imaginary, real]])
    B, C, D = rng.standard_normal((2, inputs)), rng.standard_normal((1, 2)), rng.standard_normal((1, inputs))
    u, validation_u = rng.standard_normal((samples, inputs)), rng.standard_normal((VALIDATION_SAMPLES, inputs))
    clean = simulate_response(A, B, C, D, u)
    y = clean + 0.1 * clean.std() * rng.standard_normal(clean.shape)
    validation_y = simulate_response(A, B, C, D, validation_u)
    return Data(u, y, u, 2, np.linalg.eigvals(A), validation_u, validation_y)


@lru_cache
def make_paper_data(samples, seed=1):
    """The inputs of the paper, Chebyshev terms among them, of a trial at 10 dB; for validation of one without noise."""
    options = {"delay": 0.04, "basis": "chebyshev", "degree": 5, "identification_rate": RATE, "reference": "reference"}
    trial = prepare(simulate(seed=seed, duration=samples / RATE + 2.0))
    regressors = cut_regressors(trial.regressors(**options), samples)
    clean = prepare(
        simulate(seed=seed + 1, duration=VALIDATION_SAMPLES / RATE + 2.0, snr_db=None, voluntary=0.0)
    ).regressors(**{**options, "basis": regressors.basis})
    u, y = (signals - signals.mean(axis=0) for signals in (clean.inputs, clean.torque[:, None]))
    measured = regressors.inputs, regressors.torque[:, None], regressors.reference[:, None]
    return Data(*measured, 2, None, u, y, regressors=regressors)


@lru_cache
def make_square_data(samples, channels, band, noise, seed=2):
    """As many outputs as inputs of a second-order system: white inputs, or low-pass filtered ones.

    The band is relative to half the sampling rate, and None for white inputs. The noise is white, of a size relative to
    each output.
    """
    rng = np.random.default_rng(seed)
    A = np.array([[0.6, 0.5], [-0.5, 0.6]])
    B, C, D = (rng.standard_normal(shape) for shape in ((2, channels), (channels, 2), (channels, channels)))
    signals = []
    for length in (samples, VALIDATION_SAMPLES):
        u = rng.standard_normal((length + SETTLING, channels))
        u = (signal.sosfilt(signal.butter(4, band, output="sos"), u, axis=0) if band else u)[SETTLING:]
        signals.append((u, simulate_response(A, B, C, D, u)))
    (u, clean), validation = signals
    y = clean + noise * clean.std(axis=0) * rng.standard_normal(clean.shape)
    return Data(u, y, u, 2, np.linalg.eigvals(A), *validation, "past-input-output")


def make_data(case):
    """Data set of a case."""
    if case.kind == "open loop":
        return make_open_loop_data(case.samples, case.channels)
    if case.kind == "paper":
        return make_paper_data(case.samples)
    band = BANDS.get(case.kind)
    return make_square_data(case.samples, case.channels, band, noise=1e-2 if band else 1e-9)


def cut_regressors(regressors, samples):
    """The first samples of regressors."""
    signals = {name: getattr(regressors, name)[:samples] for name in ("time", "torque", "reference")}
    return replace(
        regressors, inputs=regressors.inputs[:samples], grid=regressors.grid._replace(samples=samples), **signals
    )


def score_model(data, model):
    """VAF on the validation data [%], of the worst output, and the largest error of a pole where they are known."""
    A, B, C, D = model
    estimated = simulate_response(A, B, C, D, data.validation_u)
    if not np.isfinite(estimated).all():
        return {"vaf": np.nan, "pole_error": np.nan}
    pairs = zip(data.validation_y[TRANSIENT:].T, estimated[TRANSIENT:].T, strict=True)
    scores = {"vaf": min(vaf(y, y_estimated) for y, y_estimated in pairs)}
    if data.poles is not None:
        poles = np.linalg.eigvals(A)
        scores["pole_error"] = float(max(np.abs(poles - pole).min() for pole in data.poles))
    return scores
