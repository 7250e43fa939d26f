# The configuration, the studies that it describes, and what several rules take of them.
import os
import sys
from functools import cache

from ankleloop.studies.checking import ConfigError
from ankleloop.studies.notebooks import NOTEBOOKS
from ankleloop.studies.fingerprint import fingerprint
from ankleloop.studies.job_resources import describe_chunk, describe_tables
from ankleloop.studies.results import (
    MOST_TEXT_ROWS,
    article_parameters,
    article_studies,
    count_rows,
    figure_names,
    report_parameters,
    run_studies,
    shows_sweep,
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
# Files of the repository; `local` says that they are never in the storage of the results.
PUBLISHED = [
    local(str(path)) for path in sorted((ROOT / "data" / "published").glob("*.csv"))
]
# Numbers and claims of the paper that is replicated, which the ledger checks; other files hold numbers of other papers.
OF_PAPER = [
    path for path in PUBLISHED if Path(path).stem in ("claims", "table1", "table2")
]


def alternatives(names):
    """Regular expression of some names; of none it matches nothing."""
    return "|".join(names) or "(?!)"


# Studies of simulations by what they keep on disk.
KEPT = {
    keep: alternatives(
        name
        for name, study in STUDIES.items()
        if isinstance(study, SimulatedStudy) and study.settings.keep == keep
    )
    for keep in ("everything", "estimates", "scores")
}
RECORDED = alternatives(
    name for name, study in STUDIES.items() if isinstance(study, RecordedStudy)
)

# Studies whose table of all trials is small: it is written as CSV, too.
SMALL = [
    study.name
    for study in run_studies(CONFIG, STUDIES)
    if isinstance(study, SimulatedStudy) and count_rows(study) <= MOST_TEXT_ROWS
]


wildcard_constraints:
    study=alternatives(STUDIES),
    chunk=r"\d+",
    figure=alternatives({name for names in NOTEBOOKS.values() for name in names}),


def library(*paths):
    """Fingerprint of the library code that scripts and notebooks use."""
    return fingerprint(*(ROOT / path for path in paths))


def local_cores():
    """Cores of a local run; one in the jobs of a cluster, whose scheduler shares out the cores."""
    return 1 if workflow.remote_exec else max(1, workflow.resource_settings.cores or 1)


def study_of(wildcards):
    return STUDIES[wildcards.study]


def chunk_of(wildcards):
    return int(wildcards.chunk)


def chunks(wildcards):
    """Numbers of the chunks of a study."""
    return range(len(study_of(wildcards).chunks))


def identification_time(wildcards):
    """Time that the methods of a chunk take, in proportion."""
    study = study_of(wildcards)
    return study.simulated_time(chunk_of(wildcards)) * len(study.methods)


def simulation_priority(wildcards):
    """Above that of any identification."""
    study = study_of(wildcards)
    return 1e9 + study.simulated_time(chunk_of(wildcards), stored=True)


def notebook_of(wildcards):
    """Notebook that renders a study."""
    return f"notebooks/{study_of(wildcards).settings.notebook}.ipynb"


def repository_file(path):
    """A file of the repository, wherever the results are stored."""
    return local(str(ROOT / path))


def title_of(wildcards):
    return study_of(wildcards).title


def estimates_of(wildcards):
    """Estimate files of a study, if it keeps them; of recordings the folder of their pages, to which their notebook links."""
    study = study_of(wildcards)
    if isinstance(study, SimulatedStudy):
        has_files = study.settings.keep != "scores"
        return chunk_files("estimates", study, "parquet") if has_files else []
    return f"results/reports/{study.name}"


def chunk_files(kind, study, suffix="csv"):
    """Files of all chunks of a study."""
    return [
        f"results/{kind}/{study.name}/{chunk}.{suffix}"
        for chunk in range(len(study.chunks))
    ]


def trial_files(study):
    """Trial files of a study; none of recordings, and where no trials are kept."""
    count = len(study.trial_chunks) if isinstance(study, SimulatedStudy) else 0
    return [f"results/trials/{study.name}/{number}.nc" for number in range(count)]


def trial_files_of(wildcards):
    return trial_files(study_of(wildcards))


def trial_file_of(wildcards):
    """Trial file that holds the trials of a chunk."""
    number = study_of(wildcards).trial_chunk_of(chunk_of(wildcards))
    return f"results/trials/{wildcards.study}/{number}.nc"


def trial_table_files(study):
    """Files of the table of all trials of a study; none of recordings."""
    if isinstance(study, RecordedStudy):
        return []
    suffixes = ["parquet", "csv"] if study.name in SMALL else ["parquet"]
    return [f"results/tables/{study.name}-trials.{suffix}" for suffix in suffixes]


def trial_table_of(wildcards):
    """Table of all trials of a study, as Parquet."""
    return trial_table_files(study_of(wildcards))[:1]


def score_files_of(wildcards):
    """Scores of a study; recordings have none."""
    study = study_of(wildcards)
    return chunk_files("scores", study) if isinstance(study, SimulatedStudy) else []


def parameter_files_of(wildcards):
    return chunk_files("parameters", study_of(wildcards))


def unless_sweep(files):
    """Files of a study for its notebook; that of a sweep reads the table of all trials alone."""
    return lambda wildcards: (
        [] if shows_sweep(study_of(wildcards)) else files(wildcards)
    )


def chunk_files_of_article(kind):
    """Files of all chunks of all studies of the article."""
    return [path for study in ARTICLE for path in chunk_files(kind, study)]


def figure_files(study):
    """Figures of a study, as PNG."""
    return [f"results/figures/{study.name}-{name}.png" for name in figure_names(study)]


def article_files(study, folder):
    """Files of a study that the article shows; results may be in a folder into which a storage copies them."""
    files = {
        "scores": chunk_files("scores", study),
        "estimates": chunk_files("parameters", study),
        "table": f"results/tables/{study.name}.csv",
        "report": f"results/reports/{study.name}.html",
        "figures": figure_files(study),
    }
    return {
        name: (
            folder + item if isinstance(item, str) else [folder + path for path in item]
        )
        for name, item in files.items()
    }


def targets():
    """Everything that the studies of a run make."""
    paths = []
    for study in run_studies(CONFIG, STUDIES):
        if isinstance(study, RecordedStudy):
            paths.append(f"results/reports/{study.name}")
        if study.settings.notebook:
            paths += [f"results/reports/{study.name}.html", *figure_files(study)]
        if isinstance(study, SimulatedStudy):
            paths += trial_table_files(study)
        elif not study.settings.notebook:
            paths += chunk_files("parameters", study)
    return [*paths, "results/article.html"] if ARTICLE else paths


# Memory and time of jobs, for schedulers: a new attempt asks for more.
@cache
def chunk_resources(task, study, chunk):
    return describe_chunk(STUDIES[study], task, chunk)


def chunk_memory(task):
    """Memory of the job of a chunk [MB]."""
    return lambda wildcards, attempt: chunk_resources(
        task, wildcards.study, chunk_of(wildcards)
    ).mem_mb(attempt)


def chunk_runtime(task):
    """Time of the job of a chunk [min]."""
    return lambda wildcards, attempt: chunk_resources(
        task, wildcards.study, chunk_of(wildcards)
    ).runtime(attempt)


def read_studies_of(wildcards):
    """Studies whose tables a job reads: that of its name, or those of the article."""
    return [study_of(wildcards)] if "study" in wildcards.keys() else ARTICLE


def table_memory(wildcards, attempt):
    """Memory of a job that reads tables [MB]."""
    return describe_tables(read_studies_of(wildcards)).mem_mb(attempt)


def table_runtime(wildcards, attempt):
    """Time of a job that reads tables [min]."""
    return describe_tables(read_studies_of(wildcards)).runtime(attempt)
