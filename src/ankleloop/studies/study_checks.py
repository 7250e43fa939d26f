"""What no trial of a study could be identified, drawn or shown with, found before the first is simulated."""

from __future__ import annotations

from collections.abc import Callable

from ankleloop.paper.results import true_values
from ankleloop.studies.checking import ConfigError
from ankleloop.studies.method_checks import find_fault
from ankleloop.studies.study import SimulatedStudy
from ankleloop.studies.sweep_settings import check_sweep

MOST_POINTS = 1000  # of a notebook that has a line of its table, or a curve, for each


def check_uses(study: SimulatedStudy) -> None:
    """Refuse a method, a window of figures or a notebook for which the points of a study leave nothing."""
    _check_methods(study)
    _check_kept(study)
    figure = study.settings.figure
    for end in sorted({settings["duration"] for settings in study.conditions.values()}):
        if figure.start >= end and "start" in figure.model_fields_set:
            raise _error(study, f"{figure.start:g} s is after the end of trials of {end:g} s.", "figure", "start [s]")
    _check_pictures(study)
    need = _find_need(study)
    if need:
        raise _error(study, f"{study.settings.notebook} needs {need}.", "notebook")


def _check_methods(study: SimulatedStudy) -> None:
    """Refuse options with which a method could identify no trial; equal options and trials are checked once."""
    checked = set()
    for point in study.point_list:
        end, rate = (study.conditions[point.condition][name] for name in ("duration", "recording_rate"))
        for name, method in study.methods.items():
            varied = point.options.get(name, {})
            key = (name, end, rate, *varied.items())
            if key in checked:
                continue
            checked.add(key)
            chosen = {"options": method.options.model_copy(update=varied)} if varied else {}
            fault = find_fault(method.model_copy(update=chosen), end, rate)
            if fault and varied:
                raise _error(study, f"{name}: {fault}", "points", point.name)
            if fault:
                raise _error(study, fault, "methods", name, "options")


def _check_kept(study: SimulatedStudy) -> None:
    """Refuse varied options with which the estimates of a method could not be in one file."""
    for column, parameter in study.parameters.items():
        if parameter.methods and parameter.field == "identification_rate" and study.settings.keep != "scores":
            message = "estimates of different rates are not kept in one file: set keep: scores."
            raise _error(study, message, "points", column)


def _check_pictures(study: SimulatedStudy) -> None:
    """Refuse pictures of a sweep that the study does not have."""
    if study.settings.notebook != "sweep" and "sweep" not in study.settings.model_fields_set:
        return
    try:
        check_sweep(study.settings.sweep, study.varied, list(study.methods), study.settings.against)
    except ValueError as error:
        raise _error(study, f"{error}.", "sweep") from None


def _error(study: SimulatedStudy, message: str, *keys: str) -> ConfigError:
    """An error of one of the keys of a study."""
    place = ("studies", study.name, *keys)
    return ConfigError(f"{' → '.join(('config', *place))}: {message}", [key.split(" [")[0] for key in place])


def _find_need(study: SimulatedStudy) -> str:
    """What the notebook of a study lacks, such as "one setting that differs, got none"; empty if nothing."""
    notebook = study.settings.notebook
    needs = NEEDS.get(notebook or "", ())
    if notebook not in (None, "sweep"):
        needs = (_few_points, *needs)
    return next((need for check in needs if (need := check(study))), "")


def _few_points(study: SimulatedStudy) -> str:
    count = len(study.point_list)
    if count <= MOST_POINTS:
        return ""
    return f"{MOST_POINTS:,} points at most, got {count:,}; the notebook sweep has no limit"


def _trials(study: SimulatedStudy) -> str:
    keep = study.settings.keep
    return "" if keep == "everything" else f"trials on disk, which keep: {keep} leaves out: set keep: everything"


def _estimates(study: SimulatedStudy) -> str:
    return "" if study.settings.keep != "scores" else "estimates on disk, which keep: scores leaves out: keep estimates"


def _settings_alone(study: SimulatedStudy) -> str:
    """A trial that is drawn belongs to the point that it is drawn for."""
    options = [name for point in study.point_list[:1] for method in point.options.values() for name in method]
    return f"points that differ in settings of the simulation alone, got {options[0]}" if options else ""


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


def _variations(study: SimulatedStudy) -> str:
    constant = [name for name, settings in study.points.items() if settings["variation"] is None]
    return f"variation (of K, B and G) at every point, got none at {constant[0]}" if constant else ""


def _trajectories(study: SimulatedStudy) -> str:
    varying = any(method.method == "riv-tv" for method in study.methods.values())
    return "" if varying else "a method riv-tv, for its trajectories"


def _filtered_points(study: SimulatedStudy) -> str:
    filters = any(settings["antialias_cutoff"] for settings in study.points.values())
    return "" if filters else "a point with the anti-aliasing filter (antialias_cutoff)"


NEEDS: dict[str, tuple[Callable[[SimulatedStudy], str], ...]] = {
    "figure4": (_single_setting, _numbers, _true_torques, _cascade),
    "passes": (_single_setting, _numbers, _cascade),
    "table1": (_trials, _settings_alone),
    "table2": (_trials, _settings_alone),
    "comparison": (_estimates, _abscissa),
    "traces": (_estimates, _traces, _equal_truths, _true_torques),
    "sensitivity": (_grid, _true_torques, _stop_rules),
    "efficiency": (_true_torques, _delay_intervals),
    "choosing": (_single_setting, _numbers, _true_torques, _selections),
    "obstacles": (_true_torques, _poles, _filtered_points),
    "time-varying": (_estimates, _true_torques, _variations, _trajectories),
}
