"""Simulate the trials of a chunk."""

import sys

from ankleloop.trials.trial_files import save_trials
from ankleloop_workflow.jobs.job import running
from ankleloop_workflow.jobs.simulation import simulate_trials

with running(snakemake):
    study = snakemake.wildcards.study
    arguments = snakemake.params.arguments
    failed = {}

    def simulate():
        """Trials as they are made; those that cannot be simulated are kept for the message."""
        for point, number, trial in simulate_trials(study, **arguments):
            if isinstance(trial, str):
                failed.setdefault(point, []).append(f"from trial {number} on: {trial}")
            yield trial

    index = []
    for name, part in arguments["conditions"].items():
        index += [(name, number) for number in range(part["first"], part["stop"])]
    save_trials(
        simulate(), snakemake.output.trials, index, snakemake.params.precision, overwrite=True
    )
    for point, reasons in failed.items():
        text = f"{len(reasons)} trials could not be simulated, {reasons[0]}"
        print(f"study {study}, point {point}: {text}", file=sys.stderr)
