"""Predict what the notebook of a study compares with its trials."""

import logging

from ankleloop_workflow.jobs.job import running
from ankleloop_workflow.jobs.predictions import predict

with running(snakemake):
    logging.captureWarnings(True)  # of pilots: into the log
    predict(snakemake.output.table, snakemake.wildcards.study, **snakemake.params.arguments)
