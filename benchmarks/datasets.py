"""Data sets of the benchmarks: ordinary open-loop data, and the regressors of the paper."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ankleloop.joint.regressors import build_regressors
from ankleloop.signals.vaf import vaf
from ankleloop.simulation import simulate
from ankleloop.subspace import response

RATE = 100.0  # Hz
FRESH = 5_000  # samples of noise-free data that no program has seen


@dataclass(frozen=True)
class Data:
    """Inputs, output and reference of a data set, and fresh data without noise to judge a model by."""

    u: np.ndarray
    y: np.ndarray
    reference: np.ndarray
    order: int
    poles: np.ndarray | None
    fresh_u: np.ndarray
    fresh_y: np.ndarray
    regressors: object = None


@lru_cache
def open_loop(samples, inputs=8, seed=0):
    """White inputs of a second-order system with one output and 20 dB of white noise; the inputs are the reference."""
    rng = np.random.default_rng(seed)
    along, across = 0.85 * np.cos(0.6), 0.85 * np.sin(0.6)
    A = np.array([[along, across], [-across, along]])
    B, C, D = rng.standard_normal((2, inputs)), rng.standard_normal((1, 2)), rng.standard_normal((1, inputs))
    u, fresh = rng.standard_normal((samples, inputs)), rng.standard_normal((FRESH, inputs))
    clean = response(A, B, C, D, u)
    y = clean + 0.1 * clean.std() * rng.standard_normal(clean.shape)
    return Data(u, y, u, 2, np.linalg.eigvals(A), fresh, response(A, B, C, D, fresh))


@lru_cache
def paper(samples, seed=1):
    """The inputs of the paper for a closed-loop trial at 10 dB, Chebyshev terms among them; and one without noise."""
    options = {"delay": 0.04, "basis": "chebyshev", "degree": 5, "identification_rate": RATE, "reference": "reference"}
    regressors = _cut(build_regressors(simulate(seed=seed, duration=samples / RATE + 2.0), **options), samples)
    clean = simulate(seed=seed + 1, duration=FRESH / RATE + 2.0, snr_db=None, voluntary=0.0)
    fresh = build_regressors(clean, **{**options, "basis": regressors.basis})
    u, y = (part - part.mean(axis=0) for part in (fresh.inputs, fresh.torque[:, None]))
    return Data(regressors.inputs, regressors.torque[:, None], regressors.reference[:, None], 2, None, u, y, regressors)


def _cut(regressors, samples):
    parts = {name: getattr(regressors, name)[:samples] for name in ("time", "inputs", "torque", "reference")}
    return replace(regressors, **parts)


def accuracy(data, model):
    """VAF on the fresh data [%], and the largest error of a pole where the truth is a linear system."""
    A, B, C, D = model
    estimated = response(A, B, C, D, data.fresh_u)
    start = 200  # past the transient of a start from rest
    if not np.isfinite(estimated).all():
        return {"vaf": np.nan, "pole_error": np.nan}
    found = {"vaf": vaf(data.fresh_y[start:, 0], estimated[start:, 0])}
    if data.poles is not None:
        poles = np.linalg.eigvals(A)
        found["pole_error"] = float(max(np.abs(poles - pole).min() for pole in data.poles))
    return found
