# Closed-loop identification of intrinsic and reflex joint stiffness: simulate, identify, evaluate, report.
import os
import sys
from pathlib import Path

from snakemake.utils import min_version

min_version("9.0")


configfile: "config/config.yaml"


# Jobs keep the memory that they have freed: the first touch of new memory can cost more than the numbers in it.
os.environ.setdefault("MALLOC_MMAP_THRESHOLD_", str(2**30))
os.environ.setdefault("MALLOC_TRIM_THRESHOLD_", str(2**31))

sys.path.insert(0, f"{workflow.basedir}/workflow")
from fingerprint import fingerprint
from studies import (
    ARTICLE,
    DIAGRAMS,
    article_parameters,
    article_studies,
    batches,
    complete,
    estimates,
    existing,
    identify_options,
    notebook_inputs,
    notebook_parameters,
    page,
    reports,
    rule_name,
    scores,
    simulated,
    studies,
    targets,
    trial_seeds,
    trials,
    without_selected,
)

CONFIG = complete(config)
STUDIES = studies(CONFIG)


rule all:
    default_target: True
    input:
        targets(CONFIG),


include: "workflow/rules/simulate.smk"
include: "workflow/rules/identify.smk"
include: "workflow/rules/recordings.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/article.smk"
