"""Data sets of the benchmarks: open-loop data with white inputs, and the regressors of the paper."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import Regressors
from ankleloop.signals.vaf import vaf
from ankleloop.simulation.simulate import simulate
from ankleloop.subspace import simulate_response

RATE = 100.0  # Hz
VALIDATION_SAMPLES = 5_000
TRANSIENT = 200  # samples after a start from rest, which are not scored


@dataclass(frozen=True)
class Data:
    """Inputs, output and reference of a data set, and validation data without noise.

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
    return Data(regressors.inputs, regressors.torque[:, None], regressors.reference[:, None], 2, None, u, y, regressors)


def make_data(kind, samples, inputs=8):
    """Data set of a kind, "open loop" or "paper"."""
    return make_open_loop_data(samples, inputs) if kind == "open loop" else make_paper_data(samples)


def cut_regressors(regressors, samples):
    """The first samples of regressors."""
    signals = {name: getattr(regressors, name)[:samples] for name in ("time", "torque", "reference")}
    joint_inputs = replace(regressors.joint_inputs, values=regressors.inputs[:samples])
    return replace(regressors, joint_inputs=joint_inputs, grid=regressors.grid._replace(samples=samples), **signals)


def score_model(data, model):
    """VAF on the validation data [%], and the largest error of a pole where the poles are known."""
    A, B, C, D = model
    estimated = simulate_response(A, B, C, D, data.validation_u)
    if not np.isfinite(estimated).all():
        return {"vaf": np.nan, "pole_error": np.nan}
    scores = {"vaf": vaf(data.validation_y[TRANSIENT:, 0], estimated[TRANSIENT:, 0])}
    if data.poles is not None:
        poles = np.linalg.eigvals(A)
        scores["pole_error"] = float(max(np.abs(poles - pole).min() for pole in data.poles))
    return scores
