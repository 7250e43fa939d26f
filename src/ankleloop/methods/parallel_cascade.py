"""The parallel-cascade method: two impulse responses, estimated in turn (Kearney, Stein and Parameswaran 1997)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import DriveSpectra, separate_path
from ankleloop.joint.models import ModelInputs, ResponseModel
from ankleloop.joint.prepared import PreparedTrial, once
from ankleloop.joint.regressors import Regressors
from ankleloop.methods.method import (
    KnownDelayOptions,
    Method,
    Offer,
    RectifierOptions,
    Validity,
)
from ankleloop.options import option
from ankleloop.signals.responses import lag_matrix
from ankleloop.subspace.input_matrices import update_factor

PASS_CEILING = 10_000  # beyond any loop that converges at all
RANK_TOLERANCE = (
    1e-6  # of the largest singular value of the lagged inputs: smaller ones count as zero
)


class ParallelCascadeOptions(KnownDelayOptions, RectifierOptions):
    """Options of the parallel cascade."""

    max_passes: int | None = option(
        None,
        "most passes; 1 is the method as published, null runs to convergence",
        ge=1,
        le=PASS_CEILING,
    )
    tolerance: float = option(
        0.001,
        "converged when a pass adds less than this to the net VAF",
        unit="points of VAF",
        ge=0,
        le=100,
    )
    intrinsic_lags: float = option(
        0.04, "half length of the two-sided intrinsic impulse response", unit="s", ge=0, le=1
    )
    reflex_lags: float = option(
        0.5, "length of the reflex impulse response", unit="s", ge=0.001, le=5
    )


@once
def _compress(
    trial: PreparedTrial, regressors: Regressors, leads: int, longest: int
) -> list[np.ndarray]:
    """Lagged inputs of both paths, and the torque, in as few rows as they have columns: with the same inner products.

    Shapes: returns (columns, lags) of either path, (columns, 1).
    """
    first = max(leads, longest)
    position = lag_matrix(regressors.inputs[first - leads :, 0], leads, leads)
    rows, position_lags = position.shape
    drive = lag_matrix(regressors.inputs[first - longest :, -1], 0, longest)[:rows]
    torque = regressors.torque[first : first + rows]
    signals = np.vstack([position.T, drive.T, torque])
    signals -= signals.mean(axis=1, keepdims=True)
    nothing = np.zeros((len(signals), len(signals)), order="F")
    triangle = update_factor(nothing, signals.T)
    return np.split(triangle, [position_lags, len(signals) - 1], axis=1)


def identify_parallel_cascade(trial: PreparedTrial, options: ParallelCascadeOptions) -> Estimate:
    r"""Separate intrinsic and reflex torque by the parallel-cascade method.

    The intrinsic path is a two-sided impulse response of the position (± `intrinsic_lags`), the reflex path a
    one-sided impulse response of the delayed, rectified velocity (0 … `reflex_lags`). Each pass fits the intrinsic
    path to the torque less that of the reflex path, then the reflex path to the torque less that of the intrinsic
    path: alternating least squares. It is a correlation method, so torque that is fed back biases it.

    Parameters
    ----------
    trial : PreparedTrial
    options : ParallelCascadeOptions

    Returns
    -------
    Estimate
        `model` is None; `predictor` holds the impulse responses, `intrinsic` and `reflex`, and their `lags()`, and
        `diagnostics` the history of passes. K, B and I are those of the second-order model that explains the intrinsic
        torque best; G, ωn and ζ those of the low-pass that is closest to the reflex response.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> trial = simulate(seed=1, duration=20.0, snr_db=None, voluntary=0.0, reflex_gain=2.0)
    >>> estimate = identify(trial, "parallel-cascade")
    >>> bool(estimate.diagnostics["converged"]), bool(abs(estimate.stiffness["K"] - 150) < 2)
    (True, True)
    """
    regressors = trial.regressors(
        delay=options.delay,
        basis="rectifier",
        identification_rate=options.identification_rate,
    )
    rate = regressors.rate
    leads = round(options.intrinsic_lags * rate)
    longest = round(options.reflex_lags * rate)
    # Samples that have all lags.
    rows = np.arange(max(leads, longest), regressors.torque.size - leads)
    unknowns = 2 * leads + longest + 2
    if rows.size < 2 * unknowns:
        raise DataError(
            f"the record leaves {rows.size} samples for {unknowns} unknowns: record longer or shorten the lags."
        )

    *lagged, target = _compress(trial, regressors, leads, longest)
    torques, history, converged = _alternate(lagged, target[:, 0], options)
    pairs = zip(lagged, torques, strict=True)
    intrinsic, reflex = (np.linalg.lstsq(*pair, rcond=RANK_TOLERANCE)[0] for pair in pairs)
    model = ResponseModel(ModelInputs.of(regressors), intrinsic, reflex)
    torque = model.simulate(trial, regressors)
    spectra = DriveSpectra.of(regressors.inputs[rows, -1:], rate)
    response = np.polyval(reflex[::-1], np.exp(-spectra.s / rate))
    path = separate_path(response[:, None], spectra, regressors.basis)
    warnings = []
    if not converged and options.max_passes is None:
        warnings = [f"no convergence within {PASS_CEILING} passes"]
    return Estimate(
        method="parallel-cascade",
        torque=torque,
        stiffness=regressors.fit_stiffness(torque["intrinsic"].values, rows),
        reflex={"delay": options.delay, **path.valid_parameters},
        diagnostics={
            "passes": len(history),
            "converged": converged,
            "history": history,
            **path.diagnostics,
            "warnings": warnings,
        },
        predictor=model,
    )


def _alternate(
    lagged: Sequence[np.ndarray], target: np.ndarray, options: ParallelCascadeOptions
) -> tuple[list[np.ndarray], list[float], bool]:
    """Torques of both paths by alternating least squares; the history holds the net VAF after each pass."""
    intrinsic_directions, reflex_directions = (linalg.orth(part, RANK_TOLERANCE) for part in lagged)
    reflex = np.zeros_like(target)
    history: list[float] = []
    for _ in range(options.max_passes or PASS_CEILING):
        intrinsic = intrinsic_directions @ (intrinsic_directions.T @ (target - reflex))
        reflex = reflex_directions @ (reflex_directions.T @ (target - intrinsic))
        residual = target - intrinsic - reflex
        history.append(float(100 * (1 - residual @ residual / (target @ target))))
        if len(history) > 1 and history[-1] - history[-2] < options.tolerance:
            return [intrinsic, reflex], history, True
    return [intrinsic, reflex], history, False


METHODS = (
    Method(
        "parallel-cascade",
        ParallelCascadeOptions,
        identify_parallel_cascade,
        validity=Validity(one_pass={"max_passes": 1}),
        offer=Offer("Parallel cascade, to convergence"),
    ),
)
