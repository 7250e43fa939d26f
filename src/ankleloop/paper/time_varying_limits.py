"""What the errors and bands of trajectories are held against: the Cramér-Rao bound, the level, published errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from ankleloop.assessment.cramer_rao import trajectory_bound
from ankleloop.assessment.scores import TRAJECTORY_TRUTHS
from ankleloop.paper.captions import format_setting
from ankleloop.paper.time_varying import profile_trajectories
from ankleloop.simulation.settings import SimulationSettings

SEED = 0  # of the perturbation, on which the bound hardly depends
SIMULATED = frozenset(SimulationSettings.model_fields)  # points of a study have options of methods beside these
COVERED = (92.0, 97.0)  # % of the places: shares that a 95 % band is taken to hold


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


def describe_bound(label: str) -> str:
    """What the bound of trajectories is, and what an efficiency beyond it means, in sentences."""
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
    """What published errors of other methods can be compared with, in sentences."""
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
