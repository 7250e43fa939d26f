"""Basis functions of the static nonlinearity of the reflex path (Eq. 9, 10)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ankleloop.errors import DataError

BASES = ("chebyshev", "rectifier", "spline")
QUANTILES = np.linspace(0.005, 0.995, 200)


@dataclass(frozen=True)
class Basis:
    """Basis functions with fixed scale or knots, which serve any other record as well."""

    kind: str  # kind of basis
    degree: int  # number of terms
    scale: float = 1.0  # largest velocity magnitude [rad/s]; the Chebyshev polynomials take the velocity divided by it
    knots: np.ndarray = field(default_factory=lambda: np.empty(0))  # knots of the cubic spline [rad/s]
    # Velocities of the record that are equally frequent [rad/s].
    quantiles: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every term."""
        if self.kind == "rectifier":
            return ("rectified_velocity",)
        return tuple(f"{self.kind}_{k}" for k in range(1, self.degree + 1))

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every term."""
        return ("rad/s",) if self.kind == "rectifier" else ("1",) * self.degree

    def __call__(self, velocity: np.ndarray) -> np.ndarray:
        """Evaluate every term.

        Shapes: velocity (N,); returns (k, N).
        """
        return {"chebyshev": self._chebyshev, "rectifier": self._rectifier, "spline": self._spline}[self.kind](velocity)

    def _chebyshev(self, velocity: np.ndarray) -> np.ndarray:
        # The constant would repeat one row through the whole Hankel matrix: offsets are removed as means instead.
        terms = np.empty((self.degree, np.size(velocity)))
        np.divide(velocity, self.scale, out=terms[0])
        double = 2 * terms[0]
        for k in range(1, self.degree):
            np.multiply(double, terms[k - 1], out=terms[k])
            terms[k] -= terms[k - 2] if k > 1 else 1.0
        return terms

    def _rectifier(self, velocity: np.ndarray) -> np.ndarray:
        return np.maximum(velocity, 0.0)[None, :]

    def _spline(self, velocity: np.ndarray) -> np.ndarray:
        from scipy.interpolate import BSpline  # here, because its import takes time and the other bases do not need it

        clipped = np.clip(velocity, self.knots[0], self.knots[-1])
        # B-splines sum to one, and means are removed: one of them would be redundant.
        return BSpline.design_matrix(clipped, self.knots, 3).toarray().T[1:]


def fit_basis(velocity: np.ndarray, kind: str, degree: int) -> Basis:
    """Fit the scale or the knots of a basis to a velocity.

    ``"chebyshev"`` is T₁ … T_degree of Eq. 10 without its constant, ``"rectifier"`` the half-wave rectified velocity
    (one term, whatever the degree), ``"spline"`` `degree` cubic B-splines with knots at quantiles.

    Shapes: velocity (N,).
    """
    if kind not in BASES:
        raise ValueError(f"unknown basis {kind!r}; known: {', '.join(BASES)}.")
    if isinstance(degree, bool) or not (isinstance(degree, (int, np.integer)) and degree >= 1):
        raise ValueError(f"degree must be a whole number of at least 1, got {degree!r}.")
    scale = float(np.max(np.abs(velocity)))
    if scale == 0:
        raise DataError("the velocity is zero throughout: the position channel carries no perturbation.")
    knots = _quantile_knots(velocity, degree) if kind == "spline" else np.empty(0)
    ordered = np.sort(velocity[:: max(1, velocity.size // 5000)])  # faster than so many partitions
    quantiles = np.interp(QUANTILES * (ordered.size - 1), np.arange(ordered.size), ordered)
    return Basis(kind, 1 if kind == "rectifier" else int(degree), scale, knots, quantiles)


def _quantile_knots(velocity: np.ndarray, degree: int) -> np.ndarray:
    if degree < 4:
        raise ValueError(f"a cubic spline basis needs a degree of at least 4, got {degree}.")
    inner = np.quantile(velocity, np.linspace(0, 1, degree - 1))
    if np.any(np.diff(inner) <= 0):
        raise DataError("the velocity dwells on too few values for a spline basis: use fewer terms or a rectifier.")
    return np.concatenate(([inner[0]] * 3, inner, [inner[-1]] * 3))
