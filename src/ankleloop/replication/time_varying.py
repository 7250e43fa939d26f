"""Studies of joints that change in time: mean trajectories over trials, and the measures of their errors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop.assessment.trajectory_scores import TRAJECTORY_TRUTHS
from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import find_estimates
from ankleloop.replication.captions import LOAD
from ankleloop.replication.trial_counts import count_outcomes
from ankleloop.signals.vaf import confidence_margin
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import draw_course, trajectories

__all__ = [
    "SPREAD",
    "average_study",
    "average_trajectories",
    "count_cycles",
    "describe_cycles",
    "measure_trajectories",
    "profile_trajectories",
    "published_rows",
    "setting_titles",
    "typical_points",
]

NAMES = {"stiffness": "K", "viscosity": "B", "gain": "G"}  # of the trajectories of a simulation
SCORES = ("nrmse", "bias", "covered", "rise")  # of a trajectory in the table of trials
VARIATIONS = {"cycle": "{:g} cycles", "time": "over {:g} s", "schedule": "scheduling variable, {:g} s"}
PLACES = 101
SPREAD = (0.025, 0.975)  # quantiles of the trials


def profile_trajectories(settings: Mapping[str, Any], dimension: str, coordinate: np.ndarray) -> dict[str, np.ndarray]:
    """True K, B and G of a setting over what they vary with.

    Parameters
    ----------
    settings : dict
        Simulation settings by name.
    dimension : {"phase", "time", "schedule"}
        What they vary with.
    coordinate : ndarray, shape (places,)
        Phase, time [s] or scheduling variable.

    Returns
    -------
    dict of str to ndarray, shape (places,)

    Examples
    --------
    >>> settings = {"variation": "schedule", "stiffness": 100.0, "stiffness_variation": 0.5}
    >>> profile_trajectories(settings, "schedule", np.array([0.0, 0.5]))["K"].tolist()
    [50.0, 150.0]
    """
    # Points of a study have options of methods beside the settings.
    known = {name: value for name, value in settings.items() if name in SimulationSettings.model_fields}
    chosen = SimulationSettings(**{**known, "cycle_jitter": 0.0})
    time = coordinate * chosen.cycle_duration
    if dimension != "phase":  # a straight path over a record of any length takes each place in turn
        chosen = chosen.model_copy(update={"variation": "time"})
        time = coordinate * (chosen.duration if dimension == "schedule" else 1.0)
    truth = trajectories(draw_course(chosen, np.random.default_rng(0)), time)
    return {NAMES[name]: values for name, values in truth._asdict().items()}


def average_trajectories(estimates: Sequence[Estimate], settings: Mapping[str, Any]) -> pd.DataFrame:
    """Mean and spread of trajectories over trials, place by place, beside the truth.

    Parameters
    ----------
    estimates : sequence of Estimate
        Estimates of trials of one setting by one method; those without trajectories are left out.
    settings : dict
        Its simulation settings.

    Returns
    -------
    pandas.DataFrame
        Columns `parameter`, `dimension`, `place`, `truth`, `mean`, `sd`, `low` and `high` (2.5 and 97.5 % of the
        trials), and `n`, the trials in which the parameter was identified there. Empty without trajectories.

    Examples
    --------
    >>> average_trajectories([], {}).columns.tolist()[:3]
    ['parameter', 'dimension', 'place']
    """
    columns = ["parameter", "dimension", "place", "truth", "mean", "sd", "low", "high", "n"]
    curves = [estimate.trajectories for estimate in estimates if estimate.trajectories is not None]
    if not curves:
        return pd.DataFrame(columns=columns)
    (dimension,) = curves[0].sizes
    places = [curve[dimension].values for curve in curves]
    coordinate = np.linspace(max(place[0] for place in places), min(place[-1] for place in places), PLACES)
    truths = profile_trajectories(settings, str(dimension), coordinate)
    parts = [_average(name, truths[name], str(dimension), coordinate, curves) for name in TRAJECTORY_TRUTHS]
    return pd.concat(parts, ignore_index=True)[columns]


def average_study(
    paths: Sequence[str | PathLike[str]], points: Mapping[str, Mapping[str, Any]], methods: Iterable[str]
) -> pd.DataFrame:
    """Mean trajectories of every setting and method of a study.

    Parameters
    ----------
    paths : sequence of path-like
        Estimate files of its chunks.
    points : dict of str to dict
        Simulation settings of each point.
    methods : iterable of str
        Names of its methods; those without trajectories have no rows.

    Returns
    -------
    pandas.DataFrame
        Tables of `average_trajectories` with columns `point` and `method`.

    Raises
    ------
    DataError
        If a file is missing or damaged, or no estimate has trajectories.
    """
    parts = []
    for (point, settings), method in product(points.items(), methods):
        table = average_trajectories(list(find_estimates(paths, point, method).values()), settings)
        if len(table):
            parts.append(table.assign(point=point, method=method))
    if not parts:
        raise DataError("no estimate of the study has trajectories: add a method riv-tv.")
    return pd.concat(parts, ignore_index=True)


def _average(
    name: str, truth: np.ndarray, dimension: str, coordinate: np.ndarray, curves: Sequence[xr.Dataset]
) -> pd.DataFrame:
    """Mean and spread of one parameter."""
    values = np.stack([np.interp(coordinate, curve[dimension].values, curve[name].values) for curve in curves])
    table = pd.DataFrame({"place": coordinate, "truth": truth}).assign(parameter=name, dimension=dimension)
    table["n"] = np.isfinite(values).sum(axis=0)
    shown = table["n"].to_numpy() > 0
    for column in ("mean", "sd", "low", "high"):
        table[column] = np.nan
    seen = values[:, shown]
    table.loc[shown, "mean"] = np.nanmean(seen, axis=0)
    if len(curves) > 1:
        table.loc[shown, ["low", "high"]] = np.nanquantile(seen, SPREAD, axis=0).T
        table.loc[table["n"] > 1, "sd"] = np.nanstd(values[:, table["n"] > 1], axis=0, ddof=1)
    return table


def measure_trajectories(details: pd.DataFrame, averages: pd.DataFrame) -> pd.DataFrame:
    r"""Errors of trajectories over trials: a row for each setting, method and parameter.

    Bias and random error are those of each place, as root mean squares over all places and over the mean of the truth:

    .. math:: \text{bias}^2 = \overline{(\overline{\hat K}(\tau) - K(\tau))^2}, \qquad
              \text{random}^2 = \overline{s^2(\tau)}, \qquad \text{total}^2 = \text{bias}^2 + \text{random}^2.

    Parameters
    ----------
    details : pandas.DataFrame
        Rows of `ankleloop.assessment.scores.parameter_row` with columns `point`, `method` and `trial`.
    averages : pandas.DataFrame
        Tables of `average_trajectories` with columns `point` and `method`.

    Returns
    -------
    pandas.DataFrame
        Columns `point`, `method`, `parameter`; `error` and `mean_error`, means over trials of the error of a trajectory
        and of its mean over all places, and `covered`, that of the share of the places at which the band holds the
        truth, each with half of its 95 % interval (`error_margin` …); `bias`, `random` and `total`, all in percent;
        `rise`, mean time from 10 to 90 % of a step [s]; and the columns of
        `ankleloop.replication.trial_counts.count_outcomes`. What a method does not have is empty.

    Examples
    --------
    >>> details = pd.DataFrame({"point": "p", "method": "m", "trial": [0, 1], "K_nrmse": [2.0, 4.0]})
    >>> averages = pd.DataFrame({"point": "p", "method": "m", "parameter": "K", "truth": 100.0, "mean": [103.0, 103.0]})
    >>> row = measure_trajectories(details, averages.assign(sd=4.0)).iloc[0]
    >>> [round(float(row[name]), 3) for name in ("error", "bias", "random", "total")]
    [3.0, 3.0, 4.0, 5.0]
    """
    rows = []
    curves = dict(iter(averages.groupby(["point", "method", "parameter"], sort=False)))
    for (point, method), part in details.groupby(["point", "method"], sort=False):
        for name in TRAJECTORY_TRUTHS:
            if f"{name}_nrmse" not in details:
                continue
            values = {score: part.get(f"{name}_{score}", pd.Series(dtype=float)).dropna() for score in SCORES}
            row = {"point": point, "method": method, "parameter": name}
            for column, score in (("error", "nrmse"), ("mean_error", "bias"), ("covered", "covered")):
                sample = values[score]
                row |= {column: sample.mean(), f"{column}_margin": confidence_margin(sample.std(), sample.size)}
            row |= _divide_error(curves.get((point, method, name)))
            rows.append(row | {"rise": values["rise"].mean()})
    keys = ["point", "method"]
    return pd.DataFrame(rows).merge(count_outcomes(details, keys), how="left", on=keys)


def _divide_error(curve: pd.DataFrame | None) -> dict[str, float]:
    """Bias, random and total error of a mean trajectory [%]."""
    if curve is None:
        return dict.fromkeys(("bias", "random", "total"), np.nan)
    scale = 100.0 / float(curve["truth"].mean())
    bias = scale * float(np.sqrt(((curve["mean"] - curve["truth"]) ** 2).mean()))
    random = scale * float(np.sqrt((curve["sd"] ** 2).mean()))
    return {"bias": bias, "random": random, "total": float(np.hypot(bias, random))}


def count_cycles(details: pd.DataFrame) -> str:
    """Smallest and largest number of whole cycles of a trial that were identified; empty without cycles.

    Parameters
    ----------
    details : pandas.DataFrame
        Rows of `ankleloop.assessment.scores.parameter_row`.

    Returns
    -------
    str

    Examples
    --------
    >>> count_cycles(pd.DataFrame({"cycles": [10.0, 38.0, None]}))
    '10 to 38'
    """
    counts = details["cycles"].dropna() if "cycles" in details else pd.Series(dtype=float)
    return " to ".join(dict.fromkeys(f"{count:.0f}" for count in (counts.min(), counts.max()) if counts.size))


def describe_cycles(details: pd.DataFrame) -> str:
    """How many whole cycles of a trial were identified, in a sentence; empty without cycles.

    Parameters
    ----------
    details : pandas.DataFrame
        Rows of `ankleloop.assessment.scores.parameter_row`.

    Returns
    -------
    str

    Examples
    --------
    >>> describe_cycles(pd.DataFrame({"cycles": [10.0, 38.0, None]}))
    ' Of a trial 10 to 38 whole cycles are identified, those that no edge of the record touches.'
    """
    cycles = count_cycles(details)
    return f" Of a trial {cycles} whole cycles are identified, those that no edge of the record touches." * bool(cycles)


def setting_titles(points: Mapping[str, Mapping[str, Any]], varied: Sequence[str]) -> dict[str, str]:
    """Each setting of a study in a few words: what differs between them.

    Parameters
    ----------
    points : dict of str to dict
        Settings of each point.
    varied : sequence of str
        Settings and options that differ between them.

    Returns
    -------
    dict of str to str

    Examples
    --------
    >>> settings = SimulationSettings.defaults() | {"variation": "cycle", "voluntary": 0.3, "duration": 56.0}
    >>> setting_titles({"a": settings}, ["load_inertia", "voluntary"])
    {'a': 'load 1.1/7.1/250, voluntary 30 %, 40 cycles'}
    """
    return {point: _title(settings, varied) for point, settings in points.items()}


def _title(settings: Mapping[str, Any], varied: Sequence[str]) -> str:
    parts = []
    if set(LOAD) & set(varied):
        parts.append("load " + "/".join(f"{settings[name]:g}" for name in LOAD))
    if "voluntary" in varied:
        parts.append(f"voluntary {100 * settings['voluntary']:g} %")
    extent = settings["duration"] / (settings["cycle_duration"] if settings["variation"] == "cycle" else 1.0)
    parts.append(VARIATIONS[settings["variation"]].format(round(extent, 6)))
    if settings["variation"] == "cycle" and settings["cycle_jitter"]:
        parts.append(f"durations ± {100 * settings['cycle_jitter']:g} %")
    return ", ".join(parts)


def published_rows(published: pd.DataFrame, study: str) -> pd.DataFrame:
    """Published numbers beside which a study stands.

    Parameters
    ----------
    published : pandas.DataFrame
        data/published/time_varying.csv: columns `study`, `measure`, `low`, `high`, `unit`, `conditions` and `source`.
    study : str
        Name of the study.

    Returns
    -------
    pandas.DataFrame
        Columns `measure`, `published`, `conditions` and `source`, as text; empty where there are none.

    Examples
    --------
    >>> row = {"study": "s", "measure": "error", "low": 1.3, "high": 4.1, "unit": "%", "conditions": "", "source": "A"}
    >>> published_rows(pd.DataFrame([row]), "s")["published"].tolist()
    ['1.3 to 4.1 %']
    """
    rows = published[published["study"] == study]
    texts = [
        f"{row.low:g} {row.unit}" if row.low == row.high else f"{row.low:g} to {row.high:g} {row.unit}"
        for row in rows.itertuples()
    ]
    return rows.assign(published=texts)[["measure", "published", "conditions", "source"]].reset_index(drop=True)


def typical_points(points: Mapping[str, Mapping[str, Any]], most: int = 4) -> list[str]:
    """Points that a figure shows: all of a few, else some at equal distances in their list.

    Parameters
    ----------
    points : dict of str to dict
        Settings of each point.
    most : int
        How many there is room for.

    Returns
    -------
    list of str

    Examples
    --------
    >>> typical_points(dict.fromkeys("abcdefg", {}), 3)
    ['b', 'd', 'f']
    """
    names = list(points)
    if len(names) <= most:
        return names
    step = len(names) / most
    return [names[int((number + 0.5) * step)] for number in range(most)]
