"""Noise of a position, which its velocity raises: hum, and what a converter adds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ankleloop.signals.decimation import convolve, design_lowpass, differentiate
from ankleloop.signals.spectra import coherence, mean_power, segment_spectra

NOISE_BAND = 45.0  # Hz: from here on
NOISE_SHARE = 0.05  # of the velocity's power: measured, at most 0.02 in good records (100 of them)
NOISE_SEGMENT = 0.5  # s
NOISE_SEGMENTS = 30  # about: so many of them show the noise of a long record
FEWEST_SEGMENTS = 10
PASSBAND, STOPBAND = 34.0, 48.0  # Hz, of the filter that leaves out noise: hum has 50 or 60 Hz


class VelocityNoise(NamedTuple):
    """Power of a velocity that the torque does not share, above 45 Hz."""

    share: float  # of the power of the velocity
    share_above: float  # of the power of the velocity above 45 Hz

    @property
    def dominates(self) -> bool:
        """Whether the velocity above 45 Hz is noise, which can be left out."""
        return self.share > NOISE_SHARE and self.share_above > 0.5


def measure_velocity_noise(
    position: np.ndarray, torque: np.ndarray, rate: float
) -> VelocityNoise | None:
    """Noise of a velocity; None of a record that is too short, or has too low a rate.

    A movement of any frequency comes with the torque of the inertia; hum and noise of the position do not.

    Shapes: position, torque (N,).
    """
    length = round(NOISE_SEGMENT * rate)
    if position.size < FEWEST_SEGMENTS * length or rate < 2.5 * NOISE_BAND:
        return None
    velocity = differentiate(position, rate)
    step = max(length // 2, position.size // NOISE_SEGMENTS)
    spectra = segment_spectra([velocity], length, step)
    power = mean_power(spectra)
    noise = power * (1.0 - coherence(spectra, segment_spectra([torque], length, step)))
    above = np.arange(power.size) * rate / length > NOISE_BAND
    noise_above = np.sum(noise[above])
    return VelocityNoise(
        share=float(noise_above / np.sum(power)),
        share_above=float(noise_above / np.sum(power[above])),
    )


def describe_noise(noise: VelocityNoise) -> str:
    """What noise there is."""
    return (
        f"{100 * noise.share:.2g} % of the power of the velocity lie above {NOISE_BAND:g} Hz and have nothing to do "
        "with the torque: noise or hum of the position"
    )


def remove_noise(position: np.ndarray, rate: float) -> np.ndarray:
    """A position without what lies above 48 Hz, without delay, shape (N,)."""
    taps, half = design_lowpass(rate, PASSBAND, STOPBAND)
    padded = np.pad(position, half, mode="reflect", reflect_type="odd")
    return convolve(padded, taps)[2 * half : 2 * half + position.size]
