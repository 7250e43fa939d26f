"""Simulate the trials of a chunk."""

from ankleloop.studies.simulation import simulate_chunk

from job import print_failed_trials, running

with running(snakemake):
    study, path = snakemake.wildcards.study, snakemake.output.trials
    failed = simulate_chunk(path, study, **snakemake.params.arguments)
    print_failed_trials(snakemake, failed)
