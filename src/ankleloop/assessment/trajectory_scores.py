"""Scores of trajectories against the true ones of a simulation: error, bias, coverage of bands, rise time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare

TRAJECTORY_TRUTHS = {"K": "stiffness_true", "B": "viscosity_true", "G": "reflex_gain_true"}  # variables of a trial
DIMENSIONS = {"cycle": "phase", "time": "time", "schedule": "schedule"}  # by the setting `variation`
PLACES = 101  # at which parameters that an estimate takes as constant are scored
LEVELS = (0.1, 0.9)  # shares of a step between which its rise is timed
JUMP = 0.5  # share of the range of a trajectory that is a jump if it lies between two places


def true_trajectories(trial: xr.Dataset | PreparedTrial, trajectories: xr.Dataset | None = None) -> xr.Dataset | None:
    """True K, B and G of a simulated trial over what they vary with."""
    prepared = prepare(trial)
    dimension = DIMENSIONS.get(str(prepared.trial.attrs.get("variation")))
    if dimension is None or not {dimension, *TRAJECTORY_TRUTHS.values()} <= set(map(str, prepared.trial.variables)):
        return None
    place = prepared.samples(dimension)
    if dimension == "time":
        place = place - place[0]
    if trajectories is None:
        coordinate = np.linspace(0.0 if dimension == "phase" else place.min(), place.max(), PLACES)
        coordinate[-1] = 1.0 if dimension == "phase" else coordinate[-1]
    elif dimension in trajectories.dims:
        coordinate = trajectories[dimension].values
    else:
        return None
    order = np.argsort(place, kind="stable")
    period = 1.0 if dimension == "phase" else None
    values = {
        name: (dimension, np.interp(coordinate, place[order], prepared.samples(variable)[order], period=period))
        for name, variable in TRAJECTORY_TRUTHS.items()
    }
    return xr.Dataset(values, coords={dimension: coordinate})


def score_trajectories(trial: xr.Dataset | PreparedTrial, estimate: Estimate) -> dict[str, float]:
    """Scores of the trajectories of an estimate against the true ones, as columns of a row.

    All places of what the parameters vary with count alike; those where a parameter is not identified are left out. An
    estimate without trajectories is scored as one whose K, B and G are constant.
    """
    prepared = prepare(trial)
    truths = true_trajectories(prepared, estimate.trajectories)
    if truths is None:
        return {}
    trajectories = estimate.trajectories if estimate.trajectories is not None else _constants(estimate, truths)
    row: dict[str, float] = {}
    for name in TRAJECTORY_TRUTHS:
        if name in trajectories:
            curves = {
                end: trajectories[name + end].values for end in ("", "_low", "_high") if name + end in trajectories
            }
            row |= {f"{name}_{score}": value for score, value in _score(truths[name].values, curves).items()}
            rise = _mean_rise(truths[name], trajectories[name].values, prepared.trial.attrs)
            row |= {f"{name}_rise": rise} if np.isfinite(rise) else {}
    return row


def _constants(estimate: Estimate, truths: xr.Dataset) -> xr.Dataset:
    """Trajectories of an estimate whose parameters are constant."""
    (dimension,) = truths.sizes
    values = {**estimate.stiffness, **estimate.reflex}
    for name, ends in estimate.intervals.items():
        values |= dict(zip((f"{name}_low", f"{name}_high"), ends, strict=True))
    names = [name + end for name in TRAJECTORY_TRUTHS for end in ("", "_low", "_high") if name + end in values]
    return xr.Dataset({name: (dimension, np.full(truths.sizes[dimension], values[name])) for name in names})


def _score(truth: np.ndarray, curves: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Error, bias and coverage [%] of a trajectory with its band."""
    shown = np.isfinite(curves[""])
    mean = float(truth.mean())
    if not shown.any() or mean == 0:
        return {}
    error = (curves[""] - truth)[shown]
    row = {"nrmse": 100.0 * float(np.sqrt(np.mean(error**2))) / mean, "bias": 100.0 * float(error.mean()) / mean}
    if "_low" in curves and np.isfinite(curves["_low"][shown]).all():
        held = (curves["_low"] <= truth) & (truth <= curves["_high"])
        row["covered"] = 100.0 * float(np.mean(held[shown]))
    return row


def _mean_rise(truth: xr.DataArray, curve: np.ndarray, settings: Mapping[str, object]) -> float:
    """Mean time from 10 to 90 % of the steps of a square wave [s]; nan where there is none, or the curve misses one."""
    (dimension,) = truth.dims
    values, coordinate = truth.values, truth[dimension].values
    limit = JUMP * float(np.ptp(values))
    if settings.get("variation_shape") != "square" or dimension == "schedule" or limit == 0:
        return np.nan
    if dimension == "phase":  # the cycle is cut far from the steps; its last place is the first one
        coordinate = coordinate * float(str(settings["cycle_duration"]))
        values, curve = values[:-1], curve[:-1]
        steps = np.flatnonzero(np.abs(np.roll(values, -1) - values) > limit)
        start = steps[0] + 1 + np.diff(steps, append=steps[0] + values.size)[0] // 2
        values, curve = np.roll(values, -start), np.roll(curve, -start)
    jumps = np.flatnonzero(np.abs(np.diff(values)) > limit)
    if jumps.size == 0:
        return np.nan
    edges = [0, *((jumps[1:] + jumps[:-1]) // 2 + 1), values.size]
    rises = []
    for jump, start, stop in zip(jumps, edges[:-1], edges[1:], strict=True):
        share = (curve[start:stop] - values[jump]) / (values[jump + 1] - values[jump])
        rises.append(_rise(coordinate[start:stop], share, jump - start))
    return float(np.mean(rises))


def _rise(coordinate: np.ndarray, share: np.ndarray, jump: int) -> float:
    """Distance between the places at which a step from 0 to 1 passes 10 % for the last and 90 % for the first time."""
    middle = np.flatnonzero(np.diff(share >= 0.5))
    if middle.size == 0 or not np.isfinite(share).all():
        return np.nan
    middle = middle[np.argmin(np.abs(middle - jump))]
    below = np.flatnonzero(share[: middle + 1] <= LEVELS[0])
    above = np.flatnonzero(share[middle + 1 :] >= LEVELS[1]) + middle + 1
    if below.size == 0 or above.size == 0:
        return np.nan
    ends = []
    for first, level in ((int(below[-1]), LEVELS[0]), (int(above[0]) - 1, LEVELS[1])):
        part = (level - share[first]) / (share[first + 1] - share[first])
        ends.append(coordinate[first] + part * (coordinate[first + 1] - coordinate[first]))
    return float(ends[1] - ends[0])
