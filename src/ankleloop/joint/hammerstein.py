"""The reflex path as a Hammerstein system: a static nonlinearity, and linear dynamics of unit gain behind it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.bases import Basis
from ankleloop.joint.dynamics import ReflexDynamics, fit_dynamics
from ankleloop.signals.spectra import pass_band

BIN_WIDTH = 0.2  # Hz
CANDIDATE_THRESHOLDS = 60  # of a ramp, at equal distances
# Each at smaller distances: the criterion has kinks, and may have several minima.
THRESHOLD_ROUNDS = 3
# Share of the curve that a ramp explains: 0.97 where G is right, 0.04 to 0.75 where it is wrong.
LEAST_RAMP = 0.95
LEAST_ABOVE_THRESHOLD = 0.1  # share of the velocities
# Share that one linear system explains of the path, and a low-pass of that system.
LEAST_DYNAMICS = 0.9
NO_REFLEX = "the record shows no reflex, as of a passive joint"


class Ramp(NamedTuple):
    """A half-wave rectifier with a threshold, G max(0, v - v₀)."""

    gain: float  # G
    threshold: float  # v₀ [rad/s]
    share: float  # share of a curve that it explains


@dataclass(frozen=True)
class ReflexPath:
    """A static nonlinearity, torque against delayed velocity, and linear dynamics of unit gain behind it."""

    basis: Basis  # basis functions
    coefficients: np.ndarray  # shape (k,): torque per basis function
    dynamics: ReflexDynamics  # Low-pass of unit gain that is closest
    # Share of the reflex torque's variance that a single linear system explains; 1 for a Hammerstein system.
    rank_one: float = 1.0
    low_pass: float = 1.0  # share of that system's response that the low-pass explains
    passive: bool = False  # whether the record shows no reflex

    def curve(self) -> dict[str, np.ndarray]:
        """Torque beyond that at rest [N·m] over the quantiles of the velocity [rad/s]."""
        velocity = self.basis.quantiles
        functions = self.basis(velocity) - self.basis(np.zeros(1))
        return {"velocity": velocity, "torque": self.coefficients @ functions}

    @cached_property
    def rectifier(self) -> Ramp:
        """The half-wave rectifier that is closest, over the velocities of the record."""
        if self.basis.has_threshold:
            return _fit_ramp(**self.curve())
        return Ramp(gain=float(self.coefficients[0]), threshold=0.0, share=1.0)

    @cached_property
    def fault(self) -> str | None:
        """Why the path is no ramp with a low-pass behind it, so that it has no G; None if it is one."""
        if self.passive and self.basis.has_threshold:
            return f'{NO_REFLEX}; basis="rectifier" gives G with its interval'
        ramp = self.rectifier
        shares = (
            (ramp.share, LEAST_RAMP, "a ramp explains {:.2f} of the curve of torque over velocity"),
            (
                self.rank_one,
                LEAST_DYNAMICS,
                "one linear system explains {:.2f} of the reflex torque",
            ),
            (self.low_pass, LEAST_DYNAMICS, "a low-pass explains {:.2f} of the reflex dynamics"),
        )
        for share, least, text in shares:
            if share < least:
                return f"{text.format(share)} ({least:g} are needed)"
        if not self.basis.has_threshold:
            return None
        above = np.mean(self.basis.quantiles > ramp.threshold)
        if above < LEAST_ABOVE_THRESHOLD:
            return f"the ramp begins at {ramp.threshold:.2g} rad/s, which only {100 * above:.0f} % of the record exceed"
        return None

    @property
    def parameters(self) -> dict[str, float]:
        """G [N·m·s/rad], threshold [rad/s] of a basis that can have one, ωn [rad/s], ζ, and the pole p [rad/s]."""
        parameters = {"G": self.rectifier.gain}
        if self.basis.has_threshold:
            parameters["threshold"] = self.rectifier.threshold
        return parameters | self.dynamics.values

    @property
    def valid_parameters(self) -> dict[str, float]:
        """The parameters where the separation holds; none elsewhere."""
        return {} if self.fault else self.parameters

    @property
    def diagnostics(self) -> dict[str, Any]:
        """Curve of the nonlinearity, how well the separation describes the model, and what is therefore missing."""
        separation = {
            "ramp": self.rectifier.share,
            "rank_one": self.rank_one,
            "low_pass": self.low_pass,
        }
        diagnostics = {"nonlinearity": self.curve(), "separation": separation}
        if self.fault:
            diagnostics["missing"] = [f"G, ωn and ζ: {self.fault}."]
        return diagnostics


def _fit_ramp(velocity: np.ndarray, torque: np.ndarray) -> Ramp:
    r"""The ramp that is closest to a curve of torque over velocity.

    .. math:: \min_{G, v_0, c} \sum_q \left[f(v_q) - c - G \max(0, v_q - v_0)\right]^2

    Shapes: velocity, torque (q,).
    """
    deviation = torque - torque.mean()
    low = velocity[0]
    high = velocity[-3]
    for _ in range(THRESHOLD_ROUNDS):
        thresholds = np.linspace(low, high, CANDIDATE_THRESHOLDS)
        ramps = np.maximum(velocity - thresholds[:, None], 0.0)
        ramps -= ramps.mean(axis=1, keepdims=True)
        products = ramps @ deviation
        energies = np.sum(ramps**2, axis=1)
        gains = products / np.where(energies > 0.0, energies, np.inf)
        explained = gains * products
        best = int(np.argmax(explained))
        low = thresholds[max(best - 1, 0)]
        high = thresholds[min(best + 1, CANDIDATE_THRESHOLDS - 1)]
    share = explained[best] / (deviation @ deviation)
    return Ramp(float(gains[best]), float(thresholds[best]), float(share))


class DriveSpectra(NamedTuple):
    """Spectra of the inputs of the reflex path on a record."""

    # Laplace variable at the centre of each bin's power [rad/s], shape (bins,): about that centre a response that is
    # nearly linear within a bin gives what all of its frequencies give.
    s: np.ndarray
    power: np.ndarray  # shape (bins, k, k): spectral matrices, summed over bins
    # Shape (k, k): Cholesky factor of the covariance, regularised so that nearly dependent inputs stay apart.
    root: np.ndarray

    @classmethod
    def of(cls, drive: np.ndarray, rate: float) -> DriveSpectra:
        """Those of inputs at the identification rate [Hz].

        Shapes: drive (N, k).
        """
        samples = len(drive)
        band = pass_band(samples, rate)
        spectra = band.transform(drive.T)
        power = np.abs(spectra) ** 2
        energy = power.sum(axis=1)
        if not energy.all():
            raise DataError(
                "an input of the reflex is zero: the velocity is never positive. Check the sign of the position."
            )
        bin_size = max(1, round(BIN_WIDTH * samples / rate))
        starts = np.arange(0, spectra.shape[1], bin_size)
        weight = np.sum(power / energy[:, None], axis=0)
        moments = np.add.reduceat(weight * band.frequency, starts)
        centres = moments / np.add.reduceat(weight, starts)
        products = np.einsum("if,jf->ijf", spectra.conj(), spectra).real
        matrices = np.add.reduceat(products, starts, axis=2)
        deviations = drive - drive.mean(axis=0)
        covariance = deviations.T @ deviations / (samples - 1)
        ridge = 1e-10 * np.diag(np.diag(covariance))
        return cls(
            s=2j * np.pi * centres,
            power=np.moveaxis(matrices, 2, 0),
            root=np.linalg.cholesky(covariance + ridge),
        )


def separate_path(
    responses: np.ndarray, spectra: DriveSpectra, basis: Basis, order: int = 2
) -> ReflexPath:
    r"""Separate responses to the basis functions, at `spectra.s`, into a static nonlinearity and linear dynamics.

    The responses of a Hammerstein system to its basis functions are one response times a coefficient each. So the
    matrix of impulse responses, in the metric R of the inputs' covariance, is approximated by one of rank one,

    .. math:: \min_{g, c} \left\| (H - g c^T) R^{1/2} \right\|_F,

    and g by a low-pass (the two-stage idea of Bai 1998).

    Shapes: responses (bins, k).

    References
    ----------
    E.-W. Bai, "An optimal two-stage identification algorithm for Hammerstein-Wiener nonlinear systems", Automatica
    34(3), 333-338, 1998.
    """
    autospectra = np.einsum("fkk->fk", spectra.power)
    weight = np.mean(autospectra / autospectra.sum(axis=0), axis=1)
    weighted = np.sqrt(weight)[:, None] * (responses @ spectra.root)
    stacked = np.vstack([weighted.real, weighted.imag])
    _, values, directions = np.linalg.svd(stacked, full_matrices=False)
    if not values[0] > 0:
        raise DataError("the model has no reflex torque, so there is nothing to separate.")
    coefficients = np.linalg.solve(spectra.root.T, directions[0])
    response = responses @ (spectra.root @ directions[0])
    input_power = np.maximum(spectra.power @ coefficients @ coefficients, 0.0)
    gain, dynamics, low_pass = fit_dynamics(response, spectra.s, input_power, order)
    return ReflexPath(
        basis=basis,
        coefficients=gain * coefficients,
        dynamics=dynamics,
        rank_one=float(values[0] ** 2 / np.sum(values**2)),
        low_pass=low_pass,
    )
