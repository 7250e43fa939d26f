"""Measure what the published methods cost, and check every number and claim of the paper."""

# ruff: noqa: E402

import os

# The job has all cores, so that no other job shares them; linear algebra has one thread as everywhere. This comes
# before any import of numpy.
LIBRARIES = ("OMP_NUM", "OPENBLAS_NUM", "GOTO_NUM", "MKL_NUM", "NUMEXPR_NUM", "VECLIB_MAXIMUM")
os.environ.update({f"{name}_THREADS": "1" for name in LIBRARIES})

from itertools import chain
from pathlib import Path

import pandas as pd

from ankleloop.trials.files import write_csv
from ankleloop.trials.trial_files import load_trials
from ankleloop_workflow.jobs.job import running
from ankleloop_workflow.paper.checks import StudyResults
from ankleloop_workflow.paper.economy import measure_economy
from ankleloop_workflow.paper.ledger import read_claims, verify
from ankleloop_workflow.tables.trial_tables import read_trial_table

with running(snakemake):
    trials = chain.from_iterable(load_trials(path) for path in snakemake.input.trials)
    economy = measure_economy(trials, snakemake.params.options)
    write_csv(economy, snakemake.output.economy, overwrite=True)
    studies = {}
    for path, study in zip(snakemake.input.tables, snakemake.params.studies, strict=True):
        studies[study["study"]] = StudyResults(
            name=study["study"],
            points=study["points"],
            table=read_trial_table(path),
            labels=study["labels"],
        )
    published = {Path(path).stem: pd.read_csv(path) for path in snakemake.input.published}
    published |= {Path(path).stem: read_claims(path) for path in snakemake.input.claims}
    ledger = verify(published, studies, economy)
    write_csv(ledger, snakemake.output.ledger, overwrite=True)
