"""The reflex path as a Hammerstein system: a static nonlinearity with its basis, and linear dynamics of unit gain."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.dynamics import ReflexDynamics, fit_dynamics
from ankleloop.joint.model_fields import Stored
from ankleloop.signals.spectra import pass_band

BIN = 0.2  # Hz
CANDIDATES = 60  # thresholds on a grid
LEAST_RAMP = 0.95  # share of the curve that a ramp explains: 0.97 where G is right, 0.04 to 0.75 where it is wrong
LEAST_BEYOND = 0.1  # share of the velocities that have to exceed the threshold
LEAST_DYNAMICS = (
    0.9  # share that one linear system explains of the path, and a low-pass of that system
)
QUANTILES = np.linspace(0.005, 0.995, 200)


@dataclass(frozen=True)
class ReflexPath:
    """A static nonlinearity, torque against delayed velocity, and linear dynamics of unit gain behind it."""

    basis: Basis  # basis functions
    coefficients: np.ndarray  # shape (k,): torque per basis function
    dynamics: ReflexDynamics  # Low-pass of unit gain that is closest
    # Share of the reflex torque's variance that a single linear system explains; 1 for a Hammerstein system.
    rank_one: float = 1.0
    low_pass: float = 1.0  # share of that system's response that the low-pass explains

    def curve(self) -> dict[str, np.ndarray]:
        """Torque beyond that at rest [N·m] over the quantiles of the velocity [rad/s]."""
        velocity = self.basis.quantiles
        return {
            "velocity": velocity,
            "torque": self.coefficients @ (self.basis(velocity) - self.basis(np.zeros(1))),
        }

    @cached_property
    def rectifier(self) -> tuple[float, float, float]:
        r"""Gain and threshold of the half-wave rectifier that is closest, over the velocities of the record; its share.

        .. math:: \min_{G, v_0, c} \sum_q \left[f(v_q) - c - G \max(0, v_q - v_0)\right]^2
        """
        if self.basis.kind == "rectifier":
            return float(self.coefficients[0]), 0.0, 1.0
        velocity, torque = self.curve().values()
        deviation = torque - torque.mean()
        low, high = velocity[0], velocity[-3]
        for _ in range(3):  # ever finer grids: the criterion has kinks, and may have several minima
            grid = np.linspace(low, high, CANDIDATES)
            ramps = np.maximum(velocity - grid[:, None], 0.0)
            ramps -= ramps.mean(axis=1, keepdims=True)
            products, energies = ramps @ deviation, np.sum(ramps**2, axis=1)
            gains = products / np.where(energies > 0.0, energies, np.inf)
            explained = gains * products
            best = int(np.argmax(explained))
            low, high = grid[max(best - 1, 0)], grid[min(best + 1, CANDIDATES - 1)]
        return (
            float(gains[best]),
            float(grid[best]),
            float(explained[best] / (deviation @ deviation)),
        )

    @cached_property
    def fault(self) -> str | None:
        """Why the path is no ramp with a low-pass behind it, so that G, ωn and ζ mean nothing; None if it is one."""
        _, threshold, ramp = self.rectifier
        for share, least, text in (
            (ramp, LEAST_RAMP, "a ramp explains {:.2f} of the curve of torque over velocity"),
            (
                self.rank_one,
                LEAST_DYNAMICS,
                "one linear system explains {:.2f} of the reflex torque",
            ),
            (self.low_pass, LEAST_DYNAMICS, "a low-pass explains {:.2f} of the reflex dynamics"),
        ):
            if share < least:
                return f"{text.format(share)} ({least:g} are needed)"
        beyond = (
            1.0
            if self.basis.kind == "rectifier"
            else float(np.mean(self.basis.quantiles > threshold))
        )
        if beyond < LEAST_BEYOND:
            return f"the ramp begins at {threshold:.2g} rad/s, which only {100 * beyond:.0f} % of the record exceed"
        return None

    @property
    def parameters(self) -> dict[str, float]:
        """G [N·m·s/rad], threshold [rad/s] of a basis that can have one, ωn [rad/s], ζ, and the pole p [rad/s]."""
        gain, threshold, _ = self.rectifier
        rectifier = (
            {"G": gain} if self.basis.kind == "rectifier" else {"G": gain, "threshold": threshold}
        )
        return {**rectifier, **{name: float(value) for name, value in self.dynamics.values.items()}}

    @property
    def valid_parameters(self) -> dict[str, float]:
        """The parameters where the separation holds; none elsewhere."""
        return {} if self.fault else self.parameters

    @property
    def diagnostics(self) -> dict[str, Any]:
        """Curve of the nonlinearity, how well the separation describes the model, and what is therefore missing."""
        shares = {"ramp": self.rectifier[2], "rank_one": self.rank_one, "low_pass": self.low_pass}
        missing = {"missing": [f"G, ωn and ζ: {self.fault}."]} if self.fault else {}
        return {"nonlinearity": self.curve(), "separation": shares, **missing}


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
        band = pass_band(len(drive), rate)
        spectra = band.transform(drive.T)
        power = np.abs(spectra) ** 2
        energy = power.sum(axis=1)
        if not energy.all():
            raise DataError(
                "an input of the reflex is zero: the velocity is never positive. Check the sign of the position."
            )
        starts = np.arange(0, spectra.shape[1], max(1, round(BIN * len(drive) / rate)))
        products = np.einsum("if,jf->ijf", spectra.conj(), spectra).real
        weight = np.sum(power / energy[:, None], axis=0)
        centres = np.add.reduceat(weight * band.frequency, starts) / np.add.reduceat(weight, starts)
        deviations = drive - drive.mean(axis=0)
        covariance = deviations.T @ deviations / (len(drive) - 1)
        root = np.linalg.cholesky(covariance + 1e-10 * np.diag(np.diag(covariance)))
        return cls(
            2j * np.pi * centres, np.moveaxis(np.add.reduceat(products, starts, axis=2), 2, 0), root
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
    s, power, root = spectra
    autospectra = np.einsum("fkk->fk", power)
    weight = np.mean(autospectra / autospectra.sum(axis=0), axis=1)
    weighted = np.sqrt(weight)[:, None] * (responses @ root)
    _, values, directions = np.linalg.svd(
        np.vstack([weighted.real, weighted.imag]), full_matrices=False
    )
    if not values[0] > 0:
        raise DataError("the model has no reflex torque, so there is nothing to separate.")
    coefficients = np.linalg.solve(root.T, directions[0])
    response = responses @ (root @ directions[0])
    input_power = np.maximum(power @ coefficients @ coefficients, 0.0)
    gain, dynamics, share = fit_dynamics(response, s, input_power, order)
    rank_one = float(values[0] ** 2 / np.sum(values**2))
    return ReflexPath(basis, gain * coefficients, dynamics, rank_one, share)


@dataclass(frozen=True, eq=False)
class Basis:
    """Basis functions with fixed scale or knots, which serve any other record as well."""

    kind: Annotated[str, Stored(name="basis")]
    degree: Annotated[int, Stored()]  # number of terms
    # Largest velocity magnitude: the Chebyshev polynomials take the velocity divided by it.
    scale: Annotated[float, Stored(name="basis_scale", unit="rad/s")]
    knots: Annotated[
        np.ndarray, Stored("knot", name="basis_knots", unit="rad/s")
    ]  # knots of the cubic spline
    # Velocities of the record that are equally frequent [rad/s]; they only serve pictures.
    quantiles: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every term."""
        if self.kind == "rectifier":
            return ("rectified_velocity",)
        return tuple(f"{self.kind}_{k}" for k in range(1, self.degree + 1))

    def __call__(self, velocity: np.ndarray) -> np.ndarray:
        """Evaluate every term.

        Shapes: velocity (N,); returns (k, N).
        """
        if self.kind == "rectifier":
            return np.maximum(velocity, 0.0)[None, :]
        if self.kind == "chebyshev":
            # The constant would repeat one row through the whole Hankel matrix: offsets are removed as means instead.
            return np.polynomial.chebyshev.chebvander(velocity / self.scale, self.degree).T[1:]
        from scipy.interpolate import (
            BSpline,
        )  # here, because its import takes time and the other bases do not need it

        clipped = np.clip(velocity, self.knots[0], self.knots[-1])
        # B-splines sum to one, and means are removed: one of them would be redundant.
        return BSpline.design_matrix(clipped, self.knots, 3).toarray().T[1:]


