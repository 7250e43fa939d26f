"""Simulate the trials of a chunk, identify them by every method of their study, and score the estimates."""

from ankleloop.studies.sweep_job import sweep_chunk

from job import print_failed_trials, print_failures, running

with running(snakemake):
    files, study = dict(snakemake.output.items()), snakemake.wildcards.study
    failed = sweep_chunk(files, study, **snakemake.params.arguments)
    print_failed_trials(snakemake, failed)
    print_failures(snakemake)
