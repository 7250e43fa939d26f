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
from ankleloop.methods.moesp import MEMBERS, REGRESSION_TOLERANCE, MoespOptions
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
    times: dict[str, list[float]] = {method: [] for method in COMPARED}
    memory: dict[str, list[float]] = {method: [] for method in COMPARED}
    rows: list[dict[str, Any]] = []
    for number, trial in enumerate(trials):
        try:
            runs, regressors = _prepare_runs(trial, models)
            if not rows:  # the first runs are not timed
                rows = _count_rows(runs, models["pr-moesp"], regressors["pr-moesp"])
            seconds = _time_runs(runs)
        except NUMERICAL_ERRORS as error:
            log.warning("trial %d is left out: %s", number, describe_error(error))
            continue
        for method, value in seconds.items():
            times[method].append(1e3 * value)
        if len(memory[COMPARED[0]]) < MEMORY_TRIALS:
            for method, run in runs.items():
                memory[method].append(_peak_memory(run) / 1e6)
        log.info("measured trial %d", number)
    if not times[COMPARED[0]]:
        raise DataError("there is no trial that both methods identify: see the failures of the study.")
    for quantity, values in (("milliseconds", times), ("megabytes", memory)):
        rows += [_summarise(f"{method}_{quantity}", values[method]) for method in COMPARED]
        rows.append(_summarise_ratio(f"{quantity}_ratio", values))
    return pd.DataFrame(rows)


def _prepare_runs(trial: xr.Dataset, models: Mapping[str, MoespOptions]) -> tuple[Runs, dict[str, Regressors]]:
    """Runs of both methods on a trial, and their regressors."""
    prepared = prepare(trial)
    regressors = {
        method: prepared.regressors(
            delay=model.delay,
            basis=model.basis or "chebyshev",
            degree=model.degree,
            identification_rate=model.identification_rate,
            reference=model.reference,
        )
        for method, model in models.items()
    }
    return {method: partial(_run, method, models[method], regressors[method]) for method in COMPARED}, regressors


def _summarise(quantity: str, values: list[float]) -> dict[str, Any]:
    """Mean over trials with its interval."""
    mean = Mean.of(values)
    low, high = mean.interval()
    return {"quantity": quantity, "value": mean.value, "low": low, "high": high, "n": len(values)}


def _summarise_ratio(quantity: str, values: Mapping[str, list[float]]) -> dict[str, Any]:
    """Geometric mean over trials of the ratio of the second method to the first."""
    first, second = (np.log(values[method]) for method in COMPARED)
    row = _summarise(quantity, list(second - first))
    return row | {name: float(np.exp(row[name])) for name in ("value", "low", "high")}


def _run(method: str, options: MoespOptions, regressors: Regressors) -> Any:
    """Subspace identification by a method, from its regressors."""
    instruments, projection = MEMBERS[method]
    return moesp(
        regressors.inputs,
        regressors.torque,
        options.block_rows,
        options.order,
        instruments,
        options.projection or projection,
        regressors.reference,
        dynamic=None if options.free_b else regressors.reflex,
        instrument_rows=options.instrument_rows,
        instrument_leads=options.instrument_leads,
        rank_tolerance=options.rank_tolerance,
        regression_tolerance=REGRESSION_TOLERANCE,
    )


def _time_runs(runs: Runs) -> dict[str, float]:
    """Median time of each method [s], the methods in turn, so that a change of the machine's speed meets both."""
    times: dict[str, list[float]] = {method: [] for method in runs}
    for number in range(RUNS):
        for method in list(runs)[:: 1 if number % 2 else -1]:
            start = time.perf_counter()
            runs[method]()
            times[method].append(time.perf_counter() - start)
    return {method: statistics.median(values) for method, values in times.items()}


def _peak_memory(run: Callable[[], Any]) -> int:
    """Peak of the memory that a run allocates [bytes]."""
    tracemalloc.start()
    run()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def _count_rows(runs: Runs, options: MoespOptions, regressors: Regressors) -> list[dict[str, Any]]:
    """Rows of instruments, and what a constant in the basis would add: numbers that no trial changes."""
    block_rows = options.block_rows
    constant = np.ones((len(regressors.inputs), 1))
    ranks = [
        _rank(inputs, block_rows, options.rank_tolerance)
        for inputs in (regressors.inputs, np.hstack([regressors.inputs, constant]))
    ]
    numbers = {f"{method}_instrument_rows": run().diagnostics["instrument_rows"] for method, run in runs.items()}
    numbers |= {"block_rows": block_rows, "constant_rows": block_rows, "constant_directions": ranks[1] - ranks[0]}
    numbers["correlation_rows"] = regressors.inputs.shape[1] * block_rows + (options.order or 1)
    return [{"quantity": quantity, "value": float(number), "n": 1} for quantity, number in numbers.items()]


def _rank(inputs: np.ndarray, block_rows: int, tolerance: float) -> int:
    """Rank of the Hankel matrix of inputs, less the means of its rows."""
    hankel = block_hankel(inputs / inputs.std(axis=0).clip(1e-12), 0, block_rows, len(inputs) - block_rows + 1)
    values = np.linalg.svd((hankel - hankel.mean(axis=1, keepdims=True)).T, compute_uv=False)
    return int(np.sum(values > tolerance * values[0]))
