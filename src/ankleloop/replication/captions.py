"""Words for captions: names and values of simulation settings, and the settings that all trials of a study share."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ankleloop.simulation.settings import SimulationSettings

__all__ = ["describe_settings", "format_point", "format_setting", "label_setting"]

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
    """Readable name and unit of a simulation setting.

    Parameters
    ----------
    name : str
        A field of `ankleloop.simulation.settings.SimulationSettings`.

    Returns
    -------
    tuple of str
        Name and unit.

    Examples
    --------
    >>> label_setting("reflex_gain"), label_setting("actuator_frequency")
    (('reflex gain', 'N·m·s/rad'), ('actuator frequency', 'Hz'))
    """
    return NAMES.get(name, name.replace("_", " ")), SimulationSettings.unit(name)


def format_setting(name: str, value: float) -> str:
    """Value of a simulation setting with its unit.

    Parameters
    ----------
    name : str
        A field of `ankleloop.simulation.settings.SimulationSettings`.
    value : float
        Its value.

    Returns
    -------
    str

    Examples
    --------
    >>> format_setting("load_stiffness", 250.0), format_setting("actuator_damping", 0.8)
    ('250 N·m/rad', '0.8')
    """
    unit = SimulationSettings.unit(name)
    return f"{value:g}" if unit == "1" else f"{value:g} {unit}"


def format_point(settings: Mapping[str, Any]) -> str:
    """Load, reflex gain and voluntary torque of a point, short enough for the title of a panel.

    Parameters
    ----------
    settings : dict
        Simulation settings by name.

    Returns
    -------
    str

    Examples
    --------
    >>> format_point(SimulationSettings.defaults())
    'load 1.1/7.1/250, gain 13, voluntary 5 %'
    """
    load = "/".join(f"{settings[name]:g}" for name in LOAD)
    return f"load {load}, gain {settings['reflex_gain']:g}, voluntary {100 * settings['voluntary']:g} %"


def describe_settings(settings: Mapping[str, Any], varied: Collection[str] = ()) -> str:
    """Settings that every trial of a study has, in one phrase.

    Parameters
    ----------
    settings : dict
        Simulation settings by name.
    varied : collection of str
        Settings that differ between points; they are left out.

    Returns
    -------
    str

    Examples
    --------
    >>> describe_settings(SimulationSettings.defaults(), varied=["voluntary"]).split("; ")[1]
    'reflex gain 13 N·m·s/rad'
    """
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
