"""Simulate all trials of one point."""

from numpy.random import SeedSequence

from ankleloop.batch import save_trials
from ankleloop.simulation import simulate_trials

from job import progress, running

with running(snakemake):
    seeds = [SeedSequence(seed) for seed in snakemake.params.seeds]
    trials = progress(simulate_trials(seeds, **snakemake.params.parameters), "simulated", len(seeds))
    save_trials(trials, snakemake.output.trials, precision=snakemake.params.precision)
