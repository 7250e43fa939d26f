"""Settings and options that an explorer can change, with their ranges within the bounds of their models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

from ankleloop.methods.moesp import MoespOptions
from ankleloop.methods.registry import METHODS
from ankleloop.options import Options
from ankleloop.paper.captions import label_setting
from ankleloop.simulation.settings import SimulationSettings


@dataclass(frozen=True)
class Control:
    """A setting of the simulation, or an option of a method, that can be changed."""

    name: str  # field of its model
    label: str  # name with unit
    default: Any  # value at the start
    low: float | None = None  # smallest value of a number
    high: float | None = None  # largest value of a number
    step: float | None = None  # distance of its values; on a logarithmic scale that of their logarithms to base 10
    scale: Literal["linear", "log"] = "linear"  # scale of its range
    choices: tuple[Any, ...] = ()  # values of what is no number

    @property
    def kind(self) -> Literal["flag", "choice", "integer", "number"]:
        """What its values are."""
        if isinstance(self.default, bool):
            return "flag"
        if self.choices:
            return "choice"
        return "integer" if isinstance(self.default, int) else "number"


def _number(
    model: type[Options],
    name: str,
    low: float,
    high: float,
    step: float,
    scale: Literal["linear", "log"] = "linear",
    label: str = "",
) -> Control:
    """A number with a range in which something can be seen; it ends where the bounds of the model do."""
    limits = model.limits(name)
    low, high = max(low, limits.get("ge", low)), min(high, limits.get("le", high))
    if low <= limits.get("gt", -1.0) or high >= limits.get("lt", high + 1.0):
        raise ValueError(f"{name}: the range {low:g} to {high:g} must lie within the bounds of its model.")
    unit = model.unit(name)
    words = label or label_setting(name)[0]
    label = words if unit == "1" else f"{words} [{unit}]"
    return Control(name, label, model.defaults()[name], low, high, step, scale)


def _choice(model: type[Options], name: str, label: str) -> Control:
    """A field that has one of several values."""
    return Control(name, label, model.defaults()[name], choices=_literals(model, name))


def _literals(model: type[Options], name: str) -> tuple[Any, ...]:
    """Values that the annotation of a field lists, None first."""
    annotation = model.model_fields[name].annotation
    members = (annotation,) if get_origin(annotation) is Literal else get_args(annotation)
    values = [value for member in members if get_origin(member) is Literal for value in get_args(member)]
    return (*((None,) if type(None) in members else ()), *values)


SIMULATION_CONTROLS: tuple[Control, ...] = (
    _number(SimulationSettings, "load_stiffness", 10.0, 10_000.0, 0.05, "log"),
    _number(SimulationSettings, "load_viscosity", 0.1, 100.0, 0.05, "log"),
    _number(SimulationSettings, "load_inertia", 0.01, 10.0, 0.05, "log"),
    _number(SimulationSettings, "reflex_gain", 0.0, 40.0, 0.5),
    _number(SimulationSettings, "delay", 0.01, 0.1, 0.001, label="reflex delay"),
    _number(SimulationSettings, "snr_db", 0.0, 60.0, 1.0),
    _number(SimulationSettings, "voluntary", 0.0, 2.0, 0.05),
    _choice(SimulationSettings, "perturbation", "perturbation"),
    Control("closed_loop", "closed loop", SimulationSettings.defaults()["closed_loop"]),
)
METHOD_CONTROLS: tuple[Control, ...] = (
    _number(MoespOptions, "order", 1, 6, 1, label="order"),
    _number(MoespOptions, "block_rows", 5, 40, 1, label="block rows"),
    _choice(MoespOptions, "basis", "basis"),
    _number(MoespOptions, "delay", 0.01, 0.1, 0.001, label="delay"),
)
START = ("pr-moesp", "riv")  # methods at the start


def default_values() -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Values at the start."""
    settings = {control.name: control.default for control in SIMULATION_CONTROLS}
    options = {control.name: control.default for control in METHOD_CONTROLS}
    return settings, [{"method": name, "options": dict(options)} for name in START]


def usable_options(method: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Options that a method has."""
    return {name: value for name, value in options.items() if name in METHODS[method].options.model_fields}
