"""Measure what PR-MOESP and EIV-MOESP cost on one trial, side by side, and a few facts of the regressors."""

import statistics
import time
import tracemalloc
from itertools import islice

import numpy as np
import pandas as pd

from ankleloop.assessment.scores import evaluate
from ankleloop.joint.regressors import build_regressors
from ankleloop.methods.moesp import MEMBERS, identify_moesp
from ankleloop.records.files import whole_file
from ankleloop.records.trial_files import load_trials
from ankleloop.subspace import block_hankel, moesp

from job import log, running

COMPARED = ("pr-moesp", "eiv-moesp")
BLOCK_ROWS, ORDER, RUNS = 15, 2, 15


def runner(method, regressors):
    """The subspace identification of a method on regressors that are ready."""
    instruments, projection = MEMBERS[method]

    def run():
        return moesp(
            regressors.inputs,
            regressors.torque,
            BLOCK_ROWS,
            ORDER,
            instruments,
            projection,
            regressors.reference,
            dynamic=regressors.reflex,
            rank_tolerance=1e-5,
        )

    return run


def seconds(run):
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def peak(run):
    tracemalloc.start()
    run()
    size = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return size


def costs(regressors):
    """Rows of instruments, median time of interleaved runs, and peak memory."""
    runs = {method: runner(method, regressors) for method in COMPARED}
    found = {f"{method}_instrument_rows": run().diagnostics["instrument_rows"] for method, run in runs.items()}
    times = {method: [] for method in COMPARED}
    for number in range(RUNS):
        for method, run in runs.items():
            times[method].append(seconds(run))
        log.info("timed run %d of %d", number + 1, RUNS)
    for method, run in runs.items():
        found[f"{method}_milliseconds"] = 1e3 * statistics.median(times[method])
        found[f"{method}_megabytes"] = peak(run) / 1e6
    return found


def rank(inputs):
    """Rank of the Hankel matrix of inputs, less the means of its rows."""
    hankel = block_hankel(inputs / inputs.std(axis=0).clip(1e-12), 0, BLOCK_ROWS, len(inputs) - BLOCK_ROWS + 1)
    values = np.linalg.svd((hankel - hankel.mean(axis=1, keepdims=True)).T, compute_uv=False)
    return int(np.sum(values > 1e-5 * values[0]))


def facts(trial, regressors):
    """What a constant in the basis, and a free B, would add."""
    constant = np.ones((len(regressors.inputs), 1))
    net = {
        free: evaluate(trial, identify_moesp(trial, free_b=free)).query("against == 'measured'")["vaf"].iloc[0]
        for free in (False, True)
    }
    return {
        "block_rows": BLOCK_ROWS,
        "constant_rows": BLOCK_ROWS,
        "constant_directions": rank(np.hstack([regressors.inputs, constant])) - rank(regressors.inputs),
        "correlation_rows": regressors.inputs.shape[1] * BLOCK_ROWS + ORDER,
        "free_b_net_vaf": net[True] - net[False],
    }


with running(snakemake):
    trial = next(islice(load_trials(snakemake.input.trials), 1))
    regressors = build_regressors(
        trial, delay=0.04, basis="chebyshev", degree=5, identification_rate=100.0, reference="reference"
    )
    found = costs(regressors) | facts(trial, regressors)
    with whole_file(snakemake.output.table) as path:
        pd.DataFrame({"quantity": list(found), "value": list(found.values())}).to_csv(path, index=False)
