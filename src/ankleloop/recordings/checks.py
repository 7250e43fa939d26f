"""Checks of a recording before anything is fitted to it, with their results in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.reference_response import explained_share
from ankleloop.joint.regressors import Regressors
from ankleloop.methods.registry import METHODS
from ankleloop.quantities import QUANTITIES
from ankleloop.recordings.loop_test import feedback_test
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import segment_spectra

__all__ = ["VERDICTS", "Check", "Finding", "check_merged_trials", "check_trial"]

VERDICTS = ("ok", "warning", "refused")
SHORTEST, SHORT = 10.0, 25.0  # s
CLIPPED_RUN = 5  # consecutive samples at the very end of the range
CLIPPED_EXCESS = 5.0  # times as many samples there as at the next values
DRIFT = 0.1  # Hz
DRIFT_SHARE = 0.05  # of the torque's variance
COHERENT = 0.5
WIDTH = 4.0  # Hz up to which the movement must be coherent with the torque, at least
WEAKEST = 0.05  # share of the position that a reference must explain
MODEL = 0.2  # share of the torque that a second-order model must explain before its sign is read

Methods = dict[str, dict[str, Any]]


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


@dataclass(frozen=True)
class Check:
    """Results of all checks of a recording.

    Parameters
    ----------
    findings : list of Finding
        In the order of the checks.
    loop : {"closed", "open", "undecided"}
        Whether torque feeds back on the position.
    methods : dict of str to dict
        Methods that are valid for this recording, with the options that make them so.
    spectra : dict of str to ndarray
        `frequency` [Hz], power spectral densities of `position` [rad²/Hz] and `torque` [(N·m)²/Hz], squared `coherence`
        of the two, and of the reference with the position where there is one (`reference_coherence`).
    """

    findings: list[Finding]
    loop: str
    methods: Methods
    spectra: dict[str, np.ndarray] = field(default_factory=dict, repr=False)

    @property
    def verdict(self) -> str:
        """The worst of all verdicts."""
        return max((finding.verdict for finding in self.findings), key=VERDICTS.index)

    @property
    def reasons(self) -> list[str]:
        """Texts of all findings that are not ok."""
        return [finding.text for finding in self.findings if finding.verdict != "ok"]

    def __str__(self) -> str:
        return "\n".join(f"{f.verdict:>8}  {f.name}: {f.text}" for f in self.findings)


def check_merged_trials(trials: Sequence[xr.Dataset | PreparedTrial], **options: Any) -> Check:
    """Check several short trials that are to be merged into one identification.

    Parameters
    ----------
    trials : sequence of xarray.Dataset or PreparedTrial
        The trials.
    **options
        As of `check_trial`.

    Returns
    -------
    Check
        For each property the worst finding, and the trial that it belongs to; the length is that of all trials. Only
        methods that can merge are valid. The spectra are those of the first trial.
    """
    total = sum(_duration(_dataset(trial)) for trial in trials)
    checks = [check_trial(trial, total=total, **options) for trial in trials]
    worst: dict[str, Finding] = {}
    for number, check in enumerate(checks, start=1):
        for finding in check.findings:
            previous = worst.get(finding.name)
            if previous is None or VERDICTS.index(finding.verdict) > VERDICTS.index(previous.verdict):
                text = f"trial {number} of {len(trials)}: {finding.text}"
                worst[finding.name] = Finding(finding.name, finding.verdict, text)
    loops = {check.loop for check in checks}
    loop = "closed" if "closed" in loops else "open" if loops == {"open"} else "undecided"
    methods, finding = _valid_methods(loop)
    if "methods" in worst:
        text = f"{finding.text} Of these, the MOESP family merges trials."
        worst["methods"] = Finding("methods", finding.verdict, text)
    merging = {name: options for name, options in methods.items() if METHODS[name].merges}
    return Check(list(worst.values()), loop, merging, checks[0].spectra)


def check_trial(
    trial: xr.Dataset | PreparedTrial,
    *,
    reference: str = "reference",
    delay: float = 0.04,
    order: int = 2,
    block_rows: int = 15,
    identification_rate: float = 100.0,
    total: float | None = None,
) -> Check:
    """Check what can be identified from a trial before anything is fitted to it.

    The checks are: length and rates, clipping, sign of the torque, spectrum and coherence, persistent excitation for
    the given order and block rows, slow drift, whether there is a usable reference, whether the torque feeds back on
    the position, and which methods are therefore valid.

    Parameters
    ----------
    trial : xarray.Dataset or PreparedTrial
        The trial.
    reference : str
        Variable that serves as reference.
    delay : float
        Reflex delay [s].
    order, block_rows : int
        Largest order and block rows that a subspace method will use.
    identification_rate : float
        Rate of the identification [Hz].
    total : float, optional
        Length of all trials with which this one is to be merged [s].

    Returns
    -------
    Check

    Examples
    --------
    >>> from ankleloop.simulation.simulate import simulate
    >>> check = check_trial(simulate(seed=1))
    >>> check.verdict, check.loop, "riv" in check.methods
    ('ok', 'closed', True)
    """
    dataset = _dataset(trial)
    length = _check_length(dataset, total, identification_rate)
    if length.verdict == "refused":
        return Check([length], "undecided", {})
    try:
        prepared = prepare(trial)
        regressors = prepared.regressors(
            delay=delay,
            basis="rectifier",
            identification_rate=identification_rate,
            reference=reference if reference in dataset and reference != "position" else None,
        )
    except DataError as error:
        return Check([length, Finding("signals", "refused", str(error))], "undecided", {})
    spectra = _estimate_spectra(regressors)
    usable, strength = _check_reference(regressors)
    loop, feedback = _check_loop(regressors, usable)
    methods, validity = _valid_methods(loop)
    findings = [
        length,
        *(_check_clipping(dataset, name) for name in ("position", "torque")),
        _check_sign(prepared, regressors, loop),
        _check_coherence(spectra),
        _check_excitation(regressors, order, block_rows),
        _check_drift(regressors),
        strength,
        feedback,
        validity,
    ]
    return Check(findings, loop, methods, spectra)


def _dataset(trial: xr.Dataset | PreparedTrial) -> xr.Dataset:
    return trial.trial if isinstance(trial, PreparedTrial) else trial


def _duration(trial: xr.Dataset) -> float:
    return trial.sizes["time"] / float(trial.attrs["sampling_rate"])


def _check_length(trial: xr.Dataset, total: float | None, rate: float) -> Finding:
    """Length of the trial, or of all trials that it is merged with."""
    duration = _duration(trial)
    text = f"{duration:.4g} s at {float(trial.attrs['sampling_rate']):g} Hz, without gaps"
    if total is not None and total != duration:
        text = f"{text}, {total:.4g} s in all"
    total = duration if total is None else total
    if total < SHORTEST:
        return Finding("length", "refused", f"{text}: record at least {SHORTEST:g} s.")
    if total < SHORT:
        return Finding("length", "warning", f"{text}: short for a reflex; {2 * SHORT:g} s or more are usual.")
    return Finding("length", "ok", f"{text}; identified at {rate:g} Hz.")


def _check_clipping(trial: xr.Dataset, name: str) -> Finding:
    """A channel that stays at its largest or smallest value has reached the end of its range."""
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


def _check_sign(trial: PreparedTrial, regressors: Regressors, loop: str) -> Finding:
    """Positive stiffness; by instruments in closed loop, where least squares can give a negative one by its bias."""
    motion = regressors.inputs[:, :3] - regressors.inputs[:, :3].mean(axis=0)
    torque = regressors.torque - regressors.torque.mean()
    instruments = motion
    if loop == "closed":
        instruments = trial.predict_inputs(regressors)[:, :3]
        instruments = instruments - instruments.mean(axis=0)
    scale = motion.std(axis=0)
    motion, instruments = motion / scale, instruments / scale
    values = np.linalg.lstsq(instruments.T @ motion, instruments.T @ torque, rcond=None)[0]
    explained = 1.0 - np.var(torque - motion @ values) / np.var(torque)
    stiffness = dict(zip("KBI", values / scale, strict=True))
    numbers = ", ".join(f"{name} = {value:.3g} {QUANTITIES[name].unit}" for name, value in stiffness.items())
    text = f"a second-order model has {numbers}"
    if stiffness["K"] < 0 and (stiffness["I"] < 0 or explained > MODEL):
        return Finding(
            "sign of the torque",
            "refused",
            f"{text}: the torque has the other sign. Set torque_sign: -1 (turn round the torque, not the position: the "
            "rectifier would see the wrong half).",
        )
    return Finding("sign of the torque", "ok", f"{text}: the torque opposes stretch.")


def _estimate_spectra(regressors: Regressors) -> dict[str, np.ndarray]:
    """Spectra and coherence at the identification rate, in segments of about five seconds."""
    rate, size = regressors.rate, min(512, regressors.torque.size // 4)
    signals = {"position": regressors.inputs[:, 0], "torque": regressors.torque}
    if regressors.reference is not None:
        signals["reference"] = regressors.reference
    frequency = np.fft.rfftfreq(size, 1.0 / rate)
    inside = (frequency > 0) & (frequency <= PASSBAND * rate)
    transforms = {name: segment_spectra(x, size, size // 2)[:, inside] for name, x in signals.items()}
    power = {name: np.mean(np.abs(transform) ** 2, axis=0) for name, transform in transforms.items()}
    density = 0.5 * rate * np.sum(np.hanning(size) ** 2)

    def coherence(x: str, y: str) -> np.ndarray:
        cross = np.mean(transforms[x] * transforms[y].conj(), axis=0)
        return np.abs(cross) ** 2 / np.maximum(power[x] * power[y], np.finfo(float).tiny)

    spectra = {"frequency": frequency[inside]} | {name: power[name] / density for name in ("position", "torque")}
    spectra["coherence"] = coherence("position", "torque")
    if "reference" in signals:
        spectra["reference_coherence"] = coherence("reference", "position")
    return spectra


def _check_coherence(spectra: dict[str, np.ndarray]) -> Finding:
    """Highest frequency at which position and torque are related."""
    coherent = spectra["coherence"] >= COHERENT
    highest = float(spectra["frequency"][coherent][-1]) if coherent.any() else 0.0
    low = spectra["frequency"] < 1.0
    text = (
        f"position and torque are coherent up to {highest:.3g} Hz; below 1 Hz the mean squared coherence is "
        f"{spectra['coherence'][low].mean():.2f}"
    )
    if highest < WIDTH:
        text = f"{text}: the torque has little to do with the movement. Check channels and perturbation."
        return Finding("coherence", "refused" if highest == 0 else "warning", text)
    return Finding("coherence", "ok", f"{text}.")


def _check_excitation(regressors: Regressors, order: int, block_rows: int) -> Finding:
    """Rank of the velocity's Hankel matrix: a movement of q sinusoids is exciting of order 2 q."""
    rows = 2 * block_rows + order
    velocity = regressors.inputs[:, 1] / regressors.inputs[:, 1].std()
    lagged = np.lib.stride_tricks.sliding_window_view(velocity, rows)
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


