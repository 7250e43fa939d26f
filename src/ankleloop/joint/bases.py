"""Bases of the static nonlinearity: a class each, with its fit to a velocity, its functions and their names."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Annotated, ClassVar, Self

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.model_fields import Stored, read_fields
from ankleloop.trials.group_files import Fields

QUANTILES = np.linspace(0.005, 0.995, 200)
QUANTILE_SAMPLES = 5000  # of a velocity, at least, from which its quantiles are taken


@dataclass(frozen=True, eq=False)
class Basis:
    """Basis functions with fixed scale or knots, which serve any other record as well.

    A basis is a class below this one, which says what differs from here, and is listed in `BASES`: options and files
    know it by its `kind`.
    """

    degree: Annotated[int, Stored()]  # number of functions
    # Largest velocity magnitude of the record that was fitted.
    scale: Annotated[float, Stored(name="basis_scale", unit="rad/s")]
    # Knots of a spline; other bases have none.
    knots: Annotated[np.ndarray, Stored("knot", name="basis_knots", unit="rad/s")]
    # Velocities of the record that are equally frequent [rad/s]; files do not have them.
    quantiles: np.ndarray = field(default_factory=lambda: np.empty(0))

    kind: ClassVar[str]  # name in options and in files
    least_degree: ClassVar[int] = 1
    has_threshold: ClassVar[bool] = (
        True  # whether the curve may be a ramp from another velocity than zero on
    )
    extrapolates: ClassVar[bool] = (
        False  # whether it holds for velocities beyond those that were fitted
    )
    caution: ClassVar[str | None] = None  # what an estimate takes for granted through this basis

    @classmethod
    def fit(cls, velocity: np.ndarray, degree: int) -> Self:
        """Fit scale and knots to a velocity.

        Shapes: velocity (N,).
        """
        scale = float(np.max(np.abs(velocity)))
        knots = cls.place_knots(velocity, degree)
        # Faster than so many partitions.
        ordered = np.sort(velocity[:: max(1, velocity.size // QUANTILE_SAMPLES)])
        places = QUANTILES * (ordered.size - 1)
        quantiles = np.interp(places, np.arange(ordered.size), ordered)
        return cls(cls.count_terms(degree), scale, knots, quantiles)

    @classmethod
    def count_terms(cls, degree: int) -> int:
        """Number of functions that a basis of this degree has."""
        return degree

    @classmethod
    def place_knots(cls, velocity: np.ndarray, degree: int) -> np.ndarray:
        """Knots for a velocity; none.

        Shapes: velocity (N,); returns (knots,).
        """
        return np.empty(0)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every function."""
        return tuple(f"{self.kind}_{k}" for k in range(1, self.degree + 1))

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest velocity that it was fitted to [rad/s]."""
        return -self.scale, self.scale

    def __call__(self, velocity: np.ndarray) -> np.ndarray:
        """Evaluate every function.

        Shapes: velocity (N,); returns (k, N).
        """
        raise NotImplementedError


class ChebyshevBasis(Basis):
    """Chebyshev polynomials T₁ … T_degree of the velocity over its scale (Eq. 10)."""

    kind = "chebyshev"
    caution = "the reflex is a polynomial of the velocity: of a rectified one, five terms make G 13 to 21 % too large."

    def __call__(self, velocity: np.ndarray) -> np.ndarray:
        """Evaluate every polynomial."""
        polynomials = np.polynomial.chebyshev.chebvander(velocity / self.scale, self.degree).T
        # The constant would repeat one row through the whole Hankel matrix: offsets are removed as means instead.
        return polynomials[1:]


class RectifierBasis(Basis):
    """The half-wave rectified velocity: one function, whatever the degree."""

    kind = "rectifier"
    names = ("rectified_velocity",)
    has_threshold = False
    extrapolates = True

    @classmethod
    def count_terms(cls, degree: int) -> int:
        """One."""
        return 1

    def __call__(self, velocity: np.ndarray) -> np.ndarray:
        """Evaluate the rectifier."""
        return np.maximum(velocity, 0.0)[None, :]


class SplineBasis(Basis):
    """Cubic B-splines with knots at quantiles of the velocity; constant beyond them."""

    kind = "spline"
    least_degree = 4

    @classmethod
    def place_knots(cls, velocity: np.ndarray, degree: int) -> np.ndarray:
        """Knots at quantiles, those of the ends four times."""
        inner = np.quantile(velocity, np.linspace(0, 1, degree - 1))
        if np.any(np.diff(inner) <= 0):
            raise DataError(
                "the velocity dwells on too few values for a spline basis: use fewer terms or a rectifier."
            )
        return np.pad(inner, 3, mode="edge")

    @property
    def limits(self) -> tuple[float, float]:
        """First and last knot [rad/s]."""
        return self.knots[0], self.knots[-1]

    def __call__(self, velocity: np.ndarray) -> np.ndarray:
        """Evaluate every spline."""
        # Here, because its import takes time and the other bases do not need it.
        from scipy.interpolate import BSpline

        clipped = np.clip(velocity, *self.limits)
        splines = BSpline.design_matrix(clipped, self.knots, 3).toarray().T
        # B-splines sum to one, and means are removed: one of them would be redundant.
        return splines[1:]


class FrictionBasis(Basis):
    """The sign of the velocity, as Coulomb friction has it: one function, of an apparatus and not of a reflex."""

    kind = "friction"
    names = ("direction",)
    has_threshold = False
    extrapolates = True

    def __call__(self, velocity: np.ndarray) -> np.ndarray:
        """Evaluate the sign."""
        return np.sign(velocity)[None, :]


FRICTION = FrictionBasis(degree=1, scale=1.0, knots=np.empty(0))
# Those of a reflex, which options know.
BASES: dict[str, type[Basis]] = {
    basis.kind: basis for basis in (ChebyshevBasis, RectifierBasis, SplineBasis)
}
STORED_BASES = {**BASES, FRICTION.kind: FrictionBasis}


def read_basis(fields: Fields) -> Basis:
    """The basis whose `kind` and fields a file holds."""
    kind = fields.text("basis")
    if kind not in STORED_BASES:
        raise DataError(
            f"{fields.source}: the basis {kind!r} is unknown to ankleloop {version('ankleloop')}: install the newest "
            "one, or identify again."
        )
    return read_fields(STORED_BASES[kind], fields)
