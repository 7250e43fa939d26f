"""Scores of an estimate against measured torques, and against true torques and trajectories of a simulation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations, product
from typing import Any, Literal

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.estimate import TRIM, Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import TORQUES
from ankleloop.joint.time_varying_course import ENDS
from ankleloop.options import check_choice, check_flag, check_number, show_value
from ankleloop.signals.vaf import vaf, vaf_with_interval

CORRELATED = 1.0  # s: over this the squares of torques may be correlated
DIAGNOSTICS = ("order", "spectral_radius", "passes", "converged", "stable", "reference", "cycles")
TRAJECTORY_TRUTHS = {
    "K": "stiffness_true",
    "B": "viscosity_true",
    "G": "reflex_gain_true",
}  # variables of a trial
TORQUE_TRUTHS = ("torque_intrinsic", "torque_reflex", "torque_noise")
DIMENSIONS = {
    "cycle": "phase",
    "time": "time",
    "schedule": "schedule",
}  # by the setting `variation`
PLACES = 101  # at which parameters that an estimate takes as constant are scored
LEVELS = (0.1, 0.9)  # shares of a step between which its rise is timed
JUMP = 0.5  # share of the range of a trajectory that is a jump if it lies between two places


def evaluate(
    trial: xr.Dataset | PreparedTrial,
    estimate: Estimate,
    *,
    trim: float = TRIM,
    against: Literal["measured"] | None = None,
    intervals: bool = False,
) -> pd.DataFrame:
    """Score the torques of an estimate by their VAF.

    The trial's torques are decimated exactly as the data of the estimate were. Net torque is scored against the
    measured torque and, in a simulation, against the true intrinsic plus reflex torque; the two parts against their
    truths. Without truths, or if they are to be ignored, every row is against the measured torque: the parts are then
    contributions, which do not add up.

    Parameters
    ----------
    trial : xarray.Dataset or PreparedTrial
        The trial that was identified.
    estimate : Estimate
        The estimate.
    trim : float
        Time at either end of the estimate that is not scored [s].
    against : {"measured"}, optional
        Ignore the truths of a simulation, as if it were a recording.
    intervals : bool
        Add columns `low` and `high` [%], the 95 % interval of the VAF that this model would have on an infinitely long
        record (see `ankleloop.signals.vaf.vaf_with_interval`).

    Returns
    -------
    pandas.DataFrame
        Columns `torque`, `against` (measured or true) and `vaf` [%].

    Raises
    ------
    DataError
        If the trial is not valid, or the estimate is shorter than what is trimmed.
    TypeError, ValueError
        For an argument of another type or out of its range.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> trial = simulate(seed=1, duration=20.0)
    >>> evaluate(trial, identify(trial))["torque"].tolist()
    ['net', 'net', 'intrinsic', 'reflex']
    """
    check_choice("evaluate", "against", against, ("measured", None))
    check_flag("evaluate", "intervals", intervals)
    rows = list(score_torques(prepare(trial), estimate, against, trim=trim, intervals=intervals))
    return pd.DataFrame(
        rows, columns=["torque", "against", "vaf", *(("low", "high") if intervals else ())]
    )


def score_torques(
    prepared: PreparedTrial,
    estimate: Estimate,
    against: str | None,
    *,
    trim: float = TRIM,
    intervals: bool = True,
) -> Iterator[tuple[Any, ...]]:
    """Rows of `evaluate`; a table of each trial would take most of the time."""
    inside, time, rate = _scored_samples(estimate, trim)
    recorded, tolerance = prepared.time, 0.5 / prepared.rate
    if (
        time[0] < recorded[0] - tolerance or time[-1] > recorded[-1] + tolerance
    ):  # of another trial, or of more of it
        raise DataError(
            f"the estimate covers {time[0]:g} to {time[-1]:g} s, the trial {recorded[0]:g} to {recorded[-1]:g} s: "
            "score it on the trial that was identified, or predict the torques of this one (estimate.predict)."
        )
    targets = list(product(TORQUES, ["measured"], [prepared.channel_at("torque", time, rate)]))
    if against is None and {"torque_intrinsic", "torque_reflex"} <= set(prepared.trial.data_vars):
        truths = {
            part: prepared.channel_at(f"torque_{part}", time, rate)
            for part in ("intrinsic", "reflex")
        }
        parts = [(part, "true", signal) for part, signal in truths.items() if np.ptp(signal) > 0]
        targets = [targets[0], ("net", "true", truths["intrinsic"] + truths["reflex"]), *parts]
    for torque, kind, signal in targets:
        pair = signal[inside], estimate.torque.variables[torque].values[inside]
        scores = vaf_with_interval(*pair, round(CORRELATED * rate)) if intervals else [vaf(*pair)]
        yield torque, kind, *scores


def _scored_samples(estimate: Estimate, trim: float) -> tuple[slice, np.ndarray, float]:
    """The samples of an estimate that are scored, the times of all samples [s] and their rate [Hz]."""
    if not isinstance(estimate, Estimate):
        raise TypeError(
            f"estimate must be an Estimate, as identify returns it, got {show_value(estimate)}."
        )
    trim = check_number("evaluate", "trim", trim, "s", ge=0, le=1e6)
    time = estimate.torque.variables["time"].values
    inside = slice(
        np.searchsorted(time, time[0] + trim), np.searchsorted(time, time[-1] - trim, side="right")
    )
    if inside.stop - inside.start < 2:
        raise DataError(
            f"the estimate covers {time[-1] - time[0]:.3g} s; nothing is left after a trim of {trim:g} s."
        )
    return inside, time, estimate.torque.attrs["identification_rate"]


def in_band_snr(trial: PreparedTrial, estimate: Estimate) -> float:
    """Signal-to-noise ratio of the torque within the band of the identification; of a trial with noise.

    Decimation removes more of the noise than of the torque, so this ratio is above that of the recorded signal.
    """
    inside, time, rate = _scored_samples(estimate, TRIM)
    intrinsic, reflex, noise = (
        trial.channel_at(name, time, rate)[inside] for name in TORQUE_TRUTHS
    )
    return float(10 * np.log10(np.var(intrinsic + reflex) / np.var(noise)))


def parameter_row(trial: xr.Dataset | PreparedTrial, estimate: Estimate) -> dict[str, Any]:
    """Parameters and diagnostics of an estimate as a row of a table."""
    prepared = prepare(trial)
    row: dict[str, Any] = _list_parameters(estimate)
    if estimate.intervals and estimate.diagnostics.get("intervals"):
        row["intervals"] = estimate.diagnostics["intervals"]
    if (
        set(TORQUE_TRUTHS) <= set(prepared.trial.data_vars)
        and np.ptp(prepared.samples["torque_noise"]) > 0
    ):
        row["in_band_snr_db"] = in_band_snr(prepared, estimate)
    row |= {
        name: estimate.diagnostics[name] for name in DIAGNOSTICS if name in estimate.diagnostics
    }
    settings = prepared.trial.attrs if "torque_reflex" in prepared.trial else {}
    if {"omega_n", "zeta"} <= set(settings) and "poles" in estimate.diagnostics:
        row |= _pole_error(np.asarray(estimate.diagnostics["poles"]), estimate, settings)
    if selection := estimate.diagnostics.get("selection"):
        chosen = selection["chosen"].items()
        scores = next(
            found["scores"] for found in selection["candidates"] if chosen <= found.items()
        )
        row |= {f"unseen_{name.replace('-', '_')}": score for name, score in scores.items()}
    if probabilities := estimate.diagnostics.get("variation_p"):
        row["variation_p"] = probabilities["all"]
    row |= score_trajectories(prepared, estimate)
    row["warnings"] = " ".join(estimate.diagnostics.get("warnings", ()))
    return row


def _list_parameters(estimate: Estimate) -> dict[str, float]:
    """Parameters of an estimate, and the ends of their intervals."""
    values = {**estimate.stiffness, **estimate.reflex}
    for name, (low, high) in estimate.intervals.items():
        values |= {f"{name}_low": low, f"{name}_high": high}
    return values


def _pole_error(
    poles: np.ndarray, estimate: Estimate, settings: Mapping[str, Any]
) -> dict[str, float]:
    """Largest distance between a pole and the true one that it stands for; none for a model of another order."""
    dynamics = ReflexDynamics(settings["omega_n"], settings["zeta"], settings.get("pole"))
    truth = np.linalg.eigvals(dynamics.matrices(estimate.torque.attrs["identification_rate"])[0])
    if poles.size != truth.size:
        return {}
    return {
        "pole_error": min(
            float(np.abs(poles - order).max()) for order in map(np.array, permutations(truth))
        )
    }


def true_trajectories(
    trial: xr.Dataset | PreparedTrial, trajectories: xr.Dataset | None = None
) -> xr.Dataset | None:
    """True K, B and G of a simulated trial over what they vary with."""
    prepared = prepare(trial)
    dimension = DIMENSIONS.get(str(prepared.trial.attrs.get("variation")))
    known = {dimension, *TRAJECTORY_TRUTHS.values()} <= set(map(str, prepared.trial.variables))
    if (
        dimension is None
        or not known
        or (trajectories is not None and dimension not in trajectories.dims)
    ):
        return None
    place = prepared.samples[dimension] - (prepared.time[0] if dimension == "time" else 0.0)
    if trajectories is None:
        coordinate = np.linspace(0.0 if dimension == "phase" else place.min(), place.max(), PLACES)
        coordinate[-1] = 1.0 if dimension == "phase" else coordinate[-1]
    else:
        coordinate = trajectories[dimension].values
    order = np.argsort(place, kind="stable")
    period = 1.0 if dimension == "phase" else None
    values = {
        name: (
            dimension,
            np.interp(coordinate, place[order], prepared.samples[variable][order], period=period),
        )
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
    values = (
        estimate.trajectories if estimate.trajectories is not None else _list_parameters(estimate)
    )
    row: dict[str, float] = {}
    for name, truth in truths.items():
        curves = [
            np.broadcast_to(values[f"{name}{end}"], truth.shape)
            for end in ENDS
            if f"{name}{end}" in values
        ]
        if curves:
            row |= {
                f"{name}_{score}": value for score, value in _score(truth.values, *curves).items()
            }
            rise = _mean_rise(truth, curves[0], prepared.trial.attrs)
            row |= {f"{name}_rise": rise} if np.isfinite(rise) else {}
    return row


def _score(truth: np.ndarray, curve: np.ndarray, *band: np.ndarray) -> dict[str, float]:
    """Error, bias and coverage [%] of a trajectory, with the ends of its band where it has one."""
    shown, mean = np.isfinite(curve), float(truth.mean())
    if not shown.any() or mean == 0:
        return {}
    error = (curve - truth)[shown]
    row = {
        "nrmse": 100.0 * float(np.sqrt(np.mean(error**2))) / mean,
        "bias": 100.0 * float(error.mean()) / mean,
    }
    if band and np.isfinite(band[0][shown]).all():
        row["covered"] = 100.0 * float(np.mean(((band[0] <= truth) & (truth <= band[1]))[shown]))
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
    steps = slice(below[-1], below[-1] + 2), slice(above[0] - 1, above[0] + 1)
    start, stop = (
        np.interp(level, share[step], coordinate[step])
        for level, step in zip(LEVELS, steps, strict=True)
    )
    return float(stop - start)
