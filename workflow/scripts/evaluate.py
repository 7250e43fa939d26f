"""Score all trials of one point, by every method."""

import pandas as pd

from ankleloop.batch import load_trials
from ankleloop.estimate import load_estimates
from ankleloop.evaluation import evaluate, parameters
from ankleloop.storage import whole_file

from job import progress, running

with running(snakemake):
    key = {"study": snakemake.wildcards.study, "point": snakemake.wildcards.point, **snakemake.params.varied}
    methods = {
        name: load_estimates(path)
        for name, path in zip(snakemake.params.methods, snakemake.input.estimates, strict=True)
    }
    rows = {(table, method): [] for table in ("scores", "parameters") for method in methods}
    for number, trial in enumerate(progress(load_trials(snakemake.input.trials), "scored")):
        for method, estimates in methods.items():
            for name, table in (
                ("scores", evaluate(trial, estimates[number], against=snakemake.params.against, intervals=True)),
                ("parameters", parameters(trial, estimates[number])),
            ):
                keyed = table.assign(**key, method=method, trial=number)
                rows[name, method].append(keyed[[*key, "method", "trial", *table.columns]])
    for name in ("scores", "parameters"):
        with whole_file(snakemake.output[name]) as path:
            pd.concat([table for method in methods for table in rows[name, method]]).to_csv(path, index=False)
