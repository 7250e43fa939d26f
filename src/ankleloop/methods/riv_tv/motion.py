"""Motion of the joint: as it was measured, and as slow movement and reference predict it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft

from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import Grid
from ankleloop.methods.riv_tv.whitening import PaddedTransform
from ankleloop.signals.decimation import PASSBAND, decimate, decimation_margin
from ankleloop.signals.responses import apply_response, fit_finite_response

REFERENCE_LEADS = 0.15  # s
REFERENCE_LAGS = 0.60  # s


@dataclass(frozen=True, eq=False)
class Motion:
    """Position, velocity and acceleration at the decimated samples, and the input of the reflex."""

    position: np.ndarray  # shape (N,): less what repeats or changes slowly
    velocity: np.ndarray
    acceleration: np.ndarray
    rectify: Callable[[float], np.ndarray]  # rectified velocity, shape (N,), by its delay [s]


def measure_motion(trial: PreparedTrial, grid: Grid, slow: np.ndarray) -> Motion:
    """The measured motion of a trial.

    Shapes: slow (N,): slow part of the position.
    """
    position, velocity, acceleration = trial.motion(grid)
    return Motion(
        position=position - slow,
        velocity=velocity,
        acceleration=acceleration,
        rectify=lambda delay: decimate(np.maximum(0.0, trial.velocity(delay)), *grid),
    )


def predict_motion(
    measured: Motion,
    slow: np.ndarray,
    reference: np.ndarray,
    transform: PaddedTransform,
    factor: int,
) -> Motion:
    """The motion that slow movement and reference explain.

    Shapes: slow (N,): slow part of the position; reference (N,): less its own.
    """
    rate = transform.rate
    taps = fit_finite_response(
        measured.position, reference, rate, leads=REFERENCE_LEADS, lags=REFERENCE_LAGS
    )
    perturbation = apply_response(taps, reference, leads=round(REFERENCE_LEADS * rate))
    velocity = transform.s * transform.spectra(slow - slow.mean() + perturbation)
    # Beyond the pass band of the decimation a derivative would only amplify.
    velocity[transform.frequency > 0.5 * (PASSBAND + 0.5) * rate] = 0.0

    def rectify(delay: float) -> np.ndarray:
        """It is rectified at the recording rate."""
        delayed = velocity * np.exp(-transform.s * delay)
        recorded = irfft(delayed, factor * transform.size) * factor
        rectified = np.maximum(0.0, recorded)
        margin = decimation_margin(factor)
        end = factor * transform.samples + margin
        extended = np.concatenate([rectified[-margin:], rectified[:end]])
        return decimate(extended, factor, margin, transform.samples)

    return Motion(
        position=perturbation,
        velocity=transform.signals(velocity),
        acceleration=transform.signals(transform.s * velocity),
        rectify=rectify,
    )
