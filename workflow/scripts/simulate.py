"""Simulate the trials of a chunk."""

from ankleloop.studies.simulation import simulate_chunk

from job import print_failed_trials, running

with running(snakemake):
    failed = simulate_chunk(
        snakemake.output.trials,
        snakemake.wildcards.study,
        snakemake.params.seed,
        snakemake.params.points,
        snakemake.params.precision,
        snakemake.params.failures,
    )
    print_failed_trials(snakemake, failed)
