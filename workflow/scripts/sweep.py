"""Simulate the trials of a chunk, identify them by every method of their study, and score the estimates."""

from ankleloop.studies.sweep_job import sweep_chunk

from job import print_failed_trials, print_failures, running

with running(snakemake):
    failed = sweep_chunk(
        dict(snakemake.output.items()),
        snakemake.wildcards.study,
        snakemake.params.seed,
        snakemake.params.conditions,
        snakemake.params.points,
        snakemake.params.methods,
        against=snakemake.params.against,
        precision=snakemake.params.precision,
        failures=snakemake.params.failures,
    )
    print_failed_trials(snakemake, failed)
    print_failures(snakemake)
