"""Scores of an estimate against measured torques, and against true torques and trajectories of a simulation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import permutations
from typing import Any, Literal

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.estimate import TRIM, Estimate, join_centred, scored_samples
from ankleloop.joint.prepared import (
    PreparedTrial,
    Trials,
    prepare,
    prepare_trials,
    sample_channel,
)
from ankleloop.joint.regressors import TORQUES, split_torques
from ankleloop.joint.time_varying_course import ENDS
from ankleloop.options import check_argument, check_flag, check_number, show_value
from ankleloop.signals.vaf import vaf, vaf_with_interval

CORRELATION_TIME = 1.0  # s: over this the squares of torques may be correlated
ROW_DIAGNOSTICS = (
    "order",
    "spectral_radius",
    "passes",
    "converged",
    "stable",
    "reference",
    "cycles",
)
# Variables of a trial.
TRAJECTORY_TRUTHS = {"K": "stiffness_true", "B": "viscosity_true", "G": "reflex_gain_true"}
TORQUE_TRUTHS = ("torque_intrinsic", "torque_reflex", "torque_noise")
# By the setting `variation`.
COURSE_DIMENSIONS = {"cycle": "phase", "time": "time", "schedule": "schedule"}
SCORED_PLACES = 101  # at which parameters that an estimate takes as constant are scored


def evaluate(
    trial: Trials,
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
    contributions, which do not add up. Of merged trials the samples of all count together, each trial less its mean.

    Parameters
    ----------
    trial : xarray.Dataset or PreparedTrial, or list of those
        The trial that was identified, or all that were merged.
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

    See Also
    --------
    ankleloop.vaf : The variance accounted for of two signals.
    ankleloop.identify : Makes the estimate.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> trial = simulate(seed=1, duration=20.0)
    >>> evaluate(trial, identify(trial))["torque"].tolist()
    ['net', 'net', 'intrinsic', 'reflex']
    """
    check_argument(Literal["measured", None], "evaluate", "against", against)
    check_flag("evaluate", "intervals", intervals)
    trials = prepare_trials(trial)
    rows = score_torques(trials, estimate, against, trim=trim, intervals=intervals)
    columns = ["torque", "against", "vaf"]
    if intervals:
        columns += ["low", "high"]
    return pd.DataFrame(rows, columns=columns)


def score_torques(
    trials: Sequence[PreparedTrial],
    estimate: Estimate,
    against: str | None,
    *,
    trim: float = TRIM,
    intervals: bool = True,
) -> Iterator[tuple[Any, ...]]:
    """Rows of `evaluate`; a table of each trial would take most of the time."""
    samples = _find_samples(estimate, trim)
    _refuse_other_trials(trials, estimate)
    torque = estimate.torque
    measured = _sample(trials, "torque", estimate)
    targets = [(name, "measured", measured) for name in TORQUES]
    if against is None and all(has_truths(trial) for trial in trials):
        truths = {name: _sample(trials, f"torque_{name}", estimate) for name in TORQUES[1:]}
        targets = [targets[0], ("net", "true", truths["intrinsic"] + truths["reflex"])]
        targets += [(name, "true", truth) for name, truth in truths.items() if np.ptp(truth) > 0]
    lags = round(CORRELATION_TIME * torque.attrs["identification_rate"])
    for name, kind, signal in targets:
        target = join_centred(signal, samples)
        estimated = join_centred(torque.variables[name].values, samples)
        if intervals:
            yield name, kind, *vaf_with_interval(target, estimated, lags)
        else:
            yield name, kind, vaf(target, estimated)


def _sample(trials: Sequence[PreparedTrial], name: str, estimate: Estimate) -> np.ndarray:
    """A variable of trials at the samples of an estimate, shape (N,)."""
    return np.concatenate(sample_channel(trials, name, estimate.torque))


def has_truths(trial: PreparedTrial) -> bool:
    """Whether a trial has the true torques of a simulation."""
    return {"torque_intrinsic", "torque_reflex"} <= set(trial.trial.data_vars)


