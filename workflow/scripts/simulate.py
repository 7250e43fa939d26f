"""Simulate all trials of some points of a study."""

from numpy.random import SeedSequence

from ankleloop.records.trial_files import save_trials
from ankleloop.simulation import simulate_trials

from job import progress, running

with running(snakemake):
    given = snakemake.params
    for (point, parameters), path in zip(given.points.items(), snakemake.output.trials, strict=True):
        seeds = [SeedSequence(seed) for seed in given.seeds[point]]
        trials = progress(simulate_trials(seeds, **parameters), f"{point}: simulated", len(seeds))
        save_trials(trials, path, precision=given.precision)
