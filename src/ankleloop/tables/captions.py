"""Words for captions: names and values of settings, settings that points share, points by their values."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ankleloop.quantities import POINT, QUANTITIES
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.tables.outcomes import true_values

NAMES = {
    "voluntary": "relative voluntary torque",
    "load_stiffness": "stiffness of the load",
    "load_inertia": "inertia of the load",
    "load_viscosity": "viscosity of the load",
    "snr_db": "signal-to-noise ratio",
    "closed_loop": "loop",
}
LOAD = ("load_inertia", "load_viscosity", "load_stiffness")
SHARED = (
    *LOAD,
    "duration",
    "reflex_gain",
    "snr_db",
    "voluntary",
    "actuator_frequency",
    "actuator_damping",
)


def label_setting(name: str) -> tuple[str, str]:
    """Readable name and unit of a simulation setting, or of the column with its values at a point."""
    name = name.removeprefix(POINT)
    return NAMES.get(name, name.replace("_", " ")), SimulationSettings.unit(name)


def label_axis(name: str) -> str:
    """Label of an axis or a column of a simulation setting."""
    return "{} [{}]".format(*label_setting(name))


def format_setting(name: str, value: float | None) -> str:
    """Value of a simulation setting with its unit."""
    unit = SimulationSettings.unit(name.removeprefix(POINT))
    return "infinite" if value is None else f"{value:g}" if unit == "1" else f"{value:g} {unit}"


def format_load(settings: Mapping[str, Any]) -> str:
    """Inertia, viscosity and stiffness of the load of a point, short enough for the title of a panel."""
    return "load " + "/".join(f"{settings[name]:g}" for name in LOAD)


def format_point(settings: Mapping[str, Any]) -> str:
    """Load, reflex gain and voluntary torque of a point, short enough for the title of a panel."""
    return f"{format_load(settings)}, gain {settings['reflex_gain']:g}, voluntary {100 * settings['voluntary']:g} %"


def describe_settings(settings: Mapping[str, Any], varied: Collection[str] = ()) -> str:
    """Settings that every trial of a study has, in one phrase."""
    values = {
        name: f"{label_setting(name)[0]} {format_setting(name, settings[name])}" for name in SHARED
    }
    values["closed_loop"] = "closed loop" if settings["closed_loop"] else "open loop"
    shared = [text for name, text in values.items() if name not in varied]
    return (
        f"{', '.join(shared)} (relative voluntary torque: its sd over that of the clean net torque)"
    )


def typical_point(points: Mapping[str, Mapping[str, Any]], varied: Collection[str]) -> str:
    """Point whose settings are the defaults of the simulation, which a figure of single trials shows."""
    defaults = SimulationSettings.defaults()
    return max(
        points,
        key=lambda point: sum(points[point].get(name) == defaults.get(name) for name in varied),
    )


def shared_truths(
    points: Mapping[str, Mapping[str, Any]], names: Collection[str]
) -> dict[str, float | None]:
    """True values that all points have, for lines in figures."""
    return {
        name: truths[0] if len(truths) == 1 else None
        for name, truths in _list_truths(points, names).items()
    }


def format_truths(points: Mapping[str, Mapping[str, Any]], names: Collection[str]) -> str:
    """True values of estimated parameters with their units, all of them where points differ."""
    texts = {
        name: " or ".join(map("{:g}".format, truths))
        for name, truths in _list_truths(points, names).items()
    }
    return ", ".join(
        f"{QUANTITIES[name].symbol} = {text} {QUANTITIES[name].unit}"
        for name, text in texts.items()
    )


def _list_truths(
    points: Mapping[str, Mapping[str, Any]], names: Collection[str]
) -> dict[str, list[float]]:
    """The true values that a parameter has at some point."""
    return {
        name: list(
            dict.fromkeys(true_values(settings, [name])[name] for settings in points.values())
        )
        for name in names
    }
