"""What pictures of a sweep can show: scores, parameters, their errors, and shares of trials with a fault."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Literal

from ankleloop.assessment.scores import TRAJECTORY_TRUTHS
from ankleloop.methods.registry import METHODS
from ankleloop.paper.captions import label_setting
from ankleloop.paper.results import SETTINGS
from ankleloop.quantities import QUANTITIES, Quantity
from ankleloop.simulation.settings import SimulationSettings

TORQUES = ("net", "intrinsic", "reflex")
ESTIMATED = ("K", "B", "I", "G", "omega_n", "zeta", "pole", "threshold", "delay")
FAULT_SHARES = {"failures": "failed trials", "warnings": "trials with a warning"}
DIAGNOSTICS = {
    "order": Quantity("order of the model", "order", "1"),
    "passes": Quantity("passes of the parallel cascade", "passes", "1"),
    "spectral_radius": Quantity("largest magnitude of the poles", "spectral radius", "1"),
    "pole_error": Quantity("largest error of a pole", "pole error", "1"),
    "in_band_snr_db": Quantity("signal-to-noise ratio in the band", "in-band SNR", "dB"),
    "unseen_instrumental": Quantity("instrumental VAF of unseen data", "instrumental VAF, unseen", "%"),
    "unseen_cross_validation": Quantity("net VAF of unseen data", "net VAF, unseen", "%"),
    "cycles": Quantity("whole cycles that were identified", "cycles", "1"),
    "variation_p": Quantity("probability of as large a variation in a constant joint", "p of the variation", "1"),
}
TRAJECTORY_SCORES = {
    "nrmse": ("rms error of the trajectory of {} over the mean of the truth", "error of {}(·)", "%"),
    "bias": ("mean error of the trajectory of {} over the mean of the truth", "bias of {}(·)", "%"),
    "covered": ("places at which the 95 % band of {} holds the truth", "covered by the band of {}(·)", "%"),
    "rise": ("time from 10 to 90 % of a step of {}", "rise time of {}(·)", "s"),
}
SWEEP_QUANTITIES = {
    **{
        f"vaf_{torque}_{against}": Quantity(f"{torque} VAF, {against} torque", f"{torque} VAF, {against}", "%")
        for torque in TORQUES
        for against in ("true", "measured")
    },
    **{name: QUANTITIES[name] for name in ESTIMATED},
    **{
        f"{name}_error": Quantity(f"relative error of {QUANTITIES[name].symbol}", f"error of {symbol}", "%")
        for name, symbol in ((name, QUANTITIES[name].symbol) for name in SETTINGS)
    },
    **DIAGNOSTICS,
    **{
        f"{name}_{score}": Quantity(words.format(name), symbol.format(name), unit)
        for score, (words, symbol, unit) in TRAJECTORY_SCORES.items()
        for name in TRAJECTORY_TRUTHS
    },
    **{name: Quantity(label, label, "%") for name, label in FAULT_SHARES.items()},
}


def default_quantities(columns: Collection[str]) -> list[str]:
    """Quantities that are shown where the configuration names none: against the true torques where there are any."""
    scores = [[f"vaf_{torque}_{against}" for against in ("true", "measured")] for torque in TORQUES]
    first = [next((name for name in names if name in columns), "") for names in scores]
    return [name for name in first if name] + [f"{name}_error" for name in ("K", "G") if name in columns]


def error_source(quantity: str) -> str | None:
    """Parameter of which a quantity is the relative error; None for a quantity that is no error."""
    name = quantity.removesuffix("_error")
    return name if name != quantity and name in SETTINGS else None


def desired_value(quantity: str) -> Literal["high", "zero", "low"] | None:
    """What a method should reach: "high" for a VAF, "zero" for an error or bias, "low" for a share of faults."""
    if quantity.startswith(("vaf_", "unseen_")):
        return "high"
    if error_source(quantity) or quantity.endswith("_bias"):
        return "zero"
    return "low" if quantity == "pole_error" or quantity.endswith("_nrmse") or quantity in FAULT_SHARES else None


def label_parameter(name: str, labels: Mapping[str, str]) -> str:
    """Name and unit of a varied setting of the simulation, or option of a method."""
    if name in SimulationSettings.model_fields:
        words, unit = label_setting(name)
    else:
        method, _, field = name.rpartition(".")
        words = field.replace("_", " ") + (f" of {labels.get(method, method)}" if method else "")
        units = [entry.options.unit(field) for entry in METHODS.values() if field in entry.options.model_fields]
        unit = next(iter(units), "1")
    return f"{words} [{unit}]"
