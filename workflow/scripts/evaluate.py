"""Score all trials of one point and method."""

import pandas as pd

from ankleloop.batch import load_trials
from ankleloop.estimate import load_estimates
from ankleloop.evaluation import evaluate, parameters
from ankleloop.storage import whole_file

from job import progress, running

with running(snakemake):
    wildcards = snakemake.wildcards
    key = {"study": wildcards.study, "point": wildcards.point, **snakemake.params.varied, "method": wildcards.method}
    rows = {"scores": [], "parameters": []}
    pairs = zip(load_trials(snakemake.input.trials), load_estimates(snakemake.input.estimates), strict=True)
    for number, (trial, estimate) in enumerate(progress(pairs, "scored")):
        for name, table in (("scores", evaluate(trial, estimate)), ("parameters", parameters(trial, estimate))):
            rows[name].append(table.assign(**key, trial=number)[[*key, "trial", *table.columns]])
    for name, tables in rows.items():
        with whole_file(snakemake.output[name]) as path:
            pd.concat(tables).to_csv(path, index=False)
