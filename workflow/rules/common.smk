# The configuration, the studies that it describes, and what several rules take of them.
import os
import sys

from ankleloop.studies.checking import ConfigError
from ankleloop.studies.notebooks import NOTEBOOKS
from ankleloop.studies.fingerprint import fingerprint
from ankleloop.studies.results import (
    article_parameters,
    article_studies,
    figure_names,
    report_parameters,
    run_studies,
)
from ankleloop.studies.run_config import describe_article, read_run
from ankleloop.studies.study import RecordedStudy, SimulatedStudy
from snakemake.logging import logger

# Jobs keep the memory that they have freed: the first touch of new memory can cost more than the numbers in it.
os.environ.setdefault("MALLOC_MMAP_THRESHOLD_", str(2**30))
os.environ.setdefault("MALLOC_TRIM_THRESHOLD_", str(2**31))

try:
    CONFIG, STUDIES = read_run(config, CONFIG_FILES, workflow.config_settings.config)
except ConfigError as error:
    sys.exit(
        f"Configuration: {error}"
    )  # without the traceback that Snakemake would show
if workflow.is_main_process and describe_article(CONFIG):
    logger.info(describe_article(CONFIG))
ARTICLE = article_studies(CONFIG, STUDIES)
DIAGRAMS = ["figure1", "figure2"]
PUBLISHED = sorted((ROOT / "data" / "published").glob("*.csv"))


def alternatives(names):
    """Regular expression of some names; of none it matches nothing."""
    return "|".join(names) or "(?!)"


SIMULATED = alternatives(
    name for name, study in STUDIES.items() if isinstance(study, SimulatedStudy)
)
RECORDED = alternatives(
    name for name, study in STUDIES.items() if isinstance(study, RecordedStudy)
)


wildcard_constraints:
    study=alternatives(STUDIES),
    chunk=r"\d+",
    figure=alternatives({name for names in NOTEBOOKS.values() for name in names}),


def library(*paths):
    """Fingerprint of the library code that scripts and notebooks use."""
    return fingerprint(*(ROOT / path for path in paths))


def study_of(wildcards):
    return STUDIES[wildcards.study]


def chunk_of(wildcards):
    return int(wildcards.chunk)


def chunks(wildcards):
    """Numbers of the chunks of a study."""
    return range(len(study_of(wildcards).chunks))


def simulated_chunks(wildcards):
    """Numbers of the chunks of a study of simulations; recordings have no trial files and no scores."""
    return chunks(wildcards) if isinstance(study_of(wildcards), SimulatedStudy) else []


def identification_time(wildcards):
    """Time that the methods of a chunk take, in proportion."""
    study = study_of(wildcards)
    return study.simulated_time(chunk_of(wildcards)) * len(study.methods)


def simulation_priority(wildcards):
    """Above that of any identification."""
    return 1e9 + study_of(wildcards).simulated_time(chunk_of(wildcards))


def notebook_of(wildcards):
    """Notebook that renders a study."""
    return f"notebooks/{study_of(wildcards).settings.notebook}.ipynb"


def title_of(wildcards):
    return study_of(wildcards).settings.title


def estimates_of(wildcards):
    """Estimate files of a study; of recordings the folder of their pages, to which their notebook links."""
    study = study_of(wildcards)
    if isinstance(study, SimulatedStudy):
        return chunk_files("estimates", study, "nc")
    return f"results/reports/{study.name}"


def chunk_files(kind, study, suffix="csv"):
    """Files of all chunks of a study."""
    return [
        f"results/{kind}/{study.name}/{chunk}.{suffix}"
        for chunk in range(len(study.chunks))
    ]


def chunk_files_of_article(kind):
    """Files of all chunks of all studies of the article."""
    return [path for study in ARTICLE for path in chunk_files(kind, study)]


def figure_files(study):
    """Figures of a study, as PNG."""
    return [f"results/figures/{study.name}-{name}.png" for name in figure_names(study)]


def article_files(study):
    """Files of a study that the article shows."""
    return {
        "scores": chunk_files("scores", study),
        "estimates": chunk_files("parameters", study),
        "table": f"results/tables/{study.name}.csv",
        "report": f"results/reports/{study.name}.html",
        "figures": figure_files(study),
    }


def targets():
    """Everything that the studies of a run make."""
    paths = []
    for study in run_studies(CONFIG, STUDIES):
        if isinstance(study, RecordedStudy):
            paths.append(f"results/reports/{study.name}")
        if study.settings.notebook:
            paths += [f"results/reports/{study.name}.html", *figure_files(study)]
        else:
            paths += chunk_files("parameters", study)
    return [*paths, "results/article.html"] if ARTICLE else paths
