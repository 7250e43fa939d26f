"""The configuration of a run, checked before its first job; what its notebooks need, and what they are given."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Any

from ankleloop.errors import DataError
from ankleloop.joint.regressors import decimation_grid
from ankleloop.methods.registry import METHODS
from ankleloop.options import suggest_name
from ankleloop.paper.results import true_values
from ankleloop.studies.checking import ConfigError, key_error
from ankleloop.studies.config import Config, MethodSettings
from ankleloop.studies.config_files import find_key
from ankleloop.studies.points import SIMULATION
from ankleloop.studies.study import RecordedStudy, SimulatedStudy, Study, read_studies

MOST_POINTS = 1000  # of a notebook that has a line of its table, or a curve, for each
# What each notebook needs of its study. Captions and axes know settings alone, and no options; a trial that is drawn
# belongs to the point that it is drawn for.
NEEDS = {
    "figure4": ("one setting", "settings", "numbers", "truths", "cascade"),
    "passes": ("one setting", "settings", "numbers", "cascade"),
    "table1": ("trials", "settings"),
    "table2": ("trials", "settings"),
    "comparison": ("estimates", "settings", "abscissa", "places", "scales"),
    "traces": ("estimates", "settings", "real-time", "one joint", "truths"),
    "sensitivity": ("two settings", "settings", "truths", "stop rule"),
    "efficiency": ("settings", "truths", "delay"),
    "choosing": ("one setting", "settings", "numbers", "truths", "select"),
    "obstacles": ("truths", "poles", "filter"),
    "design": ("settings", "truths"),
    "time-varying": ("estimates", "truths", "variation", "trajectories"),
}
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
        absolute = [Path(os.path.abspath(path)) for path in paths]
        shown = [path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path for path in absolute]
        place = "--config" if error.keys and error.keys[0] in command_line else find_key(error.keys, shown)
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
    settings, place = study.settings, ("studies", study.name)
    _check_methods(study)
    start, end = settings.figure.start, min(condition["duration"] for condition in study.conditions.values())
    if start >= end and "start" in settings.figure.model_fields_set:
        raise key_error((*place, "figure", "start [s]"), f"{start:g} s is after the end of trials of {end:g} s.")
    if settings.notebook == "sweep" or "sweep" in settings.model_fields_set:
        try:
            settings.sweep.check(study.varied, study.methods, settings.against)
        except ValueError as error:
            raise key_error((*place, "sweep"), f"{error}.") from None
    need = find_need(study) if settings.notebook in NEEDS else ""
    if need:
        raise key_error((*place, "notebook"), f"{settings.notebook} needs {need}.")


def _check_methods(study: SimulatedStudy) -> None:
    """Refuse options with which a method could identify no trial, or whose estimates could not be in one file."""
    place = ("studies", study.name)
    checked = set()
    for point in study.point_list:
        end, rate = (study.conditions[point.condition][name] for name in ("duration", "recording_rate"))
        for name, method in study.methods.items():
            varied = point.options.get(name, {})
            key = (name, end, rate, *varied.items())
            fault = "" if key in checked else _find_fault(method, varied, end, rate)
            checked.add(key)
            if fault and varied:
                raise key_error((*place, "points", point.name), f"{name}: {fault}")
            if fault:
                raise key_error((*place, "methods", name, "options"), fault)
    for column, parameter in study.parameters.items():
        is_rate = parameter.field == "identification_rate" and SIMULATION not in parameter.owners
        if is_rate and study.settings.keep != "scores":
            message = "estimates of different rates are not kept in one file: set keep: scores."
            raise key_error((*place, "points", column), message)


def _find_fault(method: MethodSettings, varied: Mapping[str, Any], duration: float, rate: float) -> str:
    """Why a method cannot identify any simulated trial of some length and rate."""
    reference = METHODS[method.method].reference(method.options.model_copy(update=varied))
    if reference is not None and reference not in REFERENCES:
        close = suggest_name(reference, REFERENCES)
        return f"a simulated trial has no {reference!r}{close} to serve as reference; it has {', '.join(REFERENCES)}."
    options = {**method.fixed_options, **varied}
    if "identification_rate" in options:
        try:
            decimation_grid(round(duration * rate), rate, options["identification_rate"], options.get("delay") or 0.0)
        except DataError as error:
            return f"{error}"
    rows, order = options.get("block_rows"), options.get("order") or 1
    return f"block_rows must be larger than the order ({order}), got {rows}." if rows and rows <= order else ""


def find_need(study: SimulatedStudy) -> str:
    """What the notebook of a study needs and the study lacks; empty where it has everything."""
    keep, points, varied = study.settings.keep, study.points, study.varied
    if len(points) > MOST_POINTS:
        return f"{MOST_POINTS:,} points at most, got {len(points):,}; the notebook sweep has no limit"
    options = [parameter.field for parameter in study.parameters.values() if SIMULATION not in parameter.owners]
    # The abscissa, with which all others are scaled; the loops have curves of their own.
    axes = [name for name in varied if name != "closed_loop"]
    scales = {tuple(settings[name] for name in axes) for settings in points.values()}
    texts, places = (
        [settings[name] for settings in points.values() for name in names if isinstance(settings[name], str | NoneType)]
        for names in (varied, axes[:1])
    )
    truths = {tuple(true_values(settings, "KBIG").values()) for settings in points.values()}
    constant = [name for name, settings in points.items() if settings["variation"] is None]
    filters = any(settings["antialias_cutoff"] for settings in points.values())
    methods = [method.method for method in study.methods.values()]
    cascades = [name for name in study.methods if name.startswith("parallel-cascade")]
    searches = any(m.method == "riv" and m.fixed_options.get("delay", 0.0) is None for m in study.methods.values())
    unselected = [name for name, method in study.methods.items() if not method.select]
    names = ", ".join(varied) or "none"
    lacks = {
        "trials": keep != "everything" and f"trials on disk, which keep: {keep} leaves out: set keep: everything",
        "estimates": keep == "scores" and "estimates on disk, which keep: scores leaves out: keep estimates",
        "one setting": len(varied) != 1 and f"one setting that differs between the points, got {names}",
        "two settings": len(varied) < 2 and f"two settings or more that differ, got {names}",
        "settings": options and f"points that differ in settings of the simulation alone, got {options[0]}",
        "abscissa": not axes and "a setting beside closed_loop that differs between the points, got none",
        "places": places and f"a number for {axes[0]} at every point, got {places[0]!r}",
        "scales": len(scales) > len({scale[:1] for scale in scales})
        and f"one value of {', '.join(axes[1:])} for each value of {axes[0]}",
        "numbers": texts and f"numbers as values of {varied[0]}, got {texts[0]!r}",
        "real-time": methods != ["real-time"] and f"one method, real-time, got {', '.join(methods)}",
        "one joint": len(truths) > 1 and "points with the same K, B, I and G",
        "truths": study.settings.against and "scores against the true torques: leave out against: measured",
        "cascade": "parallel-cascade" not in methods and "a method parallel-cascade",
        "stop rule": not cascades and "a method whose name begins with parallel-cascade, for its stop rule",
        "delay": not searches and "a method riv with the option delay: null, whose delay has an interval",
        "select": unselected and f"select for every method, got none for {', '.join(unselected)}",
        "poles": not any(name.endswith("moesp") for name in methods) and "a method of the MOESP family, for its poles",
        "filter": not filters and "a point with the anti-aliasing filter (antialias_cutoff)",
        "variation": constant and f"variation (of K, B and G) at every point, got none at {constant[0]}",
        "trajectories": "riv-tv" not in methods and "a method riv-tv, for its trajectories",
    }
    return next((need for name in NEEDS[study.settings.notebook or ""] if (need := lacks[name])), "")


def report_parameters(study: Study, files: Mapping[str, Iterable[str]], **places: str) -> dict[str, Any]:
    """Parameters of the notebook of a study: what `ankleloop.pages.study_page.StudyPage` holds.

    `files` are its trials, estimates and tables; `places` are `published`, `table_stem`, `figure_stem`.
    """
    settings = study.settings
    trials, estimates, tables = (list(files.get(kind, ())) for kind in ("trials", "estimates", "tables"))
    parameters = {
        "study": study.name,
        "kind": settings.kind,
        "title": study.title,
        "labels": study.labels,
        "algorithms": {name: method.method for name, method in study.methods.items()},
        "points": study.points if settings.notebook in NEEDS else {},  # the others read tables alone
        "varied": list(study.varied),
        "figure": settings.figure.model_dump(),
        "trials": trials,
        "estimates": estimates,
        **places,
    }
    if settings.notebook == "sweep":
        parameters |= {"settings": settings.simulation.model_dump(), "sweep": settings.sweep.model_dump()}
    is_simulated = isinstance(study, SimulatedStudy)
    return {"study": {**parameters, **({"table_file": "".join(tables)} if is_simulated else {"tables": tables})}}


def article_parameters(
    studies: Iterable[SimulatedStudy], files: Mapping[str, Mapping[str, Any]], **shared: Any
) -> dict[str, Any]:
    """Parameters of the notebook of the article."""
    described = {
        study.name: {
            "title": study.title,
            "trials": study.settings.trials,
            "parameters": study.settings.simulation.model_dump(),
            "points": study.points,
            "varied": study.varied,
            "methods": study.labels,
            **files[study.name],
        }
        for study in studies
    }
    return {"title": "Closed-loop identification of ankle dynamics: a replication", "studies": described, **shared}
