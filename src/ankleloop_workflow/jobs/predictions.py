"""What theory and short pilots predict of a study, which its notebook compares with the trials."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from ankleloop.assessment.cramer_rao import cramer_rao, trajectory_bound
from ankleloop.assessment.scores import TRAJECTORY_TRUTHS
from ankleloop.errors import NUMERICAL_ERRORS, locate_errors
from ankleloop.methods.registry import identify
from ankleloop.simulation.simulate import simulate
from ankleloop.trials.files import PathLike
from ankleloop_lab.experiments.duration import plan_duration
from ankleloop_workflow.tables.time_varying import profile_trajectories
from ankleloop_workflow.tables.trial_tables import save_table

log = logging.getLogger(__name__)

PILOT = 15.0  # length of a pilot [s]
WIDTH = 0.05  # of the interval of K that a pilot plans for: its half over K
KEYS = ["point", "kind", "seed"]


def bound_trajectories(seed: int, **settings: Any) -> dict[str, float]:
    """Cramér-Rao bound of K, B and G that vary: none for steps, which splines do not follow.

    K is the root mean square over all places, K_mean that of the mean over them, K_truth the mean of the truth.
    """
    if settings["variation_shape"] == "square":
        return {}
    bound = trajectory_bound(seed=seed, **settings)
    dimension = str(next(iter(bound.sizes)))
    truths = profile_trajectories(settings, dimension, bound[dimension].values)
    values = {}
    for name in TRAJECTORY_TRUTHS:
        values[name] = float(np.sqrt((bound[name] ** 2).mean()))
        values[f"{name}_mean"] = float(bound[f"{name}_mean"])
        values[f"{name}_truth"] = truths[name].mean()
    return values


def plan_from_pilot(seed: int, **settings: Any) -> dict[str, float]:
    """Length of a record [s] that a pilot asks for; only at points with the usual perturbation, PRBS of 100 ms."""
    if (settings["perturbation"], settings["switching_interval"]) != ("prbs", 0.1):
        return {}
    trial = simulate(seed=seed, **{**settings, "duration": PILOT})
    plan = plan_duration(identify(trial, "riv", delay=settings["delay"]), {"K": WIDTH})
    return {"pilot": PILOT, "width": WIDTH, "planned": plan.needed["K"]}


# By the kinds that the list of notebooks may name.
PREDICTIONS: Mapping[str, Callable[..., Mapping[str, float]]] = {
    "known delay": cramer_rao,
    "unknown delay": partial(cramer_rao, known_delay=False),
    "reference alone": partial(cramer_rao, fed_back=False),
    "trajectories": bound_trajectories,
    "pilots": plan_from_pilot,
}


def predict(
    path: PathLike,
    study: str,
    points: Mapping[str, Mapping[str, Any]],
    draws: Mapping[str, int],
) -> None:
    """Write the predictions for all points: a row for each point, kind and seed; numbers are columns.

    A point that cannot be simulated, or whose record is too short, has a row without numbers.

    `points` are settings of the simulation, `draws` numbers of seeds by kind.
    """
    rows = []
    for (point, values), (kind, count) in product(points.items(), draws.items()):
        for seed in range(count):
            key: dict[str, Any] = {"point": point, "kind": kind, "seed": seed}
            place = f"study {study}, point {point}, {kind}, seed {seed}"
            try:
                with locate_errors(place):
                    prediction = PREDICTIONS[kind](seed=seed, **values)
            except NUMERICAL_ERRORS as error:  # as trials of the point fail, with the same reason
                log.warning("%s: there is none: %s", place, error)
                rows.append(key)
                continue
            if prediction:
                rows.append({**key, **prediction})
                log.info("%s: %s, seed %d", point, kind, seed)
    table = pd.DataFrame(rows, columns=None if rows else KEYS)
    save_table(pa.Table.from_pandas(table, preserve_index=False), path)
