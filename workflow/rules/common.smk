# The configuration, the studies that it describes, and what several rules take of them.
import hashlib
import json
import os
import sys

from ankleloop_lab.checking import ConfigError
from ankleloop_workflow.config.notebooks import list_figures, read_notebooks
from ankleloop_workflow.jobs.fingerprint import fingerprint
from ankleloop_workflow.config.run import (
    complete_config,
    describe_article,
    read_run,
    report_parameters,
)
from ankleloop_workflow.config.study import RecordedStudy, SimulatedStudy
from snakemake.logging import logger

# Jobs keep the memory that they have freed: the first touch of new memory can cost more than the numbers in it.
os.environ.setdefault("MALLOC_MMAP_THRESHOLD_", str(2**30))
os.environ.setdefault("MALLOC_TRIM_THRESHOLD_", str(2**31))

NOTEBOOKS = read_notebooks(ROOT / "notebooks" / "notebooks.yaml")
try:
    CONFIG, STUDIES = read_run(
        config,
        CONFIG_FILES,
        workflow.config_settings.config,
        NOTEBOOKS,
        identify=workflow.is_main_process,
    )
except ConfigError as error:
    # Without the traceback that Snakemake would show.
    sys.exit(f"Configuration: {error}")
if workflow.is_main_process and describe_article(CONFIG):
    logger.info(describe_article(CONFIG))
RUN = [STUDIES[name] for name in CONFIG.run_names]
ARTICLE = [STUDIES[name] for name in CONFIG.article_names]
DIAGRAMS = [
    f"{name}.{end}" for name in ("figure1", "figure2") for end in ("png", "pdf", "svg")
]
SIMULATED = {s.name: s for s in STUDIES.values() if isinstance(s, SimulatedStudy)}


def alternatives(names):
    """Regular expression of some names; of none it matches nothing."""
    return "|".join(sorted(names)) or "(?!)"


def names_keeping(*kinds):
    """Expression of the simulated studies that keep everything, estimates or scores on disk."""
    return alternatives(
        name for name, study in SIMULATED.items() if study.settings.keep in kinds
    )


RECORDED = alternatives(set(STUDIES) - set(SIMULATED))


wildcard_constraints:
    study=alternatives(STUDIES),
    chunk=r"\d+",
    figure=alternatives(
        {
            name
            for book in NOTEBOOKS.values()
            for name in [*book.figures, *book.conditional]
        }
    ),


def library(*paths):
    """Fingerprint of the library code that scripts and notebooks use."""
    return fingerprint(*(ROOT / path for path in paths))


def local_cores():
    """Cores of a local run; one in the jobs of a cluster, whose scheduler shares out the cores."""
    return 1 if workflow.remote_exec else max(1, workflow.resource_settings.cores or 1)


def repository_file(path):
    """A file of the repository; `local` says that it is never in the storage of the results."""
    return local(str(ROOT / path))


def published_file(name):
    """What a paper says."""
    return repository_file(f"data/published/{name}")


def study_of(wildcards):
    return STUDIES[wildcards.study]


def title_of(wildcards):
    return study_of(wildcards).title


def of_report(path, result):
    """A result of a study in Snakemake's report, with the text of its rule as caption."""
    caption = "../report/study.rst"
    labels = {"result": result}
    return report(path, category=title_of, caption=caption, labels=labels)


def notebook_of(wildcards):
    """Notebook that renders a study, as the list of notebooks describes it."""
    return NOTEBOOKS[study_of(wildcards).settings.notebook]


def published_of(wildcards):
    """What papers say that the notebook of a study reads."""
    return list(map(published_file, notebook_of(wildcards).published))


def ledger_of(wildcards):
    """The ledger, and the texts that rest on it, where the run makes it and the notebook of a study reads it."""
    is_read = ARTICLE and "ledger" in notebook_of(wildcards).reads
    files = map(repository_file, ("data/conclusions.yaml", "data/findings.yaml"))
    return ["results/verification.csv", *files] if is_read else []


def notebook_file(wildcards):
    return f"notebooks/{study_of(wildcards).settings.notebook}.ipynb"


def captions_of(study):
    """Captions of the figures of a study by name."""
    return list_figures(study, NOTEBOOKS.get(study.settings.notebook))


def chunk_files(kind, study):
    """Files of all chunks of a study."""
    folder = f"results/{kind}/{study.name}"
    return [f"{folder}/{chunk}.parquet" for chunk in range(len(study.chunks))]


