"""The configuration of a run, checked before its first job; what its notebooks need, and what they are given."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ankleloop.config.checking import ConfigError, find_key, key_error
from ankleloop.config.points import SIMULATION
from ankleloop.config.settings import NOTEBOOKS, Config
from ankleloop.config.study import RecordedStudy, SimulatedStudy, Study, read_studies
from ankleloop.errors import DataError
from ankleloop.joint.regressors import decimation_grid
from ankleloop.quantities import SETTINGS


def read_run(
    config: Mapping[str, Any],
    paths: Sequence[str | os.PathLike[str]],
    command_line: Mapping[str, Any] | None = None,
) -> tuple[Config, dict[str, Study]]:
    """Read the configuration of a run, and refuse what a job would refuse."""
    try:
        checked, studies = read_studies(config)
        for study in map(studies.__getitem__, checked.run_names):
            if isinstance(study, RecordedStudy):
                study.check_files()
            elif isinstance(study, SimulatedStudy):
                check_uses(study)
    except ConfigError as error:
        paths = [min(os.path.relpath(path), os.path.abspath(path), key=len) for path in paths]
        is_given = error.keys and error.keys[0] in (command_line or {})
        place = "--config" if is_given else find_key(error.keys, paths)
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
    start, end = (
        settings.figure.start,
        min(condition["duration"] for condition in study.conditions.values()),
    )
    if start >= end and "start" in settings.figure.model_fields_set:
        raise key_error(
            (*place, "figure", "start"), f"{start:g} s is after the end of trials of {end:g} s."
        )
    if settings.notebook == "sweep" or "sweep" in settings.model_fields_set:
        try:
            settings.sweep.check(study.varied, study.methods)
        except ValueError as error:
            raise key_error((*place, "sweep"), f"{error}.") from None
    if need := find_need(study):
        raise key_error((*place, "notebook"), f"{settings.notebook} needs {need}.")


def _check_methods(study: SimulatedStudy) -> None:
    """Refuse options with which a method could identify no trial, or whose estimates could not be in one file."""
    place = ("studies", study.name)
    for point in study.point_list:
        duration, rate = (
            study.conditions[point.condition][name] for name in ("duration", "recording_rate")
        )
        for name, method in study.methods.items():
            options = {**method.fixed_options, **point.options.get(name, {})}
            rows, order = options.get("block_rows"), options.get("order") or 1
            fault = (
                f"block_rows must be larger than the order ({order}), got {rows}."
                if rows and rows <= order
                else ""
            )
            if "identification_rate" in options:
                delay = options.get("delay") or 0.0
                try:
                    decimation_grid(
                        round(duration * rate), rate, options["identification_rate"], delay
                    )
                except DataError as error:
                    fault = str(error)
            if fault:
                raise key_error(
                    (*place, "methods", name, "options"), f"at the point {point.name}: {fault}"
                )
    for column, parameter in study.parameters.items():
        is_rate = parameter.field == "identification_rate" and SIMULATION not in parameter.owners
        if is_rate and study.settings.keep != "scores":
            message = "estimates of different rates are not kept in one file: set keep: scores."
            raise key_error((*place, "points", column), message)


def find_need(study: SimulatedStudy) -> str:
    """What the notebook of a study needs and the study lacks; empty where it has everything."""
    keep, varied, methods = study.settings.keep, study.varied, study.methods
    names = ", ".join(varied) or "none"
    options = [
        name for name, parameter in study.parameters.items() if SIMULATION not in parameter.owners
    ]
    axis = next(
        (name for name in varied if name != "closed_loop"), ""
    )  # the loops have curves of their own
    numbers = axis and all(
        isinstance(settings[axis], (int, float)) for settings in study.points.values()
    )
    used = [method.method for method in methods.values()]
    searches = any(
        m.method == "riv" and m.fixed_options.get("delay", 0.0) is None for m in methods.values()
    )
    has_stop_rule = any(name.startswith("parallel-cascade") for name in methods)
    needs = {
        "trials": (
            keep == "everything",
            f"trials on disk, which keep: {keep} leaves out: set keep: everything",
        ),
        "estimates": (
            keep != "scores",
            "estimates on disk, which keep: scores leaves out: keep estimates",
        ),
        "one setting": (
            len(varied) == 1,
            f"one setting that differs between the points, got {names}",
        ),
        "two settings": (len(varied) > 1, f"two settings or more that differ, got {names}"),
        "settings": (
            not options,
            f"points that differ in settings of the simulation alone, got {', '.join(options)}",
        ),
        "numbers": (
            numbers,
            f"a setting beside closed_loop that differs, with numbers as values, got {names}",
        ),
        "truths": (
            not study.settings.against,
            "scores against the true torques: leave out against: measured",
        ),
        "shared truths": (
            not set(varied) & {SETTINGS[name] for name in ("K", "B", "I", "G")},
            f"points with the same stiffness, viscosity, inertia and reflex gain, got {names}",
        ),
        "real-time": (used == ["real-time"], f"one method, real-time, got {', '.join(used)}"),
        "cascade": ("parallel-cascade" in used, "a method parallel-cascade"),
        "stop rule": (
            has_stop_rule,
            "a method whose name begins with parallel-cascade, for its stop rule",
        ),
        "delay": (
            searches,
            "a method riv with the option delay: null, whose delay has an interval",
        ),
        "select": (all(method.select for method in methods.values()), "select for every method"),
        "variation": (
            all(p["variation"] for p in study.points.values()),
            "variation (of K, B and G) at every point",
        ),
        "trajectories": ("riv-tv" in used, "a method riv-tv, for its trajectories"),
    }
    needed = NOTEBOOKS[study.settings.notebook].needs if study.settings.notebook else ()
    return next((needs[name][1] for name in needed if not needs[name][0]), "")


def report_parameters(
    study: Study, files: Mapping[str, Iterable[str]], **places: str
) -> dict[str, Any]:
    """Parameters of the notebook of a study: what `ankleloop.pages.study_page.StudyPage` holds.

    `files` are its trials, estimates and tables; `places` are `published`, `table_stem`, `figure_stem`.
    """
    settings, is_simulated = study.settings, isinstance(study, SimulatedStudy)
    tables = list(files.get("tables", ()))
    parameters = {
        "study": study.name,
        "title": study.title,
        "labels": study.labels,  # of the methods
        # Of each method its name in the registry.
        "algorithms": {name: method.method for name, method in study.methods.items()},
        "points": study.points
        if NOTEBOOKS[settings.notebook].needs
        else {},  # the others read tables alone
        "varied": list(study.varied),  # settings that differ between points
        "figure": settings.figure.model_dump(),  # what figures of single trials show
        # A file of trials and one of estimates for each chunk of points; one table of all trials, or of recordings one
        # for each chunk.
        **{kind: list(files.get(kind, ())) for kind in ("trials", "estimates")},
        **({"table_file": "".join(tables)} if is_simulated else {"tables": tables}),
        **places,
    }
    if settings.notebook == "sweep":  # settings that all points share, and what its pictures show
        parameters |= {
            "settings": settings.simulation.model_dump(),
            "sweep": settings.sweep.model_dump(),
        }
    return {"study": parameters}


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
    return {
        "title": "Closed-loop identification of ankle dynamics: a replication",
        "studies": described,
        **shared,
    }
