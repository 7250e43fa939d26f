"""Identify all trials of one point by one method."""

from ankleloop.batch import load_trials
from ankleloop.estimate import save_estimates
from ankleloop.registry import identify

from job import progress, running

with running(snakemake):
    trials = progress(load_trials(snakemake.input.trials), "identified")
    estimates = [identify(trial, snakemake.params.method, **snakemake.params.options) for trial in trials]
    save_estimates(estimates, snakemake.output.estimates)