def trial_files(study):
    """Trial files of a study; none where no trials are kept."""
    folder = f"results/trials/{study.name}"
    return [f"{folder}/{chunk}.nc" for chunk in range(len(study.trial_files))]


def trial_file_of(wildcards):
    """Trial file that holds the trials of a chunk; none where no trials are kept."""
    study = study_of(wildcards)
    if study.settings.keep != "everything":
        return []
    number = study.file_numbers[int(wildcards.chunk)]
    return f"results/trials/{study.name}/{number}.nc"


def trials_in_file(wildcards):
    """Trials of a trial file, as they are simulated."""
    study = study_of(wildcards)
    return study.simulation(study.trial_files[int(wildcards.chunk)])


def identification_of(wildcards):
    """What a job identifies."""
    return study_of(wildcards).identification(int(wildcards.chunk))


def prediction_of(wildcards):
    """What is predicted of a study."""
    return study_of(wildcards).prediction(notebook_of(wildcards).predictions)


def table_file(study):
    """Table of all trials of a study."""
    return f"results/tables/{study.name}-trials.parquet"


def prediction_files(study):
    """Table of what is predicted of a study, where its notebook reads it."""
    book = NOTEBOOKS.get(study.settings.notebook)
    path = f"results/tables/{study.name}-predictions.parquet"
    return [path] if book and book.predictions else []


def tables_of(wildcards):
    """Tables that the notebook of a study reads."""
    study = study_of(wildcards)
    if isinstance(study, RecordedStudy):
        return chunk_files("scores", study)
    return [table_file(study), *prediction_files(study)]


def trials_of(wildcards):
    """Trial files that the notebook of a study reads."""
    is_read = "trials" in notebook_of(wildcards).reads
    return trial_files(study_of(wildcards)) if is_read else []


def estimates_of(wildcards):
    """Estimates that the notebook of a study reads; of recordings the folder of their pages, to which it links."""
    study = study_of(wildcards)
    if isinstance(study, RecordedStudy):
        return f"results/reports/{study.name}"
    is_read = "estimates" in notebook_of(wildcards).reads
    return chunk_files("estimates", study) if is_read else []


def figure_files(study):
    """Figures of a study, as PNG."""
    return [f"results/figures/{study.name}-{name}.png" for name in captions_of(study)]


def article_files(study, folder):
    """Files of a study that the article shows; results may be in a folder into which a storage copies them."""
    return {
        "table_file": folder + table_file(study),
        "summary": f"{folder}results/tables/{study.name}.csv",
        "figures": {
            name: f"{folder}results/figures/{study.name}-{name}.png"
            for name in captions_of(study)
        },
    }


def describe_sources(input, output):
    """What the article shows."""
    folder = input.economy.removesuffix("results/tables/economy.csv")
    sources = {
        "title": "Closed-loop identification of ankle dynamics: a replication",
        "studies": {
            study.name: {**study.describe(), **article_files(study, folder)}
            for study in ARTICLE
        },
        "verification": input.verification,
        "conclusions": input.conclusions,
        "economy": input.economy,
        "diagrams": [path for path in output.diagrams if path.endswith(".png")],
    }
    return {"article": sources}


def recording_tables():
    """Tables of scores of all recordings."""
    return [
        path
        for study in RUN
        if isinstance(study, RecordedStudy)
        for path in chunk_files("scores", study)
    ]


def targets():
    """Everything that the studies of a run make."""
    paths = []
    for study in RUN:
        if isinstance(study, RecordedStudy):
            paths.append(f"results/reports/{study.name}")
        else:
            paths += [table_file(study), *prediction_files(study)]
        if study.settings.notebook:
            paths += [f"results/reports/{study.name}.html", *figure_files(study)]
            paths.append(f"results/notebooks/{study.name}.ipynb")
        elif isinstance(study, RecordedStudy):
            paths += chunk_files("scores", study)
    return [*paths, "results/article.html"] if ARTICLE else paths


def digest(*settings):
    """Hash of settings, as a parameter of a job that runs again where they have changed.

    The settings themselves are a parameter that is a function of `output`, too: Snakemake does not compare those, and a
    dry run does not print them.
    """
    text = json.dumps(settings, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


# Memory [MB] and time [min] of jobs, for schedulers: a new attempt asks for more. No job of usual trials takes half of it.
def memory(wildcards, attempt):
    return 2000 * attempt


def half_hour(wildcards, attempt):
    return 30 * attempt
