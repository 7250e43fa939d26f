"""What the notebooks of studies and of the article are given."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ankleloop.studies.study import SimulatedStudy, Study


def shows_sweep(study: Study) -> bool:
    """Whether the notebook of a study shows a sweep: it reads the table of all trials alone."""
    return study.settings.notebook == "sweep"


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
