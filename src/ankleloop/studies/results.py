"""What the workflow makes of the studies: their figures, the parameters of their notebooks, the article."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ankleloop.studies.config import NOTEBOOKS, Config
from ankleloop.studies.study import SimulatedStudy, Study

__all__ = [
    "article_parameters",
    "article_studies",
    "figure_names",
    "report_parameters",
    "run_studies",
]

FILES = ("trials", "estimates", "scores", "parameters")


def figure_names(study: Study) -> tuple[str, ...]:
    """Names of the figures of a study; none without a notebook."""
    return NOTEBOOKS[study.settings.notebook] if study.settings.notebook else ()


def run_studies(config: Config, studies: Mapping[str, Study]) -> list[Study]:
    """The studies that are to be made."""
    return [studies[name] for name in config.run_names]


def article_studies(config: Config, studies: Mapping[str, Study]) -> list[SimulatedStudy]:
    """Studies that the ledger and the article are made of; none where one of them is not made."""
    return [study for name in config.article_names if isinstance(study := studies[name], SimulatedStudy)]


def report_parameters(
    study: Study, files: Mapping[str, Iterable[str]], *, published: str, table_stem: str, figure_stem: str
) -> dict[str, Any]:
    """Parameters of the notebook of a study; every notebook takes the same.

    Parameters
    ----------
    study : Study
        The study.
    files : mapping of str to iterable of str
        Chunk files of its `trials`, `estimates`, `scores` and `parameters`; recordings have parameters alone.
    published : str
        Folder of the numbers of the paper.
    table_stem, figure_stem : str
        Paths of the table and of the figures to write, without suffix and without the name of the figure.

    Returns
    -------
    dict
    """
    return {
        "study": study.name,
        "kind": study.kind,
        "title": study.settings.title,
        "labels": study.labels,
        "points": study.points,
        "varied": study.varied,
        "figure": study.settings.figure.model_dump(),
        "published": published,
        "table_stem": table_stem,
        "figure_stem": figure_stem,
        **{name: list(files.get(name, ())) for name in FILES},
    }


def article_parameters(
    studies: Sequence[SimulatedStudy], files: Mapping[str, Mapping[str, Any]], **shared: Any
) -> dict[str, Any]:
    """Parameters of the notebook of the article.

    Parameters
    ----------
    studies : sequence of SimulatedStudy
        Studies of the article.
    files : mapping of str to mapping
        Files of each study by name.
    **shared
        Files of all of them: `verification`, `economy` and `diagrams`.

    Returns
    -------
    dict
    """
    return {
        "title": "Closed-loop identification of ankle dynamics: a replication",
        "studies": {
            study.name: {
                "title": study.settings.title,
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
