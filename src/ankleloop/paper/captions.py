"""Words for captions: names and values of settings, settings that points share, points by their values."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ankleloop.paper.results import true_values
from ankleloop.quantities import QUANTITIES
from ankleloop.simulation.settings import SimulationSettings

NAMES = {
    "voluntary": "relative voluntary torque",
    "load_stiffness": "stiffness of the load",
    "load_inertia": "inertia of the load",
    "load_viscosity": "viscosity of the load",
    "snr_db": "signal-to-noise ratio",
    "closed_loop": "loop",
}
LOAD = ("load_inertia", "load_viscosity", "load_stiffness")


def label_setting(name: str) -> tuple[str, str]:
    """Readable name and unit of a simulation setting."""
    return NAMES.get(name, name.replace("_", " ")), SimulationSettings.unit(name)


def label_axis(name: str) -> str:
    """Label of an axis or a column of a simulation setting."""
    return "{} [{}]".format(*label_setting(name))


def format_setting(name: str, value: float) -> str:
    """Value of a simulation setting with its unit."""
    unit = SimulationSettings.unit(name)
    return f"{value:g}" if unit == "1" else f"{value:g} {unit}"


def format_point(settings: Mapping[str, Any]) -> str:
    """Load, reflex gain and voluntary torque of a point, short enough for the title of a panel."""
    load = "/".join(f"{settings[name]:g}" for name in LOAD)
    return f"load {load}, gain {settings['reflex_gain']:g}, voluntary {100 * settings['voluntary']:g} %"


def describe_settings(settings: Mapping[str, Any], varied: Collection[str] = ()) -> str:
    """Settings that every trial of a study has, in one phrase."""
    values = {name: format_setting(name, settings[name]) for name in (*LOAD, "duration", "reflex_gain")}
    servo = [format_setting(name, settings[name]) for name in ("actuator_frequency", "actuator_damping")]
    noise, voluntary = settings["snr_db"], settings["voluntary"]
    phrases = {
        ("duration",): f"trials of {values['duration']}",
        ("reflex_gain",): f"reflex gain {values['reflex_gain']}",
        ("snr_db",): "no measurement noise"
        if noise is None
        else f"measurement noise at {format_setting('snr_db', noise)} in the recorded torque",
        ("voluntary",): f"voluntary torque {100 * voluntary:g} % of the clean net torque (sd)"
        if voluntary
        else "no voluntary torque",
        ("closed_loop",): "closed loop" if settings["closed_loop"] else "open loop",
        LOAD: f"load {', '.join(values[name] for name in LOAD)}",
        ("actuator_frequency", "actuator_damping"): "actuator {}, damping {}".format(*servo),
    }
    parts = [text for names, text in phrases.items() if not set(names) & set(varied)]
    if "voluntary" in varied:
        parts.append("relative voluntary torque is its sd over that of the clean net torque")
    return "; ".join(parts)


def typical_point(points: Mapping[str, Mapping[str, Any]], varied: Collection[str]) -> str:
    """Point whose settings are the defaults of the simulation, which a figure of single trials shows."""
    defaults = SimulationSettings.defaults()
    return max(points, key=lambda point: sum(points[point].get(name) == defaults.get(name) for name in varied))


def most_compliant_point(points: Mapping[str, Mapping[str, Any]]) -> str:
    """Point whose load is the least stiff."""
    return min(points, key=lambda point: points[point]["load_stiffness"])


def single_setting(varied: Collection[str]) -> str:
    """The only setting that differs between the points of a study, the abscissa of its figures."""
    if len(varied) != 1:
        raise ValueError(
            f"this notebook shows a study that varies one setting, got {', '.join(varied) or 'none'}: use the notebook "
            "comparison or table1."
        )
    return next(iter(varied))


def shared_truths(points: Mapping[str, Mapping[str, Any]], names: Collection[str]) -> dict[str, float | None]:
    """True values that all points have, for lines in figures."""
    values = {name: set(_list_truths(points, name)) for name in names}
    return {name: next(iter(truths)) if len(truths) == 1 else None for name, truths in values.items()}


def format_truths(points: Mapping[str, Mapping[str, Any]], names: Collection[str]) -> str:
    """True values of estimated parameters with their units, all of them where points differ."""
    texts = {name: " or ".join(f"{value:g}" for value in dict.fromkeys(_list_truths(points, name))) for name in names}
    return ", ".join(f"{QUANTITIES[name].symbol} = {text} {QUANTITIES[name].unit}" for name, text in texts.items())


def _list_truths(points: Mapping[str, Mapping[str, Any]], name: str) -> list[float]:
    """True value of a parameter at each point."""
    return [true_values(settings, [name])[name] for settings in points.values()]
