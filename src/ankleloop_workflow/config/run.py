"""The configuration of a run, checked before its first job; what its notebooks need, and what they are given."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ankleloop.errors import DataError
from ankleloop.joint.regressors import decimation_grid
from ankleloop.options import suggest_name
from ankleloop.signals.decimation import usual_rate
from ankleloop.trials.files import PathLike
from ankleloop_lab.checking import ConfigError, Values
from ankleloop_workflow.config.files import find_key, key_error
from ankleloop_workflow.config.notebooks import Notebook, find_needs, list_figures, read_notebooks
from ankleloop_workflow.config.settings import Config
from ankleloop_workflow.config.study import RecordedStudy, SimulatedStudy, Study, read_studies

ENOUGH = 15.0  # s of a record, with which every method can do


def read_run(
    config: Mapping[str, Any],
    paths: Sequence[PathLike],
    command_line: Mapping[str, Any] | None = None,
    notebooks: Mapping[str, Notebook] | None = None,
    *,
    identify: bool = False,
) -> tuple[Config, dict[str, Study]]:
    """Read the configuration of a run, and refuse what a job would refuse; by default with the notebooks of here.

    With `identify` also records that are too short for a method, which takes seconds where there are short ones.
    """
    notebooks = read_notebooks() if notebooks is None else notebooks
    try:
        checked, studies = read_studies(config)
        for name in checked.run_names:
            study = studies[name]
            if isinstance(study, RecordedStudy):
                study.check_files()
            elif isinstance(study, SimulatedStudy):
                check_uses(study)
                if identify:
                    check_shortest(study)
            check_notebook(study, notebooks)
    except ConfigError as error:
        paths = [min(os.path.relpath(path), os.path.abspath(path), key=len) for path in paths]
        is_given = error.keys and error.keys[0] in (command_line or {})
        place = "--config" if is_given else find_key(error.keys, paths)
        raise ConfigError(f"{place}: {error}" if place else str(error), error.keys) from None
    return checked, studies


def complete_config(config: Config, studies: Mapping[str, Study]) -> Values:
    """The configuration with all defaults, which a run can read again.

    Without those of what a study does not use: options that are selected, that differ between its points or follow
    from the sampling rate; pictures of a sweep, and a window that its trials may not have.
    """
    values = config.model_dump(mode="json", by_alias=True)
    for name, study in studies.items():
        written = values["studies"][name]
        for part in {"figure", "sweep"} & written.keys():
            del written[part]
            if part in study.settings.model_fields_set:
                written[part] = getattr(study.settings, part).model_dump(exclude_unset=True)
        points = study.point_list if isinstance(study, SimulatedStudy) else ()
        for key, method in study.methods.items():
            varied = {option for point in points for option in point.options.get(key, {})}
            kept = method.fixed_options.keys() - varied
            options = written["methods"][key]["options"]
            written["methods"][key]["options"] = {
                option: options[option] for option in options if option in kept
            }
    return values


def describe_article(config: Config) -> str:
    """Sentence that says why a run does not make the ledger and the article; empty if it does, or none is wanted."""
    missing = ", ".join(name for name in config.article if name not in config.run_names)
    if not missing:
        return ""
    return f"The ledger and the article are not made, because run leaves out studies of article: {missing}."


def check_uses(study: SimulatedStudy) -> None:
    """Refuse a method, a window of figures or a notebook for which the points of a study leave nothing."""
    settings = study.settings
    figure = settings.figure
    place = ("studies", study.name)
    _check_methods(study)
    end = min(condition["duration"] for condition in study.conditions.values())
    if figure.start >= end and "start" in figure.model_fields_set:
        raise key_error(
            (*place, "figure", "start"),
            f"{figure.start:g} s is after the end of trials of {end:g} s.",
        )
    if settings.notebook == "sweep" or "sweep" in settings.model_fields_set:
        try:
            settings.sweep.check(study.varied, study.methods)
        except ValueError as error:
            raise key_error((*place, "sweep"), f"{error}.") from None


def check_notebook(study: Study, notebooks: Mapping[str, Notebook]) -> None:
    """Refuse a notebook that there is not, or that lacks something in the study."""
    name = study.settings.notebook
    kind = study.settings.kind
    place = ("studies", study.name, "notebook")
    if name is None:
        return
    known = [other for other, notebook in notebooks.items() if notebook.kind == kind]
    if name not in known:
        raise key_error(
            place,
            f"there is no notebook {name!r} for {kind}{suggest_name(name, known)}; there are {', '.join(known)}.",
        )
    if isinstance(study, SimulatedStudy):
        lacks = find_needs(study)
        for need in notebooks[name].needs:
            if need in lacks:
                raise key_error(place, f"{name} needs {lacks[need]}.")


def check_shortest(study: SimulatedStudy) -> None:
    """Refuse records that are too short for a method: the shortest ones are identified without noise."""
    durations = {name: values["duration"] for name, values in study.conditions.items()}
    shortest = min(durations, key=durations.__getitem__)
    if durations[shortest] >= ENOUGH:
        return
    # Here: with longer records a run begins without them.
    from ankleloop.methods.registry import identify
    from ankleloop.simulation.simulate import simulate

    clean = {"voluntary": 0.0, "snr_db": None}
    trial = simulate(seed=study.settings.seed, **{**study.conditions[shortest], **clean})
    for point in study.point_list:
        if point.condition != shortest:
            continue
        for name, method in study.methods.items():
            options = {**method.fixed_options, **point.options.get(name, {})}
            try:
                identify(trial, method.method, **options)
            except DataError as error:
                raise key_error(
                    ("studies", study.name, "methods", name),
                    f"it identifies no record as short as those of the point {point.name}: {error}",
                ) from None


def _check_methods(study: SimulatedStudy) -> None:
    """Refuse options with which a method could identify no trial."""
    place = ("studies", study.name)
    for point in study.point_list:
        condition = study.conditions[point.condition]
        rate = condition["recording_rate"]
        samples = round(condition["duration"] * rate)
        for name, method in study.methods.items():
            options = {**method.fixed_options, **point.options.get(name, {})}
            if "identification_rate" not in type(method.options).model_fields:
                continue
            identification_rate = options.get("identification_rate", usual_rate(rate))
            delay = options.get("delay") or 0.0
            try:
                decimation_grid(samples, rate, identification_rate, delay)
            except DataError as error:
                raise key_error(
                    (*place, "methods", name, "options"), f"at the point {point.name}: {error}"
                ) from None


def report_parameters(
    study: Study, notebook: Notebook, files: Mapping[str, Iterable[str]], **places: str
) -> Values:
    """Parameters of the notebook of a study: what `ankleloop_workflow.pages.study_page.StudyPage` holds.

    `files` are its trials, estimates and tables, that of all trials before that of predictions; `places` are
    `published`, `table_stem`, `figure_stem`.
    """
    tables = list(files.get("tables", ()))
    parameters = {
        **study.describe(),
        "figures": list(list_figures(study, notebook)),  # that it may draw
        # A file of trials and one of estimates for each chunk of points; the ledger with its conclusions and findings.
        **{kind: list(files.get(kind, ())) for kind in ("trials", "estimates", "ledger")},
        **places,
    }
    if "points" not in notebook.reads:
        parameters["points"] = {}
    if isinstance(study, SimulatedStudy):
        parameters |= zip(("table_file", "prediction_file"), tables, strict=False)
    else:
        parameters["tables"] = tables
    return {"study": parameters}
