"""Identify all trials of some points by every method of their study, and score the estimates."""

import pandas as pd

from ankleloop.batch import load_trials
from ankleloop.estimate import save_estimates
from ankleloop.evaluation import parameter_row, score_rows
from ankleloop.once import made_once
from ankleloop.registry import identify
from ankleloop.storage import whole_file

from job import progress, running

SCORES = ["torque", "against", "vaf", "low", "high"]


def identified(source, key, methods, against):
    """Estimates, scores and parameters of the trials of a point, each by method."""
    found, scores, parameters = ({name: [] for name in methods} for _ in range(3))
    trials = enumerate(progress(load_trials(source), f"{key['point']}: identified"))
    while True:
        with made_once():  # loading is part of it: a trial is validated once
            number, trial = next(trials, (None, None))
            if trial is None:
                return found, scores, parameters
            for name, method in methods.items():
                estimate = identify(trial, method["method"], **method["options"])
                row = {**key, "method": name, "trial": number}
                found[name].append(estimate)
                rated = score_rows(trial, estimate, against=against, intervals=True)
                scores[name] += [{**row, **dict(zip(SCORES, values, strict=True))} for values in rated]
                parameters[name].append({**row, **parameter_row(trial, estimate)})


def save_table(rows, path):
    """Write the rows of all methods, one below the other; the columns of a method are those it has."""
    with whole_file(path) as partial:
        pd.concat([pd.DataFrame(of_one) for of_one in rows.values()], ignore_index=True).to_csv(partial, index=False)


with running(snakemake):
    given, made = snakemake.params, snakemake.output
    paths = iter(made.estimates)
    for k, (point, varied) in enumerate(given.points.items()):
        key = {"study": given.study, "point": point, **varied}
        found, scores, parameters = identified(snakemake.input.trials[k], key, given.methods, given.against)
        for estimates in found.values():
            save_estimates(estimates, next(paths), given.precision)
        save_table(scores, made.scores[k])
        save_table(parameters, made.parameters[k])
