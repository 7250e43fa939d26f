"""Identify all trials of one point by every method of its study, and score the estimates."""

import pandas as pd

from ankleloop.batch import load_trials
from ankleloop.estimate import save_estimates
from ankleloop.evaluation import parameter_row, score_rows
from ankleloop.once import made_once
from ankleloop.registry import identify
from ankleloop.storage import whole_file

from job import progress, running

SCORES = ["torque", "against", "vaf", "low", "high"]


def keyed(rows):
    """Rows of all methods one below the other: the columns of a method are those it has."""
    return pd.concat([pd.DataFrame(of_one) for of_one in rows.values()], ignore_index=True)


with running(snakemake):
    key = {"study": snakemake.params.study, "point": snakemake.wildcards.point, **snakemake.params.varied}
    methods = snakemake.params.methods
    found, scores, parameters = ({name: [] for name in methods} for _ in range(3))
    for number, trial in enumerate(progress(load_trials(snakemake.input.trials), "identified")):
        with made_once():
            for name, method in methods.items():
                estimate = identify(trial, method["method"], **method["options"])
                row = {**key, "method": name, "trial": number}
                found[name].append(estimate)
                rated = score_rows(trial, estimate, against=snakemake.params.against, intervals=True)
                scores[name] += [{**row, **dict(zip(SCORES, values, strict=True))} for values in rated]
                parameters[name].append({**row, **parameter_row(trial, estimate)})
    for name, path in zip(methods, snakemake.output.estimates, strict=True):
        save_estimates(found[name], path, snakemake.params.precision)
    for name, rows in (("scores", scores), ("parameters", parameters)):
        with whole_file(snakemake.output[name]) as path:
            keyed(rows).to_csv(path, index=False)
