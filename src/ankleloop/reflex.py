"""Second-order dynamics of the reflex, continuous in time (Eq. 2)."""

from dataclasses import dataclass

import numpy as np

from ankleloop.discretise import held_linearly

__all__ = ["ReflexDynamics"]


@dataclass(frozen=True)
class ReflexDynamics:
    """Low-pass of unit gain, ωn² / (s² + 2ζωn s + ωn²).

    Parameters
    ----------
    omega_n : float
        Natural frequency [rad/s].
    zeta : float
        Damping [1].
    """

    omega_n: float
    zeta: float

    def response(self, s):
        """Frequency response, and its derivatives with respect to ln ωn and ln ζ.

        Parameters
        ----------
        s : ndarray of complex
            Laplace variable [rad/s].

        Returns
        -------
        tuple of ndarray
        """
        square, damped = self.omega_n**2, 2 * self.zeta * self.omega_n * s
        denominator = s**2 + damped + square
        response = square / denominator
        by_omega = 2 * response - response * (damped + 2 * square) / denominator
        by_zeta = -response * damped / denominator
        return response, by_omega, by_zeta

    def matrices(self, rate):
        """Discrete matrices A, B, C, D for an input that is linear between samples.

        Parameters
        ----------
        rate : float
            Sampling rate [Hz].

        Returns
        -------
        tuple of ndarray
        """
        A = np.array([[0.0, 1.0], [-(self.omega_n**2), -2 * self.zeta * self.omega_n]])
        B, C = np.array([[0.0], [self.omega_n**2]]), np.array([[1.0, 0.0]])
        return held_linearly(A, B, C, 1.0 / rate)
