"""Scores of an estimate against what was measured, and against the truth where there is one."""

import numpy as np
import pandas as pd

from ankleloop.errors import DataError
from ankleloop.joint.regressors import decimated
from ankleloop.signals.vaf import vaf, vaf_and_interval

__all__ = ["evaluate", "in_band_snr", "parameter_row", "parameters", "score_rows", "summarise"]

CORRELATED = 1.0  # s: over this the squares of torques may be correlated
TRIM = 1.0  # s at either end: transients of filters and initial states are not scored


def _scored(estimate, trim):
    """Which samples of an estimate are scored, their times and their rate."""
    time = estimate.torque.variables["time"].values
    inside = (time >= time[0] + trim) & (time <= time[-1] - trim)
    if inside.sum() < 2:
        raise DataError(f"the estimate covers {time[-1] - time[0]:.3g} s; nothing is left after a trim of {trim:g} s.")
    return inside, time, estimate.torque.attrs["identification_rate"]


def evaluate(trial, estimate, *, trim=TRIM, against=None, intervals=False):
    """Score the torques of an estimate by their VAF.

    The trial's torques are decimated exactly as the data of the estimate were. Net torque is scored against the
    measured torque and, in a simulation, against the true intrinsic plus reflex torque; the two parts against their
    truths. Without truths, or where they are to be left aside, every row is against the measured torque: the parts are
    contributions, and do not add up.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial that was identified.
    estimate : Estimate
        The estimate.
    trim : float
        Time left out at either end of the estimate [s].
    against : {"measured"}, optional
        Leave the truths of a simulation aside, as if it were a recording.
    intervals : bool
        Add columns `low` and `high` [%], the 95 % interval of what the VAF of this model would come to on a record
        without end (see `ankleloop.signals.vaf.vaf_interval`).

    Returns
    -------
    pandas.DataFrame
        Columns `torque`, `against` (measured or true) and `vaf` [%].

    Raises
    ------
    DataError
        If nothing is left to score.
    ValueError
        For an unknown `against`.

    Examples
    --------
    >>> from ankleloop.methods.moesp import identify_moesp
    >>> from ankleloop.simulation import simulate
    >>> trial = simulate(seed=1, duration=20.0)
    >>> evaluate(trial, identify_moesp(trial))["torque"].tolist()
    ['net', 'net', 'intrinsic', 'reflex']
    """
    columns = ["torque", "against", "vaf", "low", "high"][: 5 if intervals else 3]
    return pd.DataFrame(score_rows(trial, estimate, trim=trim, against=against, intervals=intervals), columns=columns)


def score_rows(trial, estimate, *, trim=TRIM, against=None, intervals=False):
    """The rows of `evaluate` as tuples, for those who put many together."""
    if against not in (None, "measured"):
        raise ValueError(f"against must be 'measured' or None, got {against!r}.")
    inside, time, rate = _scored(estimate, trim)
    measured = decimated(trial, "torque", time, rate)
    rows = [("net", "measured", measured)]
    if against is None and {"torque_intrinsic", "torque_reflex"} <= set(trial.data_vars):
        truth = {part: decimated(trial, f"torque_{part}", time, rate) for part in ("intrinsic", "reflex")}
        rows.append(("net", "true", truth["intrinsic"] + truth["reflex"]))
        rows += [(part, "true", signal) for part, signal in truth.items() if np.ptp(signal) > 0]
    else:
        rows += [(part, "measured", measured) for part in ("intrinsic", "reflex")]
    lags = round(CORRELATED * rate)
    scores = []
    for torque, against, signal in rows:
        pair = signal[inside], estimate.torque.variables[torque].values[inside]
        scores.append((torque, against, *(vaf_and_interval(*pair, lags) if intervals else [vaf(*pair)])))
    return scores


def in_band_snr(trial, estimate, *, trim=TRIM):
    """Signal-to-noise ratio of the torque within the band of the identification.

    Decimation takes more from the noise than from the torque, so this is above the ratio set in the recorded signal.

    Parameters
    ----------
    trial : xarray.Dataset
        A simulated trial.
    estimate : Estimate
        An estimate of it, which gives rate and samples.
    trim : float
        Time left out at either end [s].

    Returns
    -------
    float
        Variance of intrinsic plus reflex torque over variance of the measurement noise [dB]; infinite without noise.

    Raises
    ------
    DataError
        If the trial has no true torques.
    """
    missing = {"torque_intrinsic", "torque_reflex", "torque_noise"} - set(trial.data_vars)
    if missing:
        raise DataError(f"the trial has no {sorted(missing)[0]!r}: an in-band SNR needs the truths of a simulation.")
    inside, time, rate = _scored(estimate, trim)
    clean, reflex, noise = (
        decimated(trial, f"torque_{part}", time, rate)[inside] for part in ("intrinsic", "reflex", "noise")
    )
    power = np.var(noise)
    return float(10 * np.log10(np.var(clean + reflex) / power)) if power > 0 else float("inf")


def parameters(trial, estimate):
    """What an estimate says beside its torques, and the circumstances it was made under, as one row.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    estimate : Estimate
        Its estimate.

    Returns
    -------
    pandas.DataFrame
        One row: K, B, I, the reflex parameters, the ends of their 95 % intervals where the method gives them (`K_low`,
        `K_high` …), the in-band SNR [dB] of a simulation with noise, the largest magnitude of the poles, those of
        order, passes, converged, stable, reference and warnings that the method reports, and where options were
        selected the scores [%] on unseen data (`unseen_instrumental`, `unseen_cross_validation`).
    """
    return pd.DataFrame([parameter_row(trial, estimate)])


def parameter_row(trial, estimate):
    """The row of `parameters` as a dict, for those who put many together."""
    row = {**estimate.stiffness, **estimate.reflex}
    for name, (low, high) in estimate.intervals.items():
        row |= {f"{name}_low": low, f"{name}_high": high}
    if "torque_noise" in trial and np.ptp(trial.variables["torque_noise"].values) > 0:
        row["in_band_snr_db"] = in_band_snr(trial, estimate)
    for name in ("order", "spectral_radius", "passes", "converged", "stable", "reference"):
        if name in estimate.diagnostics:
            row[name] = estimate.diagnostics[name]
    row |= _unseen(estimate.diagnostics.get("selection"))
    row["warnings"] = " ".join(estimate.diagnostics.get("warnings", ()))
    return row


def _unseen(selection):
    """Scores of the chosen options on data that the fit had not seen."""
    if selection is None:
        return {}
    chosen = selection["chosen"]
    scores = next(row["scores"] for row in selection["candidates"] if all(row[name] == chosen[name] for name in chosen))
    return {f"unseen_{name.replace('-', '_')}": score for name, score in scores.items()}


def summarise(scores, by):
    """Mean and standard deviation of the VAF over trials.

    Parameters
    ----------
    scores : pandas.DataFrame
        Tables of `evaluate`, one below the other, with columns that tell them apart.
    by : sequence of str
        Columns that stay apart.

    Returns
    -------
    pandas.DataFrame
        Columns `by`, `mean`, `sd` (of the sample; empty for a single trial) and `n`, in the order in which
        they first appear.

    Examples
    --------
    >>> scores = pd.DataFrame({"torque": ["net", "net"], "vaf": [90.0, 92.0]})
    >>> summarise(scores, ["torque"]).values.tolist()
    [['net', 91.0, 1.4142135623730951, 2]]
    """
    return scores.groupby(list(by), sort=False)["vaf"].agg(mean="mean", sd="std", n="count").reset_index()
