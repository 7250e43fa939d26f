"""Studies of joints that change in time: mean trajectories over trials, their errors, and limits of these."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

import numpy as np
import pandas as pd
from scipy import special

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.quantities import TRAJECTORIES
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import draw_course, trajectories
from ankleloop.trials.files import PathLike
from ankleloop_workflow.tables.estimate_tables import load_estimates
from ankleloop_workflow.tables.means import count_outcomes, measure_statistics
from ankleloop_workflow.tables.outcomes import Points, Settings

# Scores of a trajectory in the table of trials, by the column of their mean.
TRAJECTORY_SCORES = {"error": "nrmse", "mean_error": "bias", "covered": "covered"}
PLACES = 101
SPREAD = (0.025, 0.975)  # quantiles of the trials


def profile_trajectories(
    settings: Settings, dimension: str, coordinate: np.ndarray
) -> dict[str, np.ndarray]:
    """True K, B and G of a setting over what they vary with.

    Shapes: coordinate (places,); returns (places,).
    """
    # Points of a study have options of methods beside the settings.
    simulated = {
        name: settings[name] for name in SimulationSettings.model_fields if name in settings
    }
    simulated["cycle_jitter"] = 0.0
    if dimension != "phase":  # a straight path over a record of any length takes each place in turn
        simulated["variation"] = "time"
    chosen = SimulationSettings(**simulated)
    extents = {"phase": chosen.cycle_duration, "schedule": chosen.duration, "time": 1.0}
    course = draw_course(chosen, np.random.default_rng(0))
    truth = trajectories(course, coordinate * extents[dimension])
    return dict(zip(TRAJECTORIES, truth, strict=True))


def average_trajectories(estimates: Iterable[Estimate], settings: Settings) -> pd.DataFrame:
    """Mean and spread of trajectories over trials, place by place, beside the truth."""
    curves = [estimate.trajectories for estimate in estimates if estimate.trajectories is not None]
    if not curves:
        return pd.DataFrame()
    dimension = str(next(iter(curves[0].sizes)))
    start = max(float(curve[dimension][0]) for curve in curves)
    stop = min(float(curve[dimension][-1]) for curve in curves)
    coordinate = np.linspace(start, stop, PLACES)
    truths = profile_trajectories(settings, dimension, coordinate)
    tables = []
    for name in TRAJECTORIES:
        trials = pd.DataFrame(
            [np.interp(coordinate, curve[dimension], curve[name]) for curve in curves]
        )
        low, high = trials.quantile(SPREAD).to_numpy() if len(curves) > 1 else (np.nan, np.nan)
        table = {
            "place": coordinate,
            "truth": truths[name],
            "mean": trials.mean(),
            "sd": trials.std(),
            "low": low,
            "high": high,
            "n": trials.count(),
            "parameter": name,
            "dimension": dimension,
        }
        tables.append(pd.DataFrame(table))
    return pd.concat(tables, ignore_index=True)


def average_study(
    paths: Sequence[PathLike], points: Points, methods: Iterable[str]
) -> pd.DataFrame:
    """Mean trajectories of every setting and method of a study."""
    parts = []
    for (point, settings), method in product(points.items(), methods):
        estimates = load_estimates(paths, point, method).values()
        table = average_trajectories(estimates, settings)
        if not table.empty:
            parts.append(table.assign(point=point, method=method))
    if not parts:
        raise DataError("no estimate of the study has trajectories: add a method riv-tv.")
    return pd.concat(parts, ignore_index=True)


def measure_trajectories(details: pd.DataFrame, averages: pd.DataFrame) -> pd.DataFrame:
    r"""Errors of trajectories over trials: a row for each setting, method and parameter.

    Bias and random error are those of each place, as root mean squares over all places and over the mean of the truth:

    .. math:: \text{bias}^2 = \overline{(\overline{\hat K}(\tau) - K(\tau))^2}, \qquad
              \text{random}^2 = \overline{s^2(\tau)}, \qquad \text{total}^2 = \text{bias}^2 + \text{random}^2.
    """
    keys = ["point", "method"]
    curves = dict(iter(averages.groupby([*keys, "parameter"], sort=False)))
    names = [name for name in TRAJECTORIES if f"{name}_nrmse" in details]
    rows = []
    for (point, method), part in details.groupby(keys, sort=False):
        for name in names:
            row = {"point": point, "method": method, "parameter": name}
            scores = [f"{name}_{score}" for score in TRAJECTORY_SCORES.values()]
            statistics = measure_statistics(part, keys, scores)
            means = statistics[["mean", "margin"]].to_numpy()
            for column, (mean, margin) in zip(TRAJECTORY_SCORES, means, strict=True):
                row |= {column: mean, f"{column}_margin": margin}
            curve = curves.get((point, method, name), averages.head(0))
            scale = 100.0 / curve["truth"].mean()
            bias = scale * _root_mean_square(curve["mean"] - curve["truth"])
            random = scale * _root_mean_square(curve["sd"])
            row |= {"bias": bias, "random": random, "total": np.hypot(bias, random)}
            rows.append(row)
    return pd.DataFrame(rows).merge(count_outcomes(details, keys), how="left", on=keys)


def _root_mean_square(values: pd.Series) -> float:
    """Root of the mean of the squares of what has a value."""
    return np.sqrt((values**2).mean())


def compare_with_bound(details: pd.DataFrame, bounds: pd.DataFrame, method: str) -> pd.DataFrame:
    r"""Errors of a method beside the smallest ones of estimates without bias, for each setting that has a bound.

    `bounds` are those that `ankleloop_workflow.jobs.predictions.bound_trajectories` has, a row for each point.

    The efficiency is the mean square of the bound over all places, over the mean square error over places and trials.
    That of the mean over the places is likewise; with n trials of normal errors about the truth its 95 % interval is
    the efficiency times the quantiles of :math:`\chi^2_n / n`.
    """
    rows = []
    bounds = bounds.set_index("point")
    for point, part in details[details["method"] == method].groupby("point", sort=False):
        if point not in bounds.index:
            continue
        bound = bounds.loc[point]
        for name in TRAJECTORIES:
            unit = 100.0 / bound[f"{name}_truth"]
            means = part[f"{name}_bias"].dropna()
            error = _root_mean_square(part[f"{name}_nrmse"])
            limit = unit * bound[name]
            mean_error = _root_mean_square(means)
            mean_limit = unit * bound[f"{name}_mean"]
            mean_efficiency = 100.0 * (mean_limit / mean_error) ** 2
            ends = special.chdtri(means.size, (0.975, 0.025)) / means.size
            low, high = mean_efficiency * ends
            row = {
                "point": point,
                "parameter": name,
                "root_error": error,
                "bound": limit,
                "root_mean_error": mean_error,
                "mean_bound": mean_limit,
                "efficiency": 100.0 * (limit / error) ** 2,
                "mean_efficiency": mean_efficiency,
                "mean_low": low,
                "mean_high": high,
            }
            rows.append(row)
    return pd.DataFrame(rows)