def _refuse_other_trials(trials: Sequence[PreparedTrial], estimate: Estimate) -> None:
    """Refuse trials that do not cover the times of an estimate: other trials, or parts of those identified."""
    for trial, part in zip(trials, split_torques(estimate.torque), strict=False):
        time = part.variables["time"].values
        recorded = trial.time
        tolerance = 0.5 / trial.rate
        if time[0] < recorded[0] - tolerance or time[-1] > recorded[-1] + tolerance:
            raise DataError(
                f"the estimate covers {time[0]:g} to {time[-1]:g} s, the trial {recorded[0]:g} to {recorded[-1]:g} s: "
                "score it on the trial that was identified, or predict the torques of this one (estimate.predict)."
            )


def _find_samples(estimate: Estimate, trim: float) -> list[slice]:
    """The samples of an estimate that are scored, of each trial."""
    if not isinstance(estimate, Estimate):
        raise TypeError(
            f"estimate must be an Estimate, as identify returns it, got {show_value(estimate)}."
        )
    trim = check_number("evaluate", "trim", trim, "s", ge=0, le=1e6)
    samples = scored_samples(estimate.torque, trim)
    if min(part.stop - part.start for part in samples) < 2:
        time = split_torques(estimate.torque)[0]["time"].values
        raise DataError(
            f"the estimate covers {time[-1] - time[0]:.3g} s; nothing is left after a trim of {trim:g} s."
        )
    return samples


def in_band_snr(trial: Trials, estimate: Estimate) -> float:
    """Signal-to-noise ratio of the torque within the band of the identification; of a trial with noise.

    Decimation removes more of the noise than of the torque, so this ratio is above that of the recorded signal.
    """
    trials = prepare_trials(trial)
    samples = _find_samples(estimate, TRIM)
    intrinsic, reflex, noise = (
        join_centred(_sample(trials, name, estimate), samples) for name in TORQUE_TRUTHS
    )
    ratio = np.var(intrinsic + reflex) / np.var(noise)
    return float(10 * np.log10(ratio))


def parameter_row(trial: Trials, estimate: Estimate) -> dict[str, Any]:
    """Parameters and diagnostics of an estimate as a row of a table; true values are those of the first trial."""
    trials = prepare_trials(trial)
    prepared = trials[0]
    diagnostics = estimate.diagnostics
    row: dict[str, Any] = list_parameters(estimate)
    if estimate.intervals and diagnostics.get("intervals"):
        row["intervals"] = diagnostics["intervals"]
    has_noise = set(TORQUE_TRUTHS) <= set(prepared.trial.data_vars)
    if has_noise and np.ptp(prepared.samples["torque_noise"]) > 0:
        row["in_band_snr_db"] = in_band_snr(trials, estimate)
    row |= {name: diagnostics[name] for name in ROW_DIAGNOSTICS if name in diagnostics}
    settings = prepared.trial.attrs if "torque_reflex" in prepared.trial else {}
    if {"omega_n", "zeta"} <= set(settings) and "poles" in diagnostics:
        row |= _compare_poles(np.asarray(diagnostics["poles"]), estimate, settings)
    if "apparatus" in diagnostics:
        row["apparatus"] = diagnostics["apparatus"]["fingerprint"]
        shared = diagnostics["apparatus"]["standard_errors"]
        row |= {f"{name}_apparatus": error for name, error in shared.items()}
    if "selection" in diagnostics:
        selection = diagnostics["selection"]
        chosen = selection["chosen"].items()
        scores = next(
            candidate["scores"]
            for candidate in selection["candidates"]
            if chosen <= candidate.items()
        )
        row |= {f"unseen_{name.replace('-', '_')}": score for name, score in scores.items()}
    if diagnostics.get("variation_p"):
        row["variation_p"] = diagnostics["variation_p"]["all"]
    row |= score_trajectories(prepared, estimate)
    row["warnings"] = " ".join(estimate.warnings)
    return row


