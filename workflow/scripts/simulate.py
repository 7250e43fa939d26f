"""Simulate the trials of a chunk."""

from ankleloop.studies.simulation import simulate_chunk

from job import running

with running(snakemake):
    simulate_chunk(
        snakemake.output.trials,
        snakemake.wildcards.study,
        snakemake.params.seed,
        snakemake.params.points,
        snakemake.params.precision,
    )
