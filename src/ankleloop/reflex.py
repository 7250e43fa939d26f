"""Dynamics of the reflex, continuous in time (Eq. 2)."""

from dataclasses import astuple, dataclass

import numpy as np

from ankleloop.discretise import held_linearly

__all__ = ["ReflexDynamics", "fit_dynamics"]

STARTS = [(omega, zeta) for omega in (10.0, 15.0, 22.0, 33.0, 50.0, 75.0) for zeta in (0.5, 1.0)]
POLES = (15.0, 40.0, 120.0)  # rad/s
ITERATIONS, CONVERGED = 100, 1e-6
FURTHEST = 1e4  # rad/s, or 1: no reflex is as fast, or as damped


@dataclass(frozen=True)
class ReflexDynamics:
    """Low-pass of unit gain, ωn² / (s² + 2ζωn s + ωn²), and p / (s + p) after it where there is a third pole.

    Parameters
    ----------
    omega_n : float
        Natural frequency [rad/s].
    zeta : float
        Damping [1].
    pole : float, optional
        Third pole p [rad/s].
    """

    omega_n: float
    zeta: float
    pole: float | None = None

    @property
    def values(self):
        """Parameters by name."""
        given = dict(zip(("omega_n", "zeta", "pole"), astuple(self), strict=True))
        return {name: value for name, value in given.items() if value is not None}

    @classmethod
    def grid(cls, order):
        """Dynamics to start a search from.

        Parameters
        ----------
        order : {2, 3}
            Number of poles.

        Returns
        -------
        list of ReflexDynamics
        """
        poles = [None] if order == 2 else POLES
        return [cls(omega, zeta, pole) for pole in poles for omega, zeta in STARTS]

    def within(self, limit):
        """Whether all parameters are between a limit and its inverse."""
        values = np.array(list(self.values.values()))
        return bool(np.all((values < limit) & (values > 1.0 / limit)))

    def moved(self, step):
        """Dynamics after a step of the logarithms of its parameters."""
        return ReflexDynamics(*(np.array(list(self.values.values())) * np.exp(step)).tolist())

    def shape(self, s):
        """Frequency response.

        Parameters
        ----------
        s : ndarray of complex
            Laplace variable [rad/s].

        Returns
        -------
        ndarray
        """
        response = self.omega_n**2 / (s * (s + 2 * self.zeta * self.omega_n) + self.omega_n**2)
        return response if self.pole is None else response * self.pole / (s + self.pole)

    def response(self, s):
        """Frequency response, and its derivatives with respect to the logarithm of each parameter.

        Parameters
        ----------
        s : ndarray of complex
            Laplace variable [rad/s].

        Returns
        -------
        response : ndarray
        derivatives : list of ndarray
        """
        square, damped = self.omega_n**2, 2 * self.zeta * self.omega_n * s
        denominator = s**2 + damped + square
        response = self.shape(s)
        relative = [2 - (damped + 2 * square) / denominator, -damped / denominator]
        if self.pole is not None:
            relative.append(s / (s + self.pole))
        return response, [response * part for part in relative]

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
        denominator = np.array([1.0, 2 * self.zeta * self.omega_n, self.omega_n**2])
        if self.pole is not None:
            denominator = np.convolve(denominator, [1.0, self.pole])
        n = denominator.size - 1
        A = np.diag(np.ones(n - 1), 1)
        A[-1] = -denominator[:0:-1]
        B, C = np.zeros((n, 1)), np.zeros((1, n))
        B[-1], C[0, 0] = denominator[-1], 1.0
        return held_linearly(A, B, C, 1.0 / rate)


def fit_dynamics(response, s, weight, order=2):
    r"""Low-pass that comes closest to a frequency response, and its gain.

    .. math:: \min_{G, \omega_n, \zeta, (p)} \sum_f w(f) \, |H(f) - G \, H_0(f; \omega_n, \zeta, p)|^2

    Parameters
    ----------
    response : ndarray of complex, shape (F,)
        Frequency response.
    s : ndarray of complex, shape (F,)
        Laplace variable [rad/s].
    weight : ndarray, shape (F,)
        Weights, the spectrum of the input: then it is the torque that the low-pass comes close to.
    order : {2, 3}
        Number of poles.

    Returns
    -------
    gain : float
    dynamics : ReflexDynamics
    share : float
        Share of the weighted response that the low-pass explains.

    Examples
    --------
    >>> s = 2j * np.pi * np.linspace(0.1, 30, 200)
    >>> gain, dynamics, share = fit_dynamics(5.0 * ReflexDynamics(40.0, 0.9).response(s)[0], s, np.ones(200))
    >>> round(gain, 6), round(dynamics.omega_n, 6), round(dynamics.zeta, 6), round(share, 6)
    (5.0, 40.0, 0.9, 1.0)
    """
    root = np.sqrt(weight / np.sum(weight * np.abs(response) ** 2))
    target = root * response
    found = _Fit(_nearest(ReflexDynamics.grid(order), s, root, target), s, root, target)
    damping, bend = 1e-6, np.zeros((order, order))
    for _ in range(ITERATIONS):
        step = found.step(damping, bend)
        tried = _Fit(found.dynamics.moved(np.clip(step, -1.0, 1.0)), s, root, target)
        if tried.left <= found.left and tried.dynamics.within(FURTHEST):
            bend = _bent(bend, found, tried, step)
            found, damping = tried, max(damping / 10, 1e-12)
        else:
            damping, bend = 10 * damping, np.zeros_like(bend)
        if np.max(np.abs(step)) < CONVERGED or damping > 1e9:
            break
    return found.gain, found.dynamics, 1.0 - found.left


def _nearest(grid, s, root, target):
    """The dynamics of a grid that explain most with the gain that suits them."""
    shapes = _real(root * np.array([dynamics.shape(s) for dynamics in grid]))
    return grid[int(np.argmax((shapes @ _real(target)) ** 2 / np.sum(shapes**2, axis=1)))]


class _Fit:
    """Dynamics with the gain that suits them best: the gain is projected out of the search (Golub and Pereyra 1973)."""

    def __init__(self, dynamics, s, root, target):
        self.dynamics = dynamics
        shape, derivatives = dynamics.response(s)
        self._shape, self._slopes = _real(root * shape), _real(root * np.array(derivatives))
        self.gain = float(self._shape @ _real(target) / (self._shape @ self._shape))
        self._miss = _real(target) - self.gain * self._shape
        self.left = float(self._miss @ self._miss)

        along = self._slopes @ self._shape / (self._shape @ self._shape)
        aside = self._slopes @ self._miss / (self._shape @ self._shape)
        self._slopes = self.gain * (self._slopes - along[:, None] * self._shape) + aside[:, None] * self._shape
        self.normal, self.downhill = self._slopes @ self._slopes.T, self._slopes @ self._miss

    def step(self, damping, bend):
        """Step of the logarithms of the parameters (Levenberg and Marquardt), with what is known of the curvature."""
        scale = damping * np.diag(np.diag(self.normal) + 1e-30)
        if np.linalg.eigvalsh(self.normal + bend)[0] <= 0:
            bend = 0.0
        return np.linalg.solve(self.normal + bend + scale, self.downhill)


def _bent(bend, before, after, step):
    """Curvature that the slopes leave out, by a symmetric secant update: what a poor fit converges by."""
    missing = before.downhill - after.downhill - (after.normal + bend) @ step
    size = missing @ step
    if abs(size) <= 1e-8 * np.linalg.norm(missing) * np.linalg.norm(step):
        return bend
    return bend + np.outer(missing, missing) / size


def _real(values):
    return np.concatenate([values.real, values.imag], axis=-1)
