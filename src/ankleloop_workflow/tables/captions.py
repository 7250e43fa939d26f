"""Words for captions: names and values of settings, settings that points share, points by their values."""

from __future__ import annotations

from collections.abc import Collection

from ankleloop.quantities import POINT, QUANTITIES, SETTINGS
from ankleloop.simulation.settings import LOAD_SETTINGS as LOAD
from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.tables.outcomes import Points, Settings, describe_condition

SETTING_NAMES = {
    "voluntary": "relative voluntary torque",
    "load_stiffness": "stiffness of the load",
    "load_inertia": "inertia of the load",
    "load_viscosity": "viscosity of the load",
    "snr_db": "signal-to-noise ratio",
    "closed_loop": "loop",
}
SHARED_SETTINGS = (
    *LOAD,
    "duration",
    "reflex_gain",
    "snr_db",
    "voluntary",
    "actuator_frequency",
    "actuator_damping",
    "closed_loop",
)


def label_setting(name: str) -> tuple[str, str]:
    """Readable name and unit of a simulation setting, or of the column with its values at a point."""
    name = name.removeprefix(POINT)
    return SETTING_NAMES.get(name, name.replace("_", " ")), SimulationSettings.unit(name)


def label_axis(name: str) -> str:
    """Label of an axis or a column of a simulation setting."""
    return "{} [{}]".format(*label_setting(name))


def format_setting(name: str, value: float | None) -> str:
    """Value of a simulation setting with its unit."""
    if value is None:
        return "infinite"
    unit = SimulationSettings.unit(name.removeprefix(POINT))
    return f"{value:g}" if unit == "1" else f"{value:g} {unit}"


def format_load(settings: Settings) -> str:
    """Inertia, viscosity and stiffness of the load of a point, short enough for the title of a panel."""
    return "load " + "/".join(f"{settings[name]:g}" for name in LOAD)


def format_point(settings: Settings, varied: Collection[str] = ()) -> str:
    """Load, reflex gain and voluntary torque of a point, and what else is varied, for the title of a panel."""
    texts = [
        format_load(settings),
        f"gain {settings['reflex_gain']:g}",
        f"voluntary {100 * settings['voluntary']:g} %",
    ]
    titled = (*LOAD, "reflex_gain", "voluntary")
    others = {name: settings[name] for name in varied if name not in titled}
    return ", ".join(filter(None, [*texts, describe_values(others)]))


def describe_values(values: Settings) -> str:
    """Values of settings in words, such as those that make a point."""
    texts = []
    for name, value in values.items():
        if isinstance(value, (bool, str)):
            texts.append(describe_condition(name, value))
        else:
            texts.append(f"{label_setting(name)[0]} {format_setting(name, value)}")
    return ", ".join(texts)


def describe_settings(settings: Settings, varied: Collection[str] = ()) -> str:
    """Settings that every trial of a study has, in one phrase: the usual ones, and others that are not by default."""
    defaults = SimulationSettings.defaults()
    others = [name for name, value in settings.items() if value != defaults.get(name)]
    names = [name for name in dict.fromkeys([*SHARED_SETTINGS, *others]) if name not in varied]
    shared = describe_values({name: settings[name] for name in names})
    return f"{shared} (relative voluntary torque: its sd over that of the clean net torque)"


def typical_point(points: Points, varied: Collection[str]) -> str:
    """Point whose settings are the defaults of the simulation, which a figure of single trials shows."""
    defaults = SimulationSettings.defaults()

    def count_defaults(point: str) -> int:
        return sum(points[point].get(name) == defaults.get(name) for name in varied)

    return max(points, key=count_defaults)


def shared_truths(points: Points, names: Collection[str]) -> dict[str, float | None]:
    """True values that all points have, for lines in figures."""
    return {
        name: truths[0] if len(truths) == 1 else None
        for name, truths in _list_truths(points, names).items()
    }


def format_truths(points: Points, names: Collection[str]) -> str:
    """True values of estimated parameters with their units, all of them where points differ."""
    texts = []
    for name, truths in _list_truths(points, names).items():
        quantity = QUANTITIES[name]
        values = " or ".join(f"{truth:g}" for truth in truths)
        texts.append(f"{quantity.symbol} = {values} {quantity.unit}")
    return ", ".join(texts)


def _list_truths(points: Points, names: Collection[str]) -> dict[str, list[float]]:
    """The true values that a parameter has at some point."""
    return {
        name: list(dict.fromkeys(settings[SETTINGS[name]] for settings in points.values()))
        for name in names
    }
