"""What PR-MOESP and EIV-MOESP cost on one trial, side by side, and a few facts about the regressors."""

from __future__ import annotations

import logging
import statistics
import time
import tracemalloc
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.assessment.scores import evaluate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import Regressors
from ankleloop.methods.moesp import MEMBERS
from ankleloop.methods.registry import identify
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.moesp import moesp

__all__ = ["measure_economy"]

log = logging.getLogger(__name__)

COMPARED = ("pr-moesp", "eiv-moesp")
BLOCK_ROWS, ORDER, RUNS = 15, 2, 15
RANK_TOLERANCE = 1e-5


def measure_economy(trial: xr.Dataset) -> dict[str, float]:
    """Measure time and memory of two methods on a trial, and the ranks that decide on their form.

    Parameters
    ----------
    trial : xarray.Dataset
        A trial with a reference.

    Returns
    -------
    dict of str to float
        By quantity: rows of instruments, median time [ms] and peak memory [MB] of each method; numbers of block rows
        and directions; net VAF [points] that a free B would add.
    """
    prepared = prepare(trial)
    regressors = prepared.regressors(
        delay=0.04, basis="chebyshev", degree=5, identification_rate=100.0, reference="reference"
    )
    return _measure_costs(regressors) | _count_directions(prepared, regressors)


def _measure_costs(regressors: Regressors) -> dict[str, float]:
    """Rows of instruments, median time of interleaved runs, and peak memory."""
    runs = {method: partial(_run, method, regressors) for method in COMPARED}
    costs = {f"{method}_instrument_rows": run().diagnostics["instrument_rows"] for method, run in runs.items()}
    times: dict[str, list[float]] = {method: [] for method in COMPARED}
    for number in range(RUNS):
        for method, run in runs.items():
            start = time.perf_counter()
            run()
            times[method].append(time.perf_counter() - start)
        log.info("timed run %d of %d", number + 1, RUNS)
    for method, run in runs.items():
        costs[f"{method}_milliseconds"] = 1e3 * statistics.median(times[method])
        costs[f"{method}_megabytes"] = _peak_memory(run) / 1e6
    return costs


def _run(method: str, regressors: Regressors) -> Any:
    """Subspace identification by a method, from its regressors."""
    instruments, projection = MEMBERS[method]
    return moesp(
        regressors.inputs,
        regressors.torque,
        BLOCK_ROWS,
        ORDER,
        instruments,
        projection,
        regressors.reference,
        dynamic=regressors.reflex,
        rank_tolerance=RANK_TOLERANCE,
    )


def _peak_memory(run: Callable[[], Any]) -> int:
    """Peak of the memory that a run allocates [bytes]."""
    tracemalloc.start()
    run()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def _count_directions(trial: PreparedTrial, regressors: Regressors) -> dict[str, float]:
    """What a constant in the basis, and a free B, would add."""
    constant = np.ones((len(regressors.inputs), 1))
    net = {}
    for free in (False, True):
        scores = evaluate(trial, identify(trial, "pr-moesp", free_b=free))
        net[free] = scores.query("against == 'measured'")["vaf"].iloc[0]
    return {
        "block_rows": BLOCK_ROWS,
        "constant_rows": BLOCK_ROWS,
        "constant_directions": _rank(np.hstack([regressors.inputs, constant])) - _rank(regressors.inputs),
        "correlation_rows": regressors.inputs.shape[1] * BLOCK_ROWS + ORDER,
        "free_b_net_vaf": net[True] - net[False],
    }


def _rank(inputs: np.ndarray) -> int:
    """Rank of the Hankel matrix of inputs, less the means of its rows."""
    hankel = block_hankel(inputs / inputs.std(axis=0).clip(1e-12), 0, BLOCK_ROWS, len(inputs) - BLOCK_ROWS + 1)
    values = np.linalg.svd((hankel - hankel.mean(axis=1, keepdims=True)).T, compute_uv=False)
    return int(np.sum(values > RANK_TOLERANCE * values[0]))
