"""The quantities of the field: name, symbol and unit of each, for labels, tables and messages."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class Quantity:
    """A quantity that estimates and tables hold."""

    name: str  # what it is called
    symbol: str  # how it is written
    unit: str  # its unit, "1" where it has none
    # Smallest and largest value that a joint can have, from a finger to a leg that stands.
    plausible: tuple[float, float] = (-inf, inf)

    @property
    def label(self) -> str:
        """Symbol with unit, for an axis or a column."""
        return f"{self.symbol} [{self.unit}]"


QUANTITIES = {
    "torque": Quantity("torque", "torque", "N·m"),
    "vaf_unseen": Quantity("net VAF, unseen half", "net VAF, unseen half", "%"),
    "vaf_net": Quantity("net VAF", "net VAF", "%"),
    "vaf_intrinsic": Quantity("intrinsic contribution", "intrinsic contribution", "%"),
    "vaf_reflex": Quantity("reflex contribution", "reflex contribution", "%"),
    "K": Quantity("intrinsic stiffness", "K", "N·m/rad", (0.0, 1e5)),
    "B": Quantity("intrinsic viscosity", "B", "N·m·s/rad", (0.0, 1e3)),
    "I": Quantity("intrinsic inertia", "I", "kg·m²", (0.0, 10.0)),
    "G": Quantity("reflex gain", "G", "N·m·s/rad", (0.0, 1e3)),
    "omega_n": Quantity("natural frequency of the reflex", "ωn", "rad/s", (1.0, 500.0)),
    "zeta": Quantity("damping of the reflex", "ζ", "1", (0.05, 10.0)),
    "pole": Quantity("third pole of the reflex", "p", "rad/s"),
    "threshold": Quantity("threshold of the reflex", "threshold", "rad/s"),
    "delay": Quantity("reflex delay", "delay", "s", (0.02, 0.07)),
}

STIFFNESS = ("K", "B", "I")  # of position, velocity and acceleration, in this order

POINT = (
    "point."  # begins the name of a column with a value of the point: a varied setting or option
)


def point_column(name: str) -> str:
    """Column of a table of trials with the values of a varied setting or option; estimates have the bare names."""
    return POINT + name