def fit_basis(velocity: np.ndarray, kind: str, degree: int) -> Basis:
    """Fit the scale or the knots of a basis to a velocity.

    ``"chebyshev"`` is T₁ … T_degree of Eq. 10 without its constant, ``"rectifier"`` the half-wave rectified velocity
    (one term, whatever the degree), ``"spline"`` `degree` cubic B-splines with knots at quantiles.

    Shapes: velocity (N,).
    """
    scale = float(np.max(np.abs(velocity)))
    if scale == 0:
        raise DataError(
            "the velocity is zero throughout: the position channel carries no perturbation."
        )
    knots = np.empty(0)
    if kind == "spline":
        if degree < 4:
            raise ValueError(f"a cubic spline basis needs a degree of at least 4, got {degree}.")
        inner = np.quantile(velocity, np.linspace(0, 1, degree - 1))
        if np.any(np.diff(inner) <= 0):
            raise DataError(
                "the velocity dwells on too few values for a spline basis: use fewer terms or a rectifier."
            )
        knots = np.concatenate(([inner[0]] * 3, inner, [inner[-1]] * 3))
    ordered = np.sort(velocity[:: max(1, velocity.size // 5000)])  # faster than so many partitions
    quantiles = np.interp(QUANTILES * (ordered.size - 1), np.arange(ordered.size), ordered)
    return Basis(kind, 1 if kind == "rectifier" else degree, scale, knots, quantiles)
