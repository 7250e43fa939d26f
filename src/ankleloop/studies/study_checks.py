"""What no trial of a study could be identified, drawn or shown with, found before the first is simulated."""

from __future__ import annotations

from collections.abc import Callable

from ankleloop.replication.results import true_values
from ankleloop.studies.checking import ConfigError
from ankleloop.studies.method_checks import find_fault
from ankleloop.studies.study import SimulatedStudy

__all__ = ["check_uses"]


def check_uses(study: SimulatedStudy) -> None:
    """Refuse a method, a window of figures or a notebook for which the points of a study leave nothing.

    Parameters
    ----------
    study : SimulatedStudy
        The study.

    Raises
    ------
    ConfigError
        The message names the key.
    """
    for end, rate in sorted({(point["duration"], point["recording_rate"]) for point in study.points.values()}):
        for name, method in study.methods.items():
            fault = find_fault(method, end, rate)
            if fault:
                raise _error(study, fault, "methods", name, "options")
        figure = study.settings.figure
        if figure.start >= end and "start" in figure.model_fields_set:
            raise _error(study, f"{figure.start:g} s is after the end of trials of {end:g} s.", "figure", "start [s]")
    need = _find_need(study)
    if need:
        raise _error(study, f"{study.settings.notebook} needs {need}.", "notebook")


def _error(study: SimulatedStudy, message: str, *keys: str) -> ConfigError:
    """An error of one of the keys of a study."""
    place = ("studies", study.name, *keys)
    return ConfigError(f"{' → '.join(('config', *place))}: {message}", [key.split(" [")[0] for key in place])


def _find_need(study: SimulatedStudy) -> str:
    """What the notebook of a study lacks, such as "one setting that differs, got none"; empty if nothing."""
    needs = NEEDS.get(study.settings.notebook or "", ())
    return next((need for check in needs if (need := check(study))), "")


def _single_setting(study: SimulatedStudy) -> str:
    if len(study.varied) == 1:
        return ""
    return f"one setting that differs between the points, got {', '.join(study.varied) or 'none'}"


def _abscissa(study: SimulatedStudy) -> str:
    """A setting with a number at every point, with which all others are scaled; the loops have curves of their own."""
    names = [name for name in study.varied if name != "closed_loop"]
    if not names:
        return "a setting beside closed_loop that differs between the points, got none"
    x, *others = names
    rows: dict[object, list[object]] = {}
    for settings in study.points.values():
        if not isinstance(settings[x], (int, float)):
            return f"a number for {x} at every point, got {settings[x]!r}"
        scaled = [settings[name] for name in others]
        if rows.setdefault(settings[x], scaled) != scaled:
            return f"one value of {', '.join(others)} for each value of {x}"
    return ""


def _numbers(study: SimulatedStudy) -> str:
    values = [settings[name] for settings in study.points.values() for name in study.varied]
    other = [value for value in values if not isinstance(value, (int, float))]
    return f"numbers as values of {study.varied[0]}, got {other[0]!r}" if other else ""


def _grid(study: SimulatedStudy) -> str:
    return "" if len(study.varied) > 1 else f"two settings or more that differ, got {', '.join(study.varied) or 'none'}"


def _true_torques(study: SimulatedStudy) -> str:
    return "scores against the true torques: leave out against: measured" if study.settings.against else ""


def _cascade(study: SimulatedStudy) -> str:
    methods = study.methods.values()
    return "" if any(method.method == "parallel-cascade" for method in methods) else "a method parallel-cascade"


def _stop_rules(study: SimulatedStudy) -> str:
    rules = [name for name in study.methods if name.startswith("parallel-cascade")]
    return "" if rules else "a method whose name begins with parallel-cascade, for its stop rule"


def _delay_intervals(study: SimulatedStudy) -> str:
    methods = study.methods.values()
    free = any(method.method == "riv" and method.fixed_options.get("delay", 0.0) is None for method in methods)
    return "" if free else "a method riv with the option delay: null, whose delay has an interval"


def _selections(study: SimulatedStudy) -> str:
    without = [name for name, method in study.methods.items() if not method.select]
    return f"select for every method, got none for {', '.join(without)}" if without else ""


def _traces(study: SimulatedStudy) -> str:
    methods = [method.method for method in study.methods.values()]
    return "" if methods == ["real-time"] else f"one method, real-time, got {', '.join(methods)}"


def _equal_truths(study: SimulatedStudy) -> str:
    truths = {tuple(true_values(settings, ["K", "B", "I", "G"]).values()) for settings in study.points.values()}
    return "" if len(truths) == 1 else "points with the same K, B, I and G"


def _poles(study: SimulatedStudy) -> str:
    members = any(method.method.endswith("moesp") for method in study.methods.values())
    return "" if members else "a method of the MOESP family, for its poles"


def _filtered_points(study: SimulatedStudy) -> str:
    filters = any(settings["antialias_cutoff"] for settings in study.points.values())
    return "" if filters else "a point with the anti-aliasing filter (antialias_cutoff)"


NEEDS: dict[str, tuple[Callable[[SimulatedStudy], str], ...]] = {
    "figure4": (_single_setting, _numbers, _true_torques, _cascade),
    "passes": (_single_setting, _numbers, _cascade),
    "comparison": (_abscissa,),
    "traces": (_traces, _equal_truths, _true_torques),
    "sensitivity": (_grid, _true_torques, _stop_rules),
    "efficiency": (_true_torques, _delay_intervals),
    "choosing": (_single_setting, _numbers, _true_torques, _selections),
    "obstacles": (_true_torques, _poles, _filtered_points),
}
