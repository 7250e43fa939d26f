"""Does the torque feed back on the position? A test for closed loop from a record with its reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from ankleloop.joint.reference_response import remove_response
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import segment_spectra

__all__ = ["FeedbackTest", "feedback_test"]

SEGMENT = 2.0  # s
BAND = (0.5, 20.0)  # Hz
APART = 3  # bins between which the values of a Hann window are independent
LEVEL = 0.01


@dataclass(frozen=True)
class FeedbackTest:
    """Outcome of the test.

    Parameters
    ----------
    loop : {"closed", "open"}
        The verdict.
    p_value : float
        Probability of such a coherence if the residuals of position and torque, beside their response to the reference,
        were unrelated.
    coherence : float
        Mean squared coherence of the two residuals.
    work : float
        Between −1 and 1: positive if the residual torque does work on the load, as it must on a passive load that
        gives way; negative if the residual movement does work on the joint.
    residual_share : float
        Share of the position's variance that is in its residual.
    """

    loop: str
    p_value: float
    coherence: float
    work: float
    residual_share: float


def feedback_test(position: np.ndarray, torque: np.ndarray, reference: np.ndarray, rate: float) -> FeedbackTest:
    r"""Test whether torque that the reference does not explain moves the joint.

    The response to leads and lags of the reference is removed from both signals. In open loop the residual of the
    position is not related to that of the torque, unless a servo does not follow its command: then the torque follows
    the position, and the servo does work on the joint. Against a compliant load the position gives way, e_P = −H e_T,
    and the torque does work on the load. The squared coherence of n segments, if there is none, has a known
    distribution at each frequency, whatever the spectra are:

    .. math:: -2 (n - 1) \ln(1 - C^2) \sim \chi^2_2 .

    Its sum over independent frequencies between 0.5 and 20 Hz is the statistic. The sign of the cross spectrum of
    velocity and torque, which is power, shows which of the two moves the other.

    Parameters
    ----------
    position, torque, reference : ndarray, shape (N,)
        Signals at the identification rate, decimated alike; a stretch is opposed by a positive torque.
    rate : float
        Identification rate [Hz].

    Returns
    -------
    FeedbackTest

    Raises
    ------
    DataError
        If the record is too short for the response to the reference.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> r, v = rng.standard_normal((2, 5000))
    >>> moved = np.cumsum(v - v.mean()) / 100
    >>> feedback_test(r - moved, v, r, 100.0).loop, feedback_test(r, v, r, 100.0).loop
    ('closed', 'open')
    """
    residuals = [remove_response(signal, reference, rate) for signal in (position, torque)]
    length = round(SEGMENT * rate)
    spectra = [segment_spectra(residual, length, length) for residual in residuals]
    frequency = np.fft.rfftfreq(length, 1.0 / rate)
    bins = np.flatnonzero((frequency >= BAND[0]) & (frequency <= min(BAND[1], PASSBAND * rate)))[::APART]
    P, T = (spectrum[:, bins] for spectrum in spectra)
    cross = np.sum(P * T.conj(), axis=0)
    power = np.sum(np.abs(P) ** 2, axis=0) * np.sum(np.abs(T) ** 2, axis=0)
    coherence = np.minimum(np.abs(cross) ** 2 / np.maximum(power, np.finfo(float).tiny), 1.0 - 1e-12)
    statistic = -2.0 * (len(P) - 1) * np.sum(np.log1p(-coherence))
    p_value = float(special.chdtrc(2 * bins.size, statistic))
    # Velocity leads position by a quarter of a period; its product with the torque is power.
    work_sign = np.real(1j * cross) / np.maximum(np.abs(cross), np.finfo(float).tiny)
    work = float(-np.sum(coherence * work_sign) / np.sum(coherence))
    return FeedbackTest(
        loop="closed" if p_value < LEVEL and work > 0 else "open",
        p_value=p_value,
        coherence=float(coherence.mean()),
        work=work,
        residual_share=float(np.var(residuals[0]) / np.var(position)),
    )
