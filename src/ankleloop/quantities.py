"""The quantities of the field: name, symbol, unit and setting of each, for labels, tables and messages."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal

Goal = Literal["high", "zero", "low"] | None


@dataclass(frozen=True)
class Quantity:
    """A quantity that estimates and tables hold."""

    name: str  # what it is called
    symbol: str  # how it is written
    unit: str  # its unit, "1" where it has none
    setting: str = ""  # of the simulation, which is its true value
    # Smallest and largest value that a joint can have, from a finger to a leg that stands.
    plausible: tuple[float, float] = (-inf, inf)
    goal: Goal = None  # what a method should reach

    @property
    def label(self) -> str:
        """Symbol with unit, for an axis or a column."""
        return f"{self.symbol} [{self.unit}]"


def _number(symbol: str, unit: str = "1", goal: Goal = None) -> Quantity:
    """A quantity that is called as it is written."""
    return Quantity(symbol, symbol, unit, goal=goal)


STIFFNESS = ("K", "B", "I")  # of position, velocity and acceleration, in this order
TRAJECTORIES = ("K", "B", "G")  # what changes with time in a joint that does
PARAMETERS = {
    "K": Quantity("intrinsic stiffness", "K", "N·m/rad", "stiffness", (0.0, 1e5)),
    "B": Quantity("intrinsic viscosity", "B", "N·m·s/rad", "viscosity", (0.0, 1e3)),
    "I": Quantity("intrinsic inertia", "I", "kg·m²", "inertia", (0.0, 10.0)),
    "G": Quantity("reflex gain", "G", "N·m·s/rad", "reflex_gain", (0.0, 1e3)),
    "omega_n": Quantity("natural frequency of the reflex", "ωn", "rad/s", "omega_n", (1.0, 500.0)),
    "zeta": Quantity("damping of the reflex", "ζ", "1", "zeta", (0.05, 10.0)),
    "pole": Quantity("third pole of the reflex", "p", "rad/s"),
    "threshold": Quantity("threshold of the reflex", "threshold", "rad/s"),
    "K_slope": Quantity("slope of the intrinsic stiffness", "dK/dt", "N·m/(rad·s)"),
    "friction": Quantity("Coulomb friction", "friction", "N·m"),
    "offset": Quantity("torque without movement", "offset", "N·m"),
    "delay": Quantity("reflex delay", "delay", "s", "delay", (0.02, 0.07)),
}
# Simulation setting that is the true value of each parameter.
SETTINGS = {name: quantity.setting for name, quantity in PARAMETERS.items() if quantity.setting}
# Scores of recordings, whose parts are contributions to the measured torque.
CONTRIBUTIONS = {
    "vaf_unseen": _number("net VAF, unseen half", "%", "high"),
    "vaf_net": _number("net VAF", "%", "high"),
    "vaf_intrinsic": _number("intrinsic contribution", "%", "high"),
    "vaf_reflex": _number("reflex contribution", "%", "high"),
}
# Scores of simulated trials, errors of their parameters in per cent of the truth, and shares of trials with a fault.
SCORES = {
    f"vaf_{torque}_{against}": _number(f"{torque} VAF, {against}", "%", "high")
    for torque in ("net", "intrinsic", "reflex")
    for against in ("measured", "true")
}
ERRORS = {
    f"{name}_error": _number(f"error of {PARAMETERS[name].symbol}", "%", "zero")
    for name in SETTINGS
}
DIAGNOSTICS = {
    "order": _number("order"),
    "passes": _number("passes"),
    "spectral_radius": _number("spectral radius"),
    "pole_error": _number("pole error", goal="low"),
    "in_band_snr_db": _number("in-band SNR", "dB"),
    "unseen_instrumental": _number("instrumental VAF, unseen", "%", "high"),
    "unseen_cross_validation": _number("net VAF, unseen", "%", "high"),
    "cycles": _number("cycles"),
    "variation_p": _number("p of the variation"),
}
# Of a trajectory: what its score is called, its unit, and its goal.
_TRAJECTORY: dict[str, tuple[str, str, Goal]] = {
    "nrmse": ("error of", "%", "low"),
    "bias": ("bias of", "%", "zero"),
    "covered": ("covered by the band of", "%", None),
}
TRAJECTORY_SCORES = {
    f"{name}_{score}": _number(f"{words} {name}(·)", unit, goal)
    for score, (words, unit, goal) in _TRAJECTORY.items()
    for name in TRAJECTORIES
}
FAULTS = {
    "failures": _number("failed trials", "%", "low"),
    "warnings": _number("trials with a warning", "%", "low"),
}
# What tables and pictures over the trials of a study can show.
TRIAL_QUANTITIES = SCORES | PARAMETERS | ERRORS | DIAGNOSTICS | TRAJECTORY_SCORES | FAULTS
QUANTITIES = {
    "torque": Quantity("torque", "torque", "N·m"),
    "mean_torque": _number("mean torque", "N·m"),
    "mean_position": _number("mean position", "rad"),
    **CONTRIBUTIONS,
    **PARAMETERS,
    **TRIAL_QUANTITIES,
}

POINT = (
    "point."  # begins the name of a column with a value of the point: a varied setting or option
)


def point_column(name: str) -> str:
    """Column of a table of trials with the values of a varied setting or option; estimates have the bare names."""
    return POINT + name