def list_parameters(estimate: Estimate) -> dict[str, float]:
    """Parameters of an estimate, and the ends of their intervals."""
    values = estimate.values
    for name, (low, high) in estimate.intervals.items():
        values |= {f"{name}_low": low, f"{name}_high": high}
    return values


def _compare_poles(
    poles: np.ndarray, estimate: Estimate, settings: Mapping[str, Any]
) -> dict[str, float]:
    """True spectral radius at the rate of the identification, and the error of the poles.

    That is the largest distance between a pole and the true one that it stands for; a model of another order has none.
    """
    dynamics = ReflexDynamics(settings["omega_n"], settings["zeta"], settings.get("pole"))
    truth = np.linalg.eigvals(dynamics.matrices(estimate.torque.attrs["identification_rate"])[0])
    row = {"spectral_radius_true": float(np.abs(truth).max())}
    if poles.size == truth.size:
        errors = [np.abs(poles - np.array(order)).max() for order in permutations(truth)]
        row["pole_error"] = float(min(errors))
    return row


def true_trajectories(
    trial: xr.Dataset | PreparedTrial, trajectories: xr.Dataset | None = None
) -> xr.Dataset | None:
    """True K, B and G of a simulated trial over what they vary with."""
    prepared = prepare(trial)
    dimension = COURSE_DIMENSIONS.get(str(prepared.trial.attrs.get("variation")), "")
    if not {dimension, *TRAJECTORY_TRUTHS.values()} <= set(prepared.samples):
        return None
    if trajectories is not None and dimension not in trajectories.dims:
        return None
    place = prepared.samples[dimension]
    if dimension == "time":
        place = place - prepared.time[0]
    period = 1.0 if dimension == "phase" else None
    if trajectories is not None:
        coordinate = trajectories[dimension].values
    elif period is None:
        coordinate = np.linspace(place.min(), place.max(), SCORED_PLACES)
    else:
        coordinate = np.linspace(0.0, place.max(), SCORED_PLACES)
        coordinate[-1] = period
    order = np.argsort(place, kind="stable")
    truths = xr.Dataset(coords={dimension: coordinate})
    for name, variable in TRAJECTORY_TRUTHS.items():
        truth = prepared.samples[variable]
        curve = np.interp(coordinate, place[order], truth[order], period=period)
        truths[name] = (dimension, curve)
    return truths


def score_trajectories(trial: xr.Dataset | PreparedTrial, estimate: Estimate) -> dict[str, float]:
    """Scores of the trajectories of an estimate against the true ones, as columns of a row.

    All places of what the parameters vary with count alike; those where a parameter is not identified are left out. An
    estimate without trajectories is scored as one whose K, B and G are constant.
    """
    prepared = prepare(trial)
    truths = true_trajectories(prepared, estimate.trajectories)
    if truths is None:
        return {}
    values: Mapping[Any, Any] = list_parameters(estimate)
    if estimate.trajectories is not None:
        values = estimate.trajectories
    row: dict[str, float] = {}
    for name, truth in truths.items():
        names = [f"{name}{end}" for end in ENDS if f"{name}{end}" in values]
        if not names:
            continue
        curve, *band = (np.broadcast_to(values[variable], truth.shape) for variable in names)
        for score, value in _score(truth.values, curve, *band).items():
            row[f"{name}_{score}"] = value
    return row


def _score(truth: np.ndarray, curve: np.ndarray, *band: np.ndarray) -> dict[str, float]:
    """Error, bias and coverage [%] of a trajectory, with the ends of its band where it has one."""
    shown = np.isfinite(curve)
    mean = float(truth.mean())
    if not shown.any() or mean == 0:
        return {}
    error = (curve - truth)[shown]
    row = {
        "nrmse": 100.0 * float(np.sqrt(np.mean(error**2))) / mean,
        "bias": 100.0 * float(error.mean()) / mean,
    }
    if band and np.isfinite(band[0][shown]).all():
        low, high = band
        covered = (low <= truth) & (truth <= high)
        row["covered"] = 100.0 * float(np.mean(covered[shown]))
    return row
