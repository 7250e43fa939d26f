"""Identify all trials of some points by every method of their study, and score the estimates."""

import pandas as pd

from ankleloop.assessment.scores import parameter_row, score_rows
from ankleloop.joint.estimate import save_estimates
from ankleloop.joint.once import made_once
from ankleloop.joint.regressors import share_channels
from ankleloop.methods.registry import identify, method_options
from ankleloop.records.files import whole_file
from ankleloop.records.trial_files import load_blocks

from job import progress, running

SCORES = ["torque", "against", "vaf", "low", "high"]


def rates_and_delays(methods):
    """Those of the methods that have both."""
    options = [method_options(method["method"]) | method["options"] for method in methods.values()]
    found = {(given.get("identification_rate"), given.get("delay")) for given in options}
    return [pair for pair in found if None not in pair]


def prepared(source, methods):
    """Trials one after the other, while what their methods need alike is kept for a block of them."""
    blocks, shared = load_blocks(source), rates_and_delays(methods)
    while True:
        with made_once():  # loading is part of it: a trial is validated once
            trials, signals = next(blocks, ([], {}))
            if not trials:
                return
            for rate, delay in shared:
                share_channels(trials, signals, rate, delay)
            yield from trials


def identified(source, key, methods, against):
    """Estimates, scores and parameters of the trials of a point, each by method."""
    found, scores, parameters = ({name: [] for name in methods} for _ in range(3))
    for number, trial in enumerate(progress(prepared(source, methods), f"{key['point']}: identified")):
        for name, method in methods.items():
            estimate = identify(trial, method["method"], **method["options"])
            row = {**key, "method": name, "trial": number}
            found[name].append(estimate)
            rated = score_rows(trial, estimate, against=against, intervals=True)
            scores[name] += [{**row, **dict(zip(SCORES, values, strict=True))} for values in rated]
            parameters[name].append({**row, **parameter_row(trial, estimate)})
    return found, scores, parameters


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
