"""Studies of joints that change in time: mean trajectories over trials, their errors, and limits of these."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from scipy import stats

from ankleloop.assessment.cramer_rao import trajectory_bound
from ankleloop.assessment.scores import TRAJECTORY_TRUTHS
from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import load_estimates
from ankleloop.paper.captions import LOAD
from ankleloop.paper.trial_counts import count_outcomes
from ankleloop.signals.vaf import confidence_margin
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import draw_course, trajectories

NAMES = {"stiffness": "K", "viscosity": "B", "gain": "G"}  # of the trajectories of a simulation
SCORES = ("nrmse", "bias", "covered", "rise")  # of a trajectory in the table of trials
VARIATIONS = {"cycle": "{:g} cycles", "time": "over {:g} s", "schedule": "scheduling variable, {:g} s"}
PLACES = 101
SEED = 0  # of the perturbation, on which the bound hardly depends
SIMULATED = frozenset(SimulationSettings.model_fields)  # points of a study have options of methods beside these
COVERED = (92.0, 97.0)  # % of the places: shares that a 95 % band is taken to hold
SPREAD = (0.025, 0.975)  # quantiles of the trials


def profile_trajectories(settings: Mapping[str, Any], dimension: str, coordinate: np.ndarray) -> dict[str, np.ndarray]:
    """True K, B and G of a setting over what they vary with.

    Shapes: coordinate (places,); returns (places,).
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
    """Mean and spread of trajectories over trials, place by place, beside the truth."""
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
    """Mean trajectories of every setting and method of a study."""
    parts = []
    for (point, settings), method in product(points.items(), methods):
        table = average_trajectories(list(load_estimates(paths, point, method).values()), settings)
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
    """Smallest and largest number of whole cycles of a trial that were identified; empty without cycles."""
    counts = details["cycles"].dropna() if "cycles" in details else pd.Series(dtype=float)
    return " to ".join(dict.fromkeys(f"{count:.0f}" for count in (counts.min(), counts.max()) if counts.size))


def setting_titles(points: Mapping[str, Mapping[str, Any]], varied: Sequence[str]) -> dict[str, str]:
    """Each setting of a study in a few words: what differs between them."""
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
    """Published numbers beside which a study stands."""
    rows = published[published["study"] == study]
    texts = [
        f"{row.low:g} {row.unit}" if row.low == row.high else f"{row.low:g} to {row.high:g} {row.unit}"
        for row in rows.itertuples()
    ]
    return rows.assign(published=texts)[["measure", "published", "conditions", "source"]].reset_index(drop=True)


def typical_points(points: Mapping[str, Mapping[str, Any]], most: int = 4) -> list[str]:
    """Points that a figure shows: all of a few, else some at equal distances in their list."""
    names = list(points)
    if len(names) <= most:
        return names
    step = len(names) / most
    return [names[int((number + 0.5) * step)] for number in range(most)]


def compare_with_bound(details: pd.DataFrame, points: Mapping[str, Mapping[str, Any]], method: str) -> pd.DataFrame:
    r"""Errors of a method beside the smallest ones of estimates without bias, for each setting and parameter.

    The efficiency is the mean square of the bound over all places, over the mean square error over places and trials.
    That of the mean over the places is likewise; with n trials of normal errors about the truth its 95 % interval is
    the efficiency times the quantiles of :math:`\chi^2_n / n`.
    """
    rows = []
    for point, part in details[details["method"] == method].groupby("point", sort=False):
        settings = {name: points[str(point)][name] for name in points[str(point)] if name in SIMULATED}
        if settings.get("variation_shape") == "square":
            continue
        bound = trajectory_bound(seed=SEED, **settings)
        dimension = str(next(iter(bound.sizes)))
        truths = profile_trajectories(settings, dimension, bound[dimension].values)
        for name in TRAJECTORY_TRUTHS:
            unit = 100.0 / float(truths[name].mean())
            errors, means = part[f"{name}_nrmse"].dropna(), part[f"{name}_bias"].dropna()
            row = {"root_error": _mean_square(errors), "bound": unit**2 * float((bound[name] ** 2).mean())}
            row |= {"root_mean_error": _mean_square(means), "mean_bound": unit**2 * float(bound[f"{name}_mean"] ** 2)}
            mean_efficiency = 100.0 * row["mean_bound"] / row["root_mean_error"]
            low, high = mean_efficiency * stats.chi2.ppf((0.025, 0.975), means.size) / means.size
            efficiencies = {"efficiency": 100.0 * row["bound"] / row["root_error"], "mean_efficiency": mean_efficiency}
            roots = {key: float(np.sqrt(value)) for key, value in row.items()}
            rows.append(
                {"point": point, "parameter": name, **roots, **efficiencies, "mean_low": low, "mean_high": high}
            )
    return pd.DataFrame(rows)


def _mean_square(errors: pd.Series) -> float:
    return float((errors**2).mean())


def count_coverage(table: pd.DataFrame, titles: Mapping[str, str]) -> pd.DataFrame:
    """How many bands hold the truth at 92 to 97 % of the places, for each method and parameter."""
    low, high = COVERED
    rows = []
    bands = table.dropna(subset="covered")
    for (method, parameter), part in bands.groupby(["method", "parameter"], sort=False):
        margin = part["covered_margin"].fillna(np.inf)  # of a single trial
        less, more = part["covered"] + margin < low, part["covered"] - margin > high
        inside = (part["covered"] - margin >= low) & (part["covered"] + margin <= high)
        least = part.loc[part["covered"].idxmin()]
        counts = {"less": int(less.sum()), "more": int(more.sum()), "open": int((~(less | more | inside)).sum())}
        half = "" if np.isnan(least["covered_margin"]) else f" ± {least['covered_margin']:.0f}"
        smallest = f"{least['covered']:.0f}{half} ({titles[least['point']]})"
        rows.append({"method": method, "parameter": parameter, "settings": len(part), **counts, "smallest": smallest})
    return pd.DataFrame(rows, columns=["method", "parameter", "settings", "less", "more", "open", "smallest"])
