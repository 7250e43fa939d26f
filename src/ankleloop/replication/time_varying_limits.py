"""What the errors and bands of trajectories are held against: the Cramér-Rao bound, the level, published errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from ankleloop.assessment.trajectory_bound import trajectory_bound
from ankleloop.assessment.trajectory_scores import TRAJECTORY_TRUTHS
from ankleloop.replication.captions import format_setting
from ankleloop.replication.time_varying import profile_trajectories
from ankleloop.simulation.settings import SimulationSettings

__all__ = ["COVERED", "compare_with_bound", "count_coverage", "describe_bound", "describe_comparison"]

SEED = 0  # of the perturbation, on which the bound hardly depends
SIMULATED = frozenset(SimulationSettings.model_fields)  # points of a study have options of methods beside these
COVERED = (92.0, 97.0)  # % of the places: shares that a 95 % band is taken to hold


def compare_with_bound(details: pd.DataFrame, points: Mapping[str, Mapping[str, Any]], method: str) -> pd.DataFrame:
    r"""Errors of a method beside the smallest ones of estimates without bias, for each setting and parameter.

    The efficiency is the mean square of the bound over all places, over the mean square error over places and trials.
    That of the mean over the places is likewise; with n trials of normal errors about the truth its 95 % interval is
    the efficiency times the quantiles of :math:`\chi^2_n / n`.

    Parameters
    ----------
    details : pandas.DataFrame
        Rows of `ankleloop.assessment.scores.parameter_row` with columns `point`, `method` and `trial`.
    points : dict of str to dict
        Simulation settings of each point. Those of a square wave have no bound here, for no splines are its truth.
    method : str
        The method; its trajectories have the default numbers of splines.

    Returns
    -------
    pandas.DataFrame
        Columns `point`, `parameter`; `root_error` and `bound`, root mean squares over places and trials;
        `root_mean_error` and `mean_bound`, those of the mean over the places; all in percent of the mean of the truth;
        and `efficiency`, `mean_efficiency`, `mean_low` and `mean_high` [%].

    Examples
    --------
    >>> point = {"variation": "cycle", "duration": 42.0, "stiffness_variation": 0.4}
    >>> scores = {f"{name}_{score}": [3.0, 4.0] for name in "KBG" for score in ("nrmse", "bias")}
    >>> table = compare_with_bound(pd.DataFrame({"point": "p", "method": "m", **scores}), {"p": point}, "m")
    >>> bool((table["mean_bound"] < table["bound"]).all()), table["root_error"].round(3).tolist()
    (True, [3.536, 3.536, 3.536])
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
    """How many bands hold the truth at 92 to 97 % of the places, for each method and parameter.

    Parameters
    ----------
    table : pandas.DataFrame
        Table of `ankleloop.replication.time_varying.measure_trajectories`.
    titles : dict of str to str
        Each setting in a few words.

    Returns
    -------
    pandas.DataFrame
        Columns `method`, `parameter`, `settings`; `less` and `more`, settings in which the 95 % interval of the mean
        share over trials lies below 92 % or above 97 %; `open`, those in which it reaches across one of these limits;
        `smallest`, the smallest share with half of its interval and its setting. Methods without bands have no row.

    Examples
    --------
    >>> table = pd.DataFrame({"point": ["a", "b"], "method": "m", "parameter": "K", "covered": [70.0, 95.0]})
    >>> counts = count_coverage(table.assign(covered_margin=3.0), {"a": "20 cycles", "b": "40 cycles"})
    >>> counts[["settings", "less", "more", "open", "smallest"]].to_numpy().tolist()
    [[2, 1, 0, 1, '70 ± 3 (20 cycles)']]
    """
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


def describe_bound(label: str) -> str:
    """What the bound of trajectories is, and what an efficiency beyond it means, in sentences.

    Parameters
    ----------
    label : str
        Label of the method.

    Returns
    -------
    str

    Examples
    --------
    >>> describe_bound("riv-tv").split(", ")[0]
    'riv-tv beside the Cramér-Rao bound'
    """
    return (
        f"{label} beside the Cramér-Rao bound, the smallest error of estimates without bias. Its parameters are the "
        "coefficients of the splines, in the numbers that are the default of riv-tv; it is that of one perturbation in "
        "each setting, with the delay known. Errors are root mean squares over places and trials, in percent of the "
        "mean of the truth. The efficiency is the square of the bound over that of the error. A method that smooths "
        "may be beyond the bound, with an efficiency above 100 %: it takes trajectories for smooth, and so knows more "
        "than the record tells. The mean over all places gains nothing from smoothing, and there the bound holds; in "
        "brackets are 95 % intervals of that efficiency, which a few trials leave wide."
    )


def describe_comparison(settings: Mapping[str, Any], cycles: str) -> str:
    """What published errors of other methods can be compared with, in sentences.

    Parameters
    ----------
    settings : dict
        Simulation settings of the study.
    cycles : str
        Numbers of whole cycles that were identified.

    Returns
    -------
    str

    Examples
    --------
    >>> settings = SimulationSettings.defaults() | {"snr_db": 15.0, "closed_loop": False, "cycle_duration": 1.4}
    >>> describe_comparison(settings, "10").split(". ")[0]
    'Here: 10 cycles of 1.4 s, measurement noise at 15 dB, open loop'
    """
    loop = "closed loop" if settings["closed_loop"] else "open loop"
    noise = "no measurement noise"
    if settings["snr_db"] is not None:
        noise = f"measurement noise at {format_setting('snr_db', settings['snr_db'])}"
    return (
        f"Here: {cycles} cycles of {settings['cycle_duration']:g} s, {noise}, {loop}. These conditions can be compared "
        "with the published ones. The joint, how far its parameters change and the perturbation are others: our joint "
        "has a reflex whose gain changes, too. What an error is divided by may be something else than here, where it "
        "is the mean of the parameter over the cycle. So the numbers show whether the errors are of one size, and not "
        "which method has the smaller ones."
    )
