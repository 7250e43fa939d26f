"""What PR-MOESP and EIV-MOESP cost on the same trials, side by side, and their rows of instruments."""

from __future__ import annotations

import logging
import timeit
import tracemalloc
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop.errors import NUMERICAL_ERRORS, DataError, describe_error
from ankleloop.joint.prepared import prepare
from ankleloop.methods.moesp import MoespOptions, subspace_arguments
from ankleloop.subspace.moesp import moesp
from ankleloop_workflow.paper.judgement import Mean

log = logging.getLogger(__name__)

COMPARED = ("pr-moesp", "eiv-moesp")
REGRESSOR_OPTIONS = {"delay", "degree", "identification_rate", "reference"}
RUNS = 3  # of each method on a trial

Runs = dict[str, Callable[[], Any]]


def measure_economy(
    trials: Iterable[xr.Dataset], options: Mapping[str, Mapping[str, Any]]
) -> pd.DataFrame:
    """Measure time and memory of two methods on some trials, and count their rows, which no trial changes."""
    models = {method: MoespOptions.parse(method, **options.get(method, {})) for method in COMPARED}
    costs: list[dict[str, float]] = []  # of each trial
    counts: dict[str, float] = {}  # of rows
    for number, trial in enumerate(trials):
        try:
            runs = _prepare_runs(trial, models)
            if not counts:  # the first runs are not timed
                counts = {
                    f"{method}_instrument_rows": run().diagnostics["instrument_rows"]
                    for method, run in runs.items()
                }
            times = _time_runs(runs)
        except NUMERICAL_ERRORS as error:
            log.warning("trial %d is left out: %s", number, describe_error(error))
            continue
        cost = {f"{method}_milliseconds": 1e3 * seconds for method, seconds in times.items()}
        for method, run in runs.items():
            tracemalloc.start()
            run()
            _, peak = tracemalloc.get_traced_memory()
            tracemalloc.stop()
            cost[f"{method}_megabytes"] = peak / 1e6
        costs.append(cost)
    if not costs:
        raise DataError(
            "there is no trial that both methods identify: see the failures of the study."
        )
    counts["block_rows"] = models["pr-moesp"].block_rows
    rows = [_summarise(quantity, [count]) for quantity, count in counts.items()]
    table = pd.DataFrame(costs)
    for quantity in ("milliseconds", "megabytes"):
        names = [f"{method}_{quantity}" for method in COMPARED]
        rows += [_summarise(name, table[name]) for name in names]
        pr, eiv = (table[name] for name in names)
        ratio = _summarise(f"{quantity}_ratio", np.log(eiv / pr))
        # The mean of logarithms is that of the geometric mean.
        rows.append(ratio | {name: float(np.exp(ratio[name])) for name in ("value", "low", "high")})
    return pd.DataFrame(rows)


def _prepare_runs(trial: xr.Dataset, models: Mapping[str, MoespOptions]) -> Runs:
    """Subspace identification by each method from its regressors."""
    prepared = prepare(trial)
    runs: Runs = {}
    for method, model in models.items():
        chosen = model.model_dump(include=REGRESSOR_OPTIONS)
        regressors = prepared.regressors(basis=model.basis or "chebyshev", **chosen)
        arguments = subspace_arguments(model, regressors, method)
        runs[method] = partial(
            moesp, regressors.inputs, regressors.torque, reference=regressors.reference, **arguments
        )
    return runs


def _summarise(quantity: str, values: Sequence[float] | pd.Series) -> dict[str, Any]:
    """Mean over trials with its interval, which a single value does not have."""
    mean = Mean.of(values)
    low, high = mean.interval()
    return {"quantity": quantity, "value": mean.value, "n": len(values), "low": low, "high": high}


def _time_runs(runs: Runs) -> dict[str, float]:
    """Median time of each method [s], the methods in turn, so that a change of the machine's speed meets both."""
    times = [
        {method: timeit.timeit(run, number=1) for method, run in runs.items()} for _ in range(RUNS)
    ]
    return pd.DataFrame(times).median().to_dict()
