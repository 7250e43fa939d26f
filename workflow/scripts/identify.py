"""Identify the trials of a chunk by every method of their study, and score the estimates."""

import sys

from ankleloop.errors import locate_errors
from ankleloop_workflow.jobs.identification import identify_trials, read_trials
from ankleloop_workflow.jobs.job import running
from ankleloop_workflow.jobs.simulation import simulate_trials
from ankleloop_workflow.tables.outcomes import describe_failures

with running(snakemake):
    study = snakemake.wildcards.study
    arguments = dict(snakemake.params.arguments)
    simulation = arguments.pop("simulation")
    if simulation:
        trials = simulate_trials(study, precision=arguments["precision"], **simulation)
    else:
        trials = read_trials(snakemake.input.trials, arguments["conditions"])
    with locate_errors(str(snakemake.input.trials)):
        table = identify_trials(trials, dict(snakemake.output.items()), study, **arguments)
    outcomes = table.select(["point", "method", "trial", "failure"])
    message = describe_failures(outcomes.to_pandas())
    if message:
        print(f"{study}, chunk {snakemake.wildcards.chunk}: {message}", file=sys.stderr)
