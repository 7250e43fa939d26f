"""Simulate the trials of a chunk."""

import sys

from ankleloop.studies.simulation import simulate_trials
from ankleloop.trials.trial_files import FailedTrial, save_trials

from job import running

with running(snakemake):
    study, arguments, failed = snakemake.wildcards.study, snakemake.params.arguments, []

    def simulate():
        """Trials as they are made; those that cannot be simulated are kept for the message."""
        for _, _, trial in simulate_trials(study, **arguments):
            if isinstance(trial, FailedTrial):
                failed.append(trial)
            yield trial

    conditions = arguments["conditions"].items()
    index = [(name, number) for name, part in conditions for number in range(part["first"], part["stop"])]
    save_trials(simulate(), snakemake.output.trials, snakemake.params.precision, index, overwrite=True)
    for point in dict.fromkeys(trial.point for trial in failed):
        trials = [trial for trial in failed if trial.point == point]
        text = f"{len(trials)} trials could not be simulated, from trial {trials[0].number} on: {trials[0].reason}"
        print(f"study {study}, point {point}: {text}", file=sys.stderr)
