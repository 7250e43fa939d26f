"""Simulate all trials of one point."""

from numpy.random import SeedSequence

from ankleloop.batch import save_trials
from ankleloop.simulation import simulate

from job import progress, running

with running(snakemake):
    seeds = progress(snakemake.params.seeds, "simulated")
    trials = (simulate(seed=SeedSequence(seed), **snakemake.params.parameters) for seed in seeds)
    save_trials(trials, snakemake.output.trials, precision=snakemake.params.precision)
