"""What the workflow makes of the studies: their figures, the parameters of their notebooks, the article."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ankleloop.studies.config import NOTEBOOKS, Config
from ankleloop.studies.study import SimulatedStudy, Study

FILES = ("trials", "estimates", "scores", "parameters")
MOST_TEXT_ROWS = 10_000  # of a table of trials that is written as CSV, too


def figure_names(study: Study) -> tuple[str, ...]:
    """Names of the figures of a study; none without a notebook, no singular values where no method has them."""
    names = NOTEBOOKS[study.settings.notebook] if study.settings.notebook else ()
    has_singular_values = any(algorithm.endswith("moesp") for algorithm in study.algorithms.values())
    return tuple(name for name in names if name != "order" or has_singular_values)


def shows_sweep(study: Study) -> bool:
    """Whether the notebook of a study shows a sweep: it reads the table of all trials alone."""
    return study.settings.notebook == "sweep"


def count_rows(study: SimulatedStudy) -> int:
    """Rows of the table of the trials of a study: one for each point, method and trial."""
    return len(study.point_list) * len(study.methods) * study.settings.trials


def run_studies(config: Config, studies: Mapping[str, Study]) -> list[Study]:
    """The studies that are to be made."""
    return [studies[name] for name in config.run_names]


def article_studies(config: Config, studies: Mapping[str, Study]) -> list[SimulatedStudy]:
    """Studies that the ledger and the article are made of; none where one of them is not made."""
    return [study for name in config.article_names if isinstance(study := studies[name], SimulatedStudy)]


def report_parameters(
    study: Study,
    files: Mapping[str, Iterable[str]],
    *,
    published: str,
    table_stem: str,
    figure_stem: str,
    table_file: str = "",
) -> dict[str, Any]:
    """Parameters of the notebook of a study: what `ankleloop.pages.study_page.StudyPage` holds."""
    parameters = {
        "study": study.name,
        "kind": study.kind,
        "title": study.title,
        "labels": study.labels,
        "algorithms": study.algorithms,
        "points": study.points if not shows_sweep(study) else {},
        "varied": study.varied,
        "figure": study.settings.figure.model_dump(),
        "published": published,
        "table_stem": table_stem,
        "figure_stem": figure_stem,
        "table_file": table_file,
        **{name: list(files.get(name, ())) for name in FILES},
    }
    if isinstance(study, SimulatedStudy) and shows_sweep(study):
        shared = study.settings.simulation.model_dump()
        parameters |= {"settings": shared, "sweep": study.settings.sweep.model_dump()}
    return {"study": parameters}


def article_parameters(
    studies: Sequence[SimulatedStudy], files: Mapping[str, Mapping[str, Any]], **shared: Any
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
