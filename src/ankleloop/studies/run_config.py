"""The configuration of a run, checked before its first job: all that it names, and what its notebooks need."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ankleloop.errors import DataError
from ankleloop.joint.regressors import decimation_grid
from ankleloop.methods.registry import METHODS
from ankleloop.options import suggest_name
from ankleloop.paper.results import true_values
from ankleloop.studies.checking import ConfigError
from ankleloop.studies.config import Config
from ankleloop.studies.config_files import find_key
from ankleloop.studies.method_settings import MethodSettings
from ankleloop.studies.study import RecordedStudy, SimulatedStudy, Study, read_studies

MOST_POINTS = 1000  # of a notebook that has a line of its table, or a curve, for each
REFERENCES = ("reference", "position")  # variables of a simulated trial that may serve as reference


def read_run(
    config: Mapping[str, Any], paths: Sequence[str | os.PathLike[str]], command_line: Mapping[str, Any] | None = None
) -> tuple[Config, dict[str, Study]]:
    """Read the configuration of a run, and refuse what a job would refuse."""
    command_line = command_line or {}
    for key, value in command_line.items():
        if value is None:  # of an empty variable of the shell; no names would mean all studies
            raise ConfigError(f"--config: the key {key!r} has no value.")
    try:
        checked, studies = read_studies(config)
        for study in map(studies.__getitem__, checked.run_names):
            if isinstance(study, RecordedStudy):
                study.check_files()
            elif isinstance(study, SimulatedStudy):
                check_uses(study)
    except ConfigError as error:
        here = Path.cwd()
        absolute = [Path(os.path.abspath(path)) for path in paths]
        shown = [path.relative_to(here) if path.is_relative_to(here) else path for path in absolute]
        overridden = bool(error.keys) and error.keys[0] in command_line
        place = "--config" if overridden else find_key(error.keys, shown)
        raise ConfigError(f"{place}: {error}" if place else str(error), error.keys) from None
    return checked, studies


def describe_article(config: Config) -> str:
    """Sentence that says why a run does not make the ledger and the article; empty if it does, or none is wanted."""
    missing = [name for name in config.article if name not in config.run_names]
    if not missing:
        return ""
    return f"The ledger and the article are not made, because run leaves out studies of article: {', '.join(missing)}."


def check_uses(study: SimulatedStudy) -> None:
    """Refuse a method, a window of figures or a notebook for which the points of a study leave nothing."""
    settings = study.settings
    _check_methods(study)
    for end in sorted({condition["duration"] for condition in study.conditions.values()}):
        start = settings.figure.start
        if start >= end and "start" in settings.figure.model_fields_set:
            raise _error(study, f"{start:g} s is after the end of trials of {end:g} s.", "figure", "start [s]")
    if settings.notebook == "sweep" or "sweep" in settings.model_fields_set:
        try:
            settings.sweep.check(study.varied, study.methods, settings.against)
        except ValueError as error:
            raise _error(study, f"{error}.", "sweep") from None
    for check in NEEDS.get(settings.notebook or "", ()):
        need = check(study)
        if need:
            raise _error(study, f"{settings.notebook} needs {need}.", "notebook")


def _check_methods(study: SimulatedStudy) -> None:
    """Refuse options with which a method could identify no trial, or whose estimates could not be in one file."""
    checked = set()
    for point in study.point_list:
        end, rate = (study.conditions[point.condition][name] for name in ("duration", "recording_rate"))
        for name, method in study.methods.items():
            varied = point.options.get(name, {})
            key = (name, end, rate, *varied.items())
            fault = "" if key in checked else _find_fault(method, varied, end, rate)
            checked.add(key)
            if fault and varied:
                raise _error(study, f"{name}: {fault}", "points", point.name)
            if fault:
                raise _error(study, fault, "methods", name, "options")
    for column, parameter in study.parameters.items():
        if parameter.methods and parameter.field == "identification_rate" and study.settings.keep != "scores":
            message = "estimates of different rates are not kept in one file: set keep: scores."
            raise _error(study, message, "points", column)


def _error(study: SimulatedStudy, message: str, *keys: str) -> ConfigError:
    """An error of one of the keys of a study."""
    place = ("studies", study.name, *keys)
    return ConfigError(f"{' → '.join(('config', *place))}: {message}", [key.split(" [")[0] for key in place])


def _find_fault(method: MethodSettings, varied: Mapping[str, Any], duration: float, rate: float) -> str:
    """Why a method cannot identify any simulated trial of some length and rate."""
    chosen = method.options.model_copy(update=varied)
    reference = METHODS[method.method].reference(chosen)
    if reference is not None and reference not in REFERENCES:
        close = suggest_name(reference, REFERENCES)
        return f"a simulated trial has no {reference!r}{close} to serve as reference; it has {', '.join(REFERENCES)}."
    options = {**method.fixed_options, **varied}
    if "identification_rate" in options:
        try:
            decimation_grid(round(duration * rate), rate, options["identification_rate"], options.get("delay") or 0.0)
        except DataError as error:
            return f"{error}"
    rows, order, leads = (options.get(name) for name in ("block_rows", "order", "instrument_leads"))
    if rows is not None and rows <= (order or 1):
        return f"block_rows must be larger than the order ({order or 1}), got {rows}."
    if rows is not None and leads is not None and leads > rows:
        return f"instrument_leads must be between 0 and block_rows ({rows}), got {leads}."
    return ""


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
    """Captions and axes know settings; a trial that is drawn belongs to the point that it is drawn for."""
    options = [parameter.field for parameter in study.parameters.values() if parameter.methods]
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


def _selections(study: SimulatedStudy) -> str:
    without = [name for name, method in study.methods.items() if not method.select]
    return f"select for every method, got none for {', '.join(without)}" if without else ""


def _traces(study: SimulatedStudy) -> str:
    methods = [method.method for method in study.methods.values()]
    return "" if methods == ["real-time"] else f"one method, real-time, got {', '.join(methods)}"


def _equal_truths(study: SimulatedStudy) -> str:
    truths = {tuple(true_values(settings, ["K", "B", "I", "G"]).values()) for settings in study.points.values()}
    return "" if len(truths) == 1 else "points with the same K, B, I and G"


def _variations(study: SimulatedStudy) -> str:
    constant = [name for name, settings in study.points.items() if settings["variation"] is None]
    return f"variation (of K, B and G) at every point, got none at {constant[0]}" if constant else ""


def _filtered_points(study: SimulatedStudy) -> str:
    filters = any(settings["antialias_cutoff"] for settings in study.points.values())
    return "" if filters else "a point with the anti-aliasing filter (antialias_cutoff)"


def _any_method(need: str, fits: Callable[[str, MethodSettings], bool]) -> Callable[[SimulatedStudy], str]:
    """A need of one method at least."""
    return lambda study: "" if any(fits(name, method) for name, method in study.methods.items()) else need


_cascade = _any_method("a method parallel-cascade", lambda _, method: method.method == "parallel-cascade")
_stop_rules = _any_method(
    "a method whose name begins with parallel-cascade, for its stop rule",
    lambda name, _: name.startswith("parallel-cascade"),
)
_delay_intervals = _any_method(
    "a method riv with the option delay: null, whose delay has an interval",
    lambda _, method: method.method == "riv" and method.fixed_options.get("delay", 0.0) is None,
)
_poles = _any_method("a method of the MOESP family, for its poles", lambda _, method: method.method.endswith("moesp"))
_trajectories = _any_method("a method riv-tv, for its trajectories", lambda _, method: method.method == "riv-tv")

# What each notebook needs of its study; empty where the study has it.
NEEDS: dict[str, Iterable[Callable[[SimulatedStudy], str]]] = {
    "figure4": (_few_points, _single_setting, _settings_alone, _numbers, _true_torques, _cascade),
    "passes": (_few_points, _single_setting, _settings_alone, _numbers, _cascade),
    "table1": (_few_points, _trials, _settings_alone),
    "table2": (_few_points, _trials, _settings_alone),
    "comparison": (_few_points, _estimates, _settings_alone, _abscissa),
    "traces": (_few_points, _estimates, _settings_alone, _traces, _equal_truths, _true_torques),
    "sensitivity": (_few_points, _grid, _settings_alone, _true_torques, _stop_rules),
    "efficiency": (_few_points, _settings_alone, _true_torques, _delay_intervals),
    "choosing": (_few_points, _single_setting, _settings_alone, _numbers, _true_torques, _selections),
    "obstacles": (_few_points, _true_torques, _poles, _filtered_points),
    "design": (_few_points, _settings_alone, _true_torques),
    "time-varying": (_few_points, _estimates, _true_torques, _variations, _trajectories),
}
