"""The configuration of a run, checked before its first job; what its notebooks need, and what they are given."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ankleloop.errors import DataError
from ankleloop.joint.regressors import decimation_grid
from ankleloop.methods.registry import METHODS
from ankleloop.options import suggest_name
from ankleloop.paper.results import true_values
from ankleloop.studies.checking import ConfigError, key_error
from ankleloop.studies.config import NOTEBOOKS, Config, MethodSettings
from ankleloop.studies.config_files import find_key
from ankleloop.studies.points import SIMULATION
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
    for end in sorted({condition["duration"] for condition in study.conditions.values()}):
        start = settings.figure.start
        if start >= end and "start" in settings.figure.model_fields_set:
            raise key_error((*place, "figure", "start [s]"), f"{start:g} s is after the end of trials of {end:g} s.")
    if settings.notebook == "sweep" or "sweep" in settings.model_fields_set:
        try:
            settings.sweep.check(study.varied, study.methods, settings.against)
        except ValueError as error:
            raise key_error((*place, "sweep"), f"{error}.") from None
    need = find_need(study)
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
    notebook, points, varied, keep = study.settings.notebook, study.points, study.varied, study.settings.keep
    if notebook in (None, "sweep"):
        return ""
    if len(points) > MOST_POINTS:
        return f"{MOST_POINTS:,} points at most, got {len(points):,}; the notebook sweep has no limit"
    names = ", ".join(varied) or "none"
    values = [settings[name] for settings in points.values() for name in varied]
    texts = [value for value in values if not isinstance(value, (int, float))]
    options = [parameter.field for parameter in study.parameters.values() if SIMULATION not in parameter.owners]
    truths = {tuple(true_values(settings, "KBIG").values()) for settings in points.values()}
    constant = [name for name, settings in points.items() if settings["variation"] is None]
    methods = {name: method.method for name, method in study.methods.items()}
    moesp = [name for name in methods.values() if name.endswith("moesp")]
    cascades = [name for name in study.methods if name.startswith("parallel-cascade")]
    searching = [m for m in study.methods.values() if m.method == "riv" and m.fixed_options.get("delay", 0.0) is None]
    unselected = [name for name, method in study.methods.items() if not method.select]
    # Notebooks, whether the study lacks what they need, and what that is.
    needs: list[tuple[set[str], Any, str]] = [
        (
            {"table1", "table2"},
            keep != "everything",
            f"trials on disk, which keep: {keep} leaves out: set keep: everything",
        ),
        (
            {"comparison", "traces", "time-varying"},
            keep == "scores",
            "estimates on disk, which keep: scores leaves out: keep estimates",
        ),
        (
            {"figure4", "passes", "choosing"},
            len(varied) != 1,
            f"one setting that differs between the points, got {names}",
        ),
        ({"sensitivity"}, len(varied) < 2, f"two settings or more that differ, got {names}"),
        # Captions and axes know settings; a trial that is drawn belongs to the point that it is drawn for.
        (
            {*NOTEBOOKS} - {"obstacles", "time-varying"},
            options,
            f"points that differ in settings of the simulation alone, got {''.join(options[:1])}",
        ),
        ({"comparison"}, message := _find_abscissa_fault(study), message),
        (
            {"figure4", "passes", "choosing"},
            texts,
            f"numbers as values of {''.join(varied)}, got {texts[0]!r}" if texts else "",
        ),
        ({"traces"}, [*methods.values()] != ["real-time"], f"one method, real-time, got {', '.join(methods.values())}"),
        ({"traces"}, len(truths) > 1, "points with the same K, B, I and G"),
        (
            {"figure4", "traces", "sensitivity", "efficiency", "choosing", "obstacles", "time-varying"},
            study.settings.against,
            "scores against the true torques: leave out against: measured",
        ),
        ({"figure4", "passes"}, "parallel-cascade" not in methods.values(), "a method parallel-cascade"),
        (
            {"sensitivity"},
            not cascades,
            "a method whose name begins with parallel-cascade, for its stop rule",
        ),
        ({"efficiency"}, not searching, "a method riv with the option delay: null, whose delay has an interval"),
        ({"choosing"}, unselected, f"select for every method, got none for {', '.join(unselected)}"),
        ({"obstacles"}, not moesp, "a method of the MOESP family, for its poles"),
        (
            {"obstacles"},
            not any(settings["antialias_cutoff"] for settings in points.values()),
            "a point with the anti-aliasing filter (antialias_cutoff)",
        ),
        ({"time-varying"}, constant, f"variation (of K, B and G) at every point, got none at {''.join(constant[:1])}"),
        ({"time-varying"}, "riv-tv" not in methods.values(), "a method riv-tv, for its trajectories"),
    ]
    return next((need for notebooks, lacks, need in needs if notebook in notebooks and lacks), "")


def _find_abscissa_fault(study: SimulatedStudy) -> str:
    """What the setting lacks that is the abscissa, and scales all others; the loops have curves of their own."""
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


def shows_sweep(study: Study) -> bool:
    """Whether the notebook of a study shows a sweep: it reads the table of all trials alone."""
    return bool(study.settings.notebook == "sweep")


def report_parameters(study: Study, files: Mapping[str, Iterable[str]], **places: str) -> dict[str, Any]:
    """Parameters of the notebook of a study: what `ankleloop.pages.study_page.StudyPage` holds.

    `files` are its trials, estimates and tables; `places` are `published`, `table_stem`, `figure_stem`.
    """
    parameters = {
        "study": study.name,
        "kind": study.settings.kind,
        "title": study.title,
        "labels": study.labels,
        "algorithms": {name: method.method for name, method in study.methods.items()},
        "points": study.points if not shows_sweep(study) else {},
        "varied": list(study.varied),
        "figure": study.settings.figure.model_dump(),
        "trials": list(files.get("trials", ())),
        "estimates": list(files.get("estimates", ())),
        **places,
    }
    tables = list(files.get("tables", ()))
    if not isinstance(study, SimulatedStudy):
        return {"study": {**parameters, "tables": tables}}
    if shows_sweep(study):
        shared = study.settings.simulation.model_dump()
        parameters |= {"settings": shared, "sweep": study.settings.sweep.model_dump()}
    return {"study": {**parameters, "table_file": "".join(tables)}}


def article_parameters(
    studies: Iterable[SimulatedStudy], files: Mapping[str, Mapping[str, Any]], **shared: Any
) -> dict[str, Any]:
    """Parameters of the notebook of the article."""
    return {
        "title": "Closed-loop identification of ankle dynamics: a replication",
        "studies": {
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
        },
        **shared,
    }
