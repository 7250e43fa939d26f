"""Identify the trials of a chunk by every method of their study, and score the estimates."""

import sys

from ankleloop.joint.estimate_files import save_estimates
from ankleloop.records.files import atomic_file
from ankleloop.replication.results import describe_failures
from ankleloop.studies.identification import identify_chunk

from job import running

with running(snakemake):
    results = identify_chunk(
        snakemake.input.trials,
        snakemake.wildcards.study,
        snakemake.params.points,
        snakemake.params.methods,
        against=snakemake.params.against,
        precision=snakemake.params.precision,
        failures=snakemake.params.failures,
    )
    save_estimates(results.estimates, snakemake.output.estimates)
    for table, path in ((results.scores, snakemake.output.scores), (results.parameters, snakemake.output.parameters)):
        with atomic_file(path) as partial:
            table.to_csv(partial, index=False)
    message = describe_failures(results.parameters)
    if message:
        print(f"{snakemake.wildcards.study}, chunk {snakemake.wildcards.chunk}: {message}", file=sys.stderr)
