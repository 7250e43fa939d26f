"""Motion of the joint: as it was measured, and as slow movement and reference predict it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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


def join_positions(trials: Sequence[PreparedTrial], grids: Sequence[Grid]) -> np.ndarray:
    """Positions of trials, one after the other; of several, each less its mean."""
    positions = [trial.motion(grid)[0] for trial, grid in zip(trials, grids, strict=True)]
    if len(positions) == 1:
        return positions[0]
    return np.concatenate([position - position.mean() for position in positions])


def measure_motion(
    trials: Sequence[PreparedTrial], grids: Sequence[Grid], position: np.ndarray
) -> Motion:
    """The measured motion of trials.

    Shapes: position (N,): less its slow part.
    """
    pairs = list(zip(trials, grids, strict=True))
    motions = [trial.motion(grid) for trial, grid in pairs]

    def rectify(delay: float) -> np.ndarray:
        """It is rectified at the recording rate."""
        parts = [decimate(np.maximum(0.0, part.velocity(delay)), *grid) for part, grid in pairs]
        return np.concatenate(parts)

    return Motion(
        position=position,
        velocity=np.concatenate([motion[1] for motion in motions]),
        acceleration=np.concatenate([motion[2] for motion in motions]),
        rectify=rectify,
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
    references = transform.split(reference)
    taps = fit_finite_response(
        transform.split(measured.position),
        references,
        rate,
        leads=REFERENCE_LEADS,
        lags=REFERENCE_LAGS,
    )
    leads = round(REFERENCE_LEADS * rate)
    perturbation = np.concatenate([apply_response(taps, part, leads) for part in references])
    velocity = transform.s * transform.spectra(slow - slow.mean() + perturbation)
    # Beyond the pass band of the decimation a derivative would only amplify.
    velocity[transform.frequency > 0.5 * (PASSBAND + 0.5) * rate] = 0.0

    def rectify(delay: float) -> np.ndarray:
        """It is rectified at the recording rate."""
        delayed = velocity * np.exp(-transform.s * delay)
        recorded = irfft(delayed, factor * transform.size) * factor
        rectified = np.maximum(0.0, recorded)
        margin = decimation_margin(factor)
        end = factor * transform.length + margin
        extended = np.concatenate([rectified[-margin:], rectified[:end]])
        return decimate(extended, factor, margin, transform.length)[transform.places]

    return Motion(
        position=perturbation,
        velocity=transform.signals(velocity),
        acceleration=transform.signals(transform.s * velocity),
        rectify=rectify,
    )
