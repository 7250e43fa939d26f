"""Identify the trials of a chunk by every method of their study, and score the estimates."""

import sys

from ankleloop.replication.results import read_results
from ankleloop.replication.trial_counts import describe_failures
from ankleloop.studies.identification import FILES, identify_chunk

from job import running

with running(snakemake):
    files = {name: snakemake.output[name] for name in FILES}
    identify_chunk(
        snakemake.input.trials,
        files,
        snakemake.wildcards.study,
        snakemake.params.points,
        snakemake.params.methods,
        against=snakemake.params.against,
        precision=snakemake.params.precision,
        failures=snakemake.params.failures,
    )
    message = describe_failures(read_results([files["parameters"]]))
    if message:
        print(f"{snakemake.wildcards.study}, chunk {snakemake.wildcards.chunk}: {message}", file=sys.stderr)