def _check_drift(regressors: Regressors) -> Finding:
    """Share of the torque that is slower than the perturbation."""
    torque = regressors.torque - regressors.torque.mean()
    power = np.abs(np.fft.rfft(torque)) ** 2
    slow = np.fft.rfftfreq(torque.size, 1.0 / regressors.rate) < DRIFT
    share = float(power[slow].sum() / power.sum())
    text = f"{100 * share:.1f} % of the torque's variance lie below {DRIFT:g} Hz"
    if share > DRIFT_SHARE:
        text = f"{text}: remove it (drift, the degree of a polynomial), and look at its cause."
        return Finding("drift", "warning", text)
    return Finding("drift", "ok", f"{text}.")


def _check_reference(regressors: Regressors) -> tuple[bool, Finding]:
    """Whether the reference can serve as an instrument."""
    if regressors.reference is None:
        advice = "Record the command of the servo: without it a closed loop cannot be told from an open one."
        return False, Finding("reference", "warning", f"there is none. {advice}")
    try:
        share = explained_share(regressors.inputs[:, 0], regressors.reference, regressors.rate)
    except DataError as error:
        return False, Finding("reference", "warning", f"what it explains cannot be told: {error}")
    text = f"{regressors.reference_name} explains {100 * max(share, 0.0):.1f} % of the position in unseen halves"
    if share < WEAKEST:
        text = f"{text}: too weak an instrument. Is it the command of the servo?"
        return False, Finding("reference", "warning", text)
    return True, Finding("reference", "ok", f"{text}.")


