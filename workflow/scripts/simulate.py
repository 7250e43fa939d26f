"""Simulate the trials of a chunk."""

import sys

from ankleloop.studies.simulation import simulate_chunk

from job import running

with running(snakemake):
    failed = simulate_chunk(
        snakemake.output.trials,
        snakemake.wildcards.study,
        snakemake.params.seed,
        snakemake.params.points,
        snakemake.params.precision,
        snakemake.params.failures,
    )
    points = dict.fromkeys(trial.point for trial in failed)
    for point in points:
        trials = [trial for trial in failed if trial.point == point]
        place = f"study {snakemake.wildcards.study}, point {point}"
        text = f"{len(trials)} trials could not be simulated, from trial {trials[0].number} on"
        print(f"{place}: {text}: {trials[0].reason}", file=sys.stderr)
