"""What PR-MOESP and EIV-MOESP cost on the same trials, side by side, and a few facts about the regressors."""

from __future__ import annotations

import logging
import statistics
import time
import tracemalloc
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop.errors import NUMERICAL_ERRORS, DataError, describe_error
from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import Regressors
from ankleloop.methods.moesp import MoespOptions, subspace_arguments
from ankleloop.paper.judgement import Mean
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.moesp import moesp

log = logging.getLogger(__name__)

COMPARED = ("pr-moesp", "eiv-moesp")
RUNS = 3  # of each method on a trial
MEMORY_TRIALS = 5  # trials whose memory is measured: it hardly varies, and tracing makes runs slow

Runs = dict[str, Callable[[], Any]]


def measure_economy(trials: Iterable[xr.Dataset], options: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Measure time and memory of two methods on some trials, and the ranks that decide on their form."""
    models = {method: MoespOptions.parse(method, **options.get(method, {})) for method in COMPARED}
    costs: list[dict[tuple[str, str], float]] = []  # of each trial, by quantity and method
    rows: list[dict[str, Any]] = []
    for number, trial in enumerate(trials):
        try:
            runs, regressors = _prepare_runs(trial, models)
            if not rows:  # the first runs are not timed
                rows = _count_rows(runs, models["pr-moesp"], regressors)
            cost = {("milliseconds", method): 1e3 * seconds for method, seconds in _time_runs(runs).items()}
        except NUMERICAL_ERRORS as error:
            log.warning("trial %d is left out: %s", number, describe_error(error))
            continue
        if len(costs) < MEMORY_TRIALS:
            for method, run in runs.items():
                tracemalloc.start()
                run()
                cost["megabytes", method] = tracemalloc.get_traced_memory()[1] / 1e6  # the peak
                tracemalloc.stop()
        costs.append(cost)
    if not costs:
        raise DataError("there is no trial that both methods identify: see the failures of the study.")
    table = pd.DataFrame(costs)
    for quantity in ("milliseconds", "megabytes"):
        values = [table[quantity, method].dropna() for method in COMPARED]
        rows += [_summarise(f"{method}_{quantity}", part) for method, part in zip(COMPARED, values, strict=True)]
        ratio = _summarise(f"{quantity}_ratio", np.log(values[1] / values[0]))  # its geometric mean
        rows.append(ratio | {name: float(np.exp(ratio[name])) for name in ("value", "low", "high")})
    return pd.DataFrame(rows)


def _prepare_runs(trial: xr.Dataset, models: Mapping[str, MoespOptions]) -> tuple[Runs, Regressors]:
    """Subspace identification by each method from its regressors, and those of the last one."""
    prepared = prepare(trial)
    runs: Runs = {}
    for method, model in models.items():
        chosen = {name: getattr(model, name) for name in ("delay", "degree", "identification_rate", "reference")}
        regressors = prepared.regressors(basis=model.basis or "chebyshev", **chosen)
        arguments = subspace_arguments(model, regressors, method)
        runs[method] = partial(moesp, regressors.inputs, regressors.torque, reference=regressors.reference, **arguments)
    return runs, regressors


def _summarise(quantity: str, values: pd.Series) -> dict[str, Any]:
    """Mean over trials with its interval."""
    mean = Mean.of(values)
    low, high = mean.interval()
    return {"quantity": quantity, "value": mean.value, "low": low, "high": high, "n": len(values)}


def _time_runs(runs: Runs) -> dict[str, float]:
    """Median time of each method [s], the methods in turn, so that a change of the machine's speed meets both."""
    times: dict[str, list[float]] = {method: [] for method in runs}
    for number in range(RUNS):
        for method in list(runs)[:: 1 if number % 2 else -1]:
            start = time.perf_counter()
            runs[method]()
            times[method].append(time.perf_counter() - start)
    return {method: statistics.median(values) for method, values in times.items()}


def _count_rows(runs: Runs, options: MoespOptions, regressors: Regressors) -> list[dict[str, Any]]:
    """Rows of instruments, and what a constant in the basis would add: numbers that no trial changes."""
    block_rows = options.block_rows
    constant = np.ones((len(regressors.inputs), 1))
    ranks = []
    for inputs in (regressors.inputs, np.hstack([regressors.inputs, constant])):
        hankel = block_hankel(inputs / inputs.std(axis=0).clip(1e-12), 0, block_rows, len(inputs) - block_rows + 1)
        centred = hankel - hankel.mean(axis=1, keepdims=True)
        ranks.append(int(np.linalg.matrix_rank(centred, rtol=options.rank_tolerance)))
    numbers = {f"{method}_instrument_rows": run().diagnostics["instrument_rows"] for method, run in runs.items()}
    numbers |= {"block_rows": block_rows, "constant_rows": block_rows, "constant_directions": ranks[1] - ranks[0]}
    numbers["correlation_rows"] = regressors.inputs.shape[1] * block_rows + (options.order or 1)
    return [{"quantity": quantity, "value": float(number), "n": 1} for quantity, number in numbers.items()]