def _check_loop(regressors: Regressors, usable: bool) -> tuple[str, Finding]:
    """Whether torque feeds back on the position; undecided unless the reference is usable."""
    if not usable or regressors.reference is None:
        text = "cannot be decided without a reference. Methods for open loop hold only if it is open."
        return "undecided", Finding("loop", "warning", text)
    test = feedback_test(regressors.inputs[:, 0], regressors.torque, regressors.reference, regressors.rate)
    text = (
        f"what the reference leaves of position and torque has a mean squared coherence of {test.coherence:.2f} "
        f"(p = {test.p_value:.2g})"
    )
    if test.loop == "closed":
        return "closed", Finding("loop", "ok", f"closed: {text}, and the torque does work on the load.")
    if test.p_value < 0.01:
        return "open", Finding("loop", "warning", f"open: {text}, but the servo moves the joint, not the torque.")
    return "open", Finding("loop", "ok", f"open: {text}, no more than chance.")


def _valid_methods(loop: str) -> tuple[Methods, Finding]:
    """Methods that are valid for a loop, with the options that make them so."""
    if loop == "closed":
        text = (
            "riv, and pr-moesp with instruments for B and D. All others take torque that is fed back for stiffness; "
            "the bias grows with voluntary torque."
        )
        return {"riv": {}, "pr-moesp": {"input_matrices": "instruments"}}, Finding("methods", "ok", text)
    methods: Methods = {name: {"reference": "position"} for name in ("riv", "pr-moesp")}
    methods |= {"pi-moesp": {}, "po-moesp": {}, "parallel-cascade": {}}
    if loop == "open":
        return {**methods, "riv": {}, "pr-moesp": {}}, Finding("methods", "ok", "all.")
    text = (
        "those that need no reference (pi-moesp, po-moesp, parallel-cascade), and riv and pr-moesp with the position "
        "for one; none of them if the loop was closed."
    )
    return methods, Finding("methods", "warning", text)
