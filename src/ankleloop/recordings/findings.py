"""Findings about one record: its channels, the sign of its torque, coherence, excitation and drift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ankleloop.joint.regressors import INTRINSIC_NAMES, Regressors
from ankleloop.quantities import QUANTITIES
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import segment_spectra

__all__ = [
    "VERDICTS",
    "Finding",
    "check_clipping",
    "check_coherence",
    "check_drift",
    "check_excitation",
    "check_length",
    "check_sign",
    "estimate_spectra",
    "merge_findings",
]

VERDICTS = ("ok", "warning", "refused")
SHORTEST, SHORT = 10.0, 25.0  # s
SHORTEST_TRIAL = 2.0  # s, of those that are merged: filters and Hankel rows touch a second of each
CLIPPED_RUN = 5  # consecutive samples at the very end of the range
CLIPPED_EXCESS = 5.0  # times as many samples there as at the next values
DRIFT = 0.1  # Hz
DRIFT_SHARE = 0.05  # of the torque's variance
COHERENT = 0.5
WIDTH = 4.0  # Hz up to which the movement must be coherent with the torque, at least
MODEL = 0.2  # share of the torque that a second-order model must explain before its sign is read


@dataclass(frozen=True)
class Finding:
    """Result of one check.

    Parameters
    ----------
    name : str
        Property that was checked.
    verdict : {"ok", "warning", "refused"}
        Whether the recording passes.
    text : str
        Reason, with numbers and what to do.
    """

    name: str
    verdict: str
    text: str


def merge_findings(findings: Sequence[Finding]) -> Finding:
    """The worst finding about one property of several trials, with the number of its trial.

    Parameters
    ----------
    findings : sequence of Finding
        The finding about each trial, in order.

    Returns
    -------
    Finding
        The finding itself if there is a single trial.

    Examples
    --------
    >>> merge_findings([Finding("drift", "ok", "none."), Finding("drift", "warning", "much.")]).text
    'trial 2 of 2: much.'
    """
    verdicts = [VERDICTS.index(finding.verdict) for finding in findings]
    number = int(np.argmax(verdicts))
    worst = findings[number]
    if len(findings) == 1:
        return worst
    place = f"trial {number + 1} of {len(findings)}" if any(verdicts) else f"all {len(findings)} trials pass; the first"
    return Finding(worst.name, worst.verdict, f"{place}: {worst.text}")


def check_length(trials: Sequence[xr.Dataset], identification_rate: float) -> Finding:
    """Length of a trial, or of all trials that are merged.

    Parameters
    ----------
    trials : sequence of xarray.Dataset
        The trials.
    identification_rate : float
        Rate of the identification [Hz].

    Returns
    -------
    Finding
    """
    rates = sorted({float(trial.attrs["sampling_rate"]) for trial in trials})
    durations = [trial.sizes["time"] / float(trial.attrs["sampling_rate"]) for trial in trials]
    total = sum(durations)
    text = " … ".join(f"{duration:.4g}" for duration in sorted({min(durations), max(durations)})) + " s"
    if len(trials) > 1:
        text = f"{len(trials)} trials of {text}, {total:.4g} s in all"
    text = f"{text} at {' and '.join(f'{rate:g}' for rate in rates)} Hz, without gaps"
    if total < SHORTEST:
        return Finding("length", "refused", f"{text}: record at least {SHORTEST:g} s.")
    if min(durations) < SHORTEST_TRIAL:
        return Finding("length", "refused", f"{text}: leave out trials of less than {SHORTEST_TRIAL:g} s.")
    if total < SHORT:
        return Finding("length", "warning", f"{text}: short for a reflex; {2 * SHORT:g} s or more are usual.")
    return Finding("length", "ok", f"{text}; identified at {identification_rate:g} Hz.")


def check_clipping(trial: xr.Dataset, name: str) -> Finding:
    """A channel that stays at its largest or smallest value has reached the end of its range.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    name : str
        Name of the channel.

    Returns
    -------
    Finding
    """
    x = trial[name].values
    levels, counts = np.unique(x, return_counts=True)
    clipped = max(_clipped_samples(x, levels[-1], counts[-6:-1]), _clipped_samples(x, levels[0], counts[1:6]))
    if clipped:
        share = 100.0 * clipped / x.size
        text = f"{clipped} samples ({share:.2g} %) stand at the end of the range of the {name}: widen the range."
        return Finding(f"clipping of the {name}", "warning" if share < 1.0 else "refused", text)
    unit = trial[name].attrs.get("units", "")
    text = f"none; it reaches from {levels[0]:.4g} to {levels[-1]:.4g} {unit}."
    return Finding(f"clipping of the {name}", "ok", text)


def _clipped_samples(x: np.ndarray, edge: float, counts_nearby: np.ndarray) -> int:
    """Number of samples at an end of the range, if they are too many in a row and compared to the next values."""
    at_edge = x == edge
    changes = np.flatnonzero(np.diff(np.concatenate(([0], at_edge.astype(int), [0]))))
    longest = np.max(changes[1::2] - changes[::2])
    clipped = longest >= CLIPPED_RUN and at_edge.sum() > CLIPPED_EXCESS * max(counts_nearby.mean(), 1.0)
    return int(at_edge.sum()) if clipped else 0


def check_sign(motion: np.ndarray, torque: np.ndarray, instruments: np.ndarray) -> Finding:
    """Positive stiffness; by instruments in closed loop, where least squares can give a negative one by its bias.

    Parameters
    ----------
    motion : ndarray, shape (N, 3)
        Position, velocity and acceleration, less their means.
    torque : ndarray, shape (N,)
        Torque less its mean [N·m].
    instruments : ndarray, shape (N, 3)
        What the reference explains of the motion; the motion itself for least squares.

    Returns
    -------
    Finding
    """
    scale = motion.std(axis=0)
    motion, instruments = motion / scale, instruments / scale
    values = np.linalg.lstsq(instruments.T @ motion, instruments.T @ torque, rcond=None)[0]
    explained = 1.0 - np.var(torque - motion @ values) / np.var(torque)
    stiffness = dict(zip("KBI", values / scale, strict=True))
    numbers = ", ".join(f"{name} = {value:.3g} {QUANTITIES[name].unit}" for name, value in stiffness.items())
    text = f"a second-order model without reflex has {numbers}"
    if stiffness["K"] < 0 and (stiffness["I"] < 0 or explained > MODEL):
        return Finding(
            "sign of the torque",
            "refused",
            f"{text}: the torque has the other sign. Set torque_sign: -1 (turn round the torque, not the position: the "
            "rectifier would see the wrong half).",
        )
    return Finding("sign of the torque", "ok", f"{text}: the torque opposes stretch.")


def estimate_spectra(records: Sequence[Regressors]) -> dict[str, np.ndarray]:
    """Spectra and coherence at the identification rate, in segments of about five seconds of all records.

    Parameters
    ----------
    records : sequence of Regressors
        The records, at one identification rate.

    Returns
    -------
    dict of str to ndarray
        As `ankleloop.recordings.checks.Check.spectra`.
    """
    rate, size = records[0].rate, min(512, min(record.torque.size for record in records) // 4)
    signals = {
        "position": [record.inputs[:, 0] for record in records],
        "torque": [record.torque for record in records],
        "reference": [record.reference for record in records if record.reference is not None],
    }
    frequency = np.fft.rfftfreq(size, 1.0 / rate)
    inside = (frequency > 0) & (frequency <= PASSBAND * rate)
    transforms = {
        name: np.concatenate([segment_spectra(x, size, size // 2)[:, inside] for x in parts])
        for name, parts in signals.items()
        if parts
    }
    power = {name: np.mean(np.abs(transform) ** 2, axis=0) for name, transform in transforms.items()}
    density = 0.5 * rate * np.sum(np.hanning(size) ** 2)

    def coherence(x: str, y: str) -> np.ndarray:
        cross = np.mean(transforms[x] * transforms[y].conj(), axis=0)
        return np.abs(cross) ** 2 / np.maximum(power[x] * power[y], np.finfo(float).tiny)

    spectra = {"frequency": frequency[inside]} | {name: power[name] / density for name in ("position", "torque")}
    spectra["coherence"] = coherence("position", "torque")
    if "reference" in transforms:
        spectra["reference_coherence"] = coherence("reference", "position")
    return spectra


def check_coherence(record: Regressors) -> Finding:
    """Highest frequency at which position and torque are related.

    Parameters
    ----------
    record : Regressors
        The record.

    Returns
    -------
    Finding
    """
    spectra = estimate_spectra([record])
    coherent = spectra["coherence"] >= COHERENT
    highest = float(spectra["frequency"][coherent][-1]) if coherent.any() else 0.0
    low = spectra["frequency"] < 1.0
    text = f"position and torque are coherent up to {highest:.3g} Hz"
    if low.any():
        text = f"{text}; below 1 Hz the mean squared coherence is {spectra['coherence'][low].mean():.2f}"
    if highest < WIDTH:
        text = f"{text}: the torque has little to do with the movement. Check channels and perturbation."
        return Finding("coherence", "refused" if highest == 0 else "warning", text)
    return Finding("coherence", "ok", f"{text}.")


def check_excitation(record: Regressors, order: int, block_rows: int) -> Finding:
    """Rank of the velocity's Hankel matrix: a movement of q sinusoids is exciting of order 2 q.

    Parameters
    ----------
    record : Regressors
        The record.
    order, block_rows : int
        Largest order and block rows that a subspace method will use.

    Returns
    -------
    Finding
    """
    rows = 2 * block_rows + order
    velocity = record.inputs[:, INTRINSIC_NAMES.index("velocity")]
    if velocity.size < 2 * rows:
        text = (
            f"{velocity.size} samples are too few for {block_rows} block rows and order {order}: take fewer block rows."
        )
        return Finding("excitation", "refused", text)
    lagged = np.lib.stride_tricks.sliding_window_view(velocity / velocity.std(), rows)
    covariance = lagged.T @ lagged / len(lagged)
    values = np.linalg.eigvalsh(covariance)[::-1]
    rank = int(np.sum(values > 1e-6 * values[0]))
    # Decimation leaves the uppermost part of the band empty, which limits the rank of any movement.
    attainable = int(np.floor(2 * PASSBAND * rows))
    if rank < attainable:
        return Finding(
            "excitation",
            "refused" if rank < 2 * (order + 3) else "warning",
            f"the movement excites {rank} of {attainable} directions that {block_rows} block rows and order {order} "
            "need: perturb with a pseudorandom sequence, or take fewer block rows.",
        )
    return Finding("excitation", "ok", f"persistent for order {order} and {block_rows} block rows.")


def check_drift(record: Regressors) -> Finding:
    """Share of the torque that is slower than the perturbation.

    Parameters
    ----------
    record : Regressors
        The record.

    Returns
    -------
    Finding
    """
    torque = record.torque - record.torque.mean()
    power = np.abs(np.fft.rfft(torque)) ** 2
    slow = np.fft.rfftfreq(torque.size, 1.0 / record.rate) < DRIFT
    share = float(power[slow].sum() / power.sum())
    text = f"{100 * share:.1f} % of the torque's variance lie below {DRIFT:g} Hz"
    if share > DRIFT_SHARE:
        text = f"{text}: remove it (drift, the degree of a polynomial), and look at its cause."
        return Finding("drift", "warning", text)
    return Finding("drift", "ok", f"{text}.")
