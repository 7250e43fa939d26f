"""What a recording can carry: checked before anything is fitted, told in plain words."""

from dataclasses import dataclass, field

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.reference_response import share_explained
from ankleloop.joint.regressors import build_regressors, predicted_inputs
from ankleloop.recordings.loop_test import feedback_test
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import segment_spectra

__all__ = ["VERDICTS", "Check", "Finding", "check_batch", "check_trial"]

VERDICTS = ("ok", "warning", "refused")
SHORTEST, SHORT = 10.0, 25.0  # s
CLIPPED_RUN = 5  # samples at the very end of the range, one after the other
CLIPPED_EXCESS = 5.0  # times as many samples there as at the next values
DRIFT = 0.1  # Hz
DRIFT_SHARE = 0.05  # of the torque's variance
COHERENT = 0.5
WIDTH = 4.0  # Hz up to which the movement must be coherent with the torque, at least
WEAKEST = 0.05  # share of the position that a reference must explain
MODEL = 0.2  # share of the torque that a second-order model has to explain before its sign is read


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Parameters
    ----------
    name : str
        What.
    verdict : {"ok", "warning", "refused"}
        How it stands.
    text : str
        In plain words, with numbers and what to do.
    """

    name: str
    verdict: str
    text: str


@dataclass(frozen=True)
class Check:
    """Everything that was found.

    Parameters
    ----------
    findings : list of Finding
        In the order of the checks.
    loop : {"closed", "open", "undecided"}
        Whether torque feeds back on the position.
    methods : dict of str to dict
        Methods that are valid for this record, with the options that make them so.
    spectra : dict of str to ndarray
        `frequency` [Hz], power spectral densities of `position` [rad²/Hz] and `torque` [(N·m)²/Hz], squared `coherence`
        of the two, and of the reference with the position where there is one (`reference_coherence`).
    """

    findings: list
    loop: str
    methods: dict
    spectra: dict = field(default_factory=dict, repr=False)

    @property
    def verdict(self):
        """The worst of all verdicts."""
        return max((finding.verdict for finding in self.findings), key=VERDICTS.index)

    @property
    def reasons(self):
        """Texts of what is not ok."""
        return [finding.text for finding in self.findings if finding.verdict != "ok"]

    def __str__(self):
        return "\n".join(f"{f.verdict:>8}  {f.name}: {f.text}" for f in self.findings)


def check_batch(trials, **options):
    """Check several short trials that are to be merged into one identification.

    Parameters
    ----------
    trials : sequence of xarray.Dataset
        The trials.
    **options
        As of `check_trial`.

    Returns
    -------
    Check
        For each item what is worst, and in which trial; the length is that of all of them. Only methods that can merge
        are valid. The spectra are those of the first trial.
    """
    total = sum(trial.sizes["time"] / float(trial.attrs["sampling_rate"]) for trial in trials)
    checks = [check_trial(trial, total=total, **options) for trial in trials]
    worst = {}
    for number, check in enumerate(checks, start=1):
        for found in check.findings:
            told = Finding(found.name, found.verdict, f"trial {number} of {len(trials)}: {found.text}")
            kept = worst.setdefault(found.name, told)
            if VERDICTS.index(found.verdict) > VERDICTS.index(kept.verdict):
                worst[found.name] = told
    loops = {check.loop for check in checks}
    loop = "closed" if "closed" in loops else "open" if loops == {"open"} else "undecided"
    methods, said = _methods(loop)
    merging = {name: given for name, given in methods.items() if name.endswith("moesp")}
    if "methods" in worst:
        worst["methods"] = Finding("methods", said.verdict, f"{said.text} Of these, the MOESP family merges trials.")
    return Check(list(worst.values()), loop, merging, checks[0].spectra)


def check_trial(
    trial, *, reference="reference", delay=0.04, order=2, block_rows=15, identification_rate=100.0, total=None
):
    """Check what a trial can carry before anything is fitted to it.

    Looked at are length and rates, clipping, the sign of the torque, spectrum and coherence, persistent excitation for
    the order and block rows asked for, slow drift, whether there is a usable reference, whether the torque feeds back
    on the position, and which methods are therefore valid.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    reference : str
        Variable that serves as reference.
    delay : float
        Reflex delay [s].
    order, block_rows : int
        Order and block rows of the subspace methods that are meant.
    identification_rate : float
        Rate of the identification [Hz].
    total : float, optional
        Length of all trials with which this one is to be merged [s].

    Returns
    -------
    Check

    Raises
    ------
    DataError
        If the trial is not one.

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> found = check_trial(simulate(seed=1))
    >>> found.verdict, found.loop, "riv" in found.methods
    ('ok', 'closed', True)
    """
    has_reference = reference in trial and reference != "position"
    duration = trial.sizes["time"] / float(trial.attrs["sampling_rate"])
    first = _length(duration, duration if total is None else total, trial, identification_rate)
    if first.verdict == "refused":
        return Check([first], "undecided", {})
    try:
        regressors = build_regressors(
            trial,
            delay=delay,
            basis="rectifier",
            identification_rate=identification_rate,
            reference=reference if has_reference else None,
        )
    except DataError as error:
        return Check([first, Finding("signals", "refused", str(error))], "undecided", {})
    spectra = _spectra(regressors)
    usable, strength = _reference(regressors)
    loop, feedback = _loop(regressors, usable)
    methods, said = _methods(loop)
    findings = [
        first,
        *(_clipping(trial, name) for name in ("position", "torque")),
        _sign(trial, regressors, delay, loop),
        _coherence(spectra),
        _excitation(regressors, order, block_rows),
        _drift(regressors),
        strength,
        feedback,
        said,
    ]
    return Check(findings, loop, methods, spectra)


def _length(duration, total, trial, rate):
    told = f"{duration:.4g} s at {float(trial.attrs['sampling_rate']):g} Hz, without gaps"
    if total != duration:
        told = f"{told}, {total:.4g} s in all"
    if total < SHORTEST:
        return Finding("length", "refused", f"{told}: record at least {SHORTEST:g} s.")
    if total < SHORT:
        return Finding("length", "warning", f"{told}: short for a reflex; {2 * SHORT:g} s or more are usual.")
    return Finding("length", "ok", f"{told}; identified at {rate:g} Hz.")


def _clipping(trial, name):
    """A channel that dwells on its largest or smallest value has met the end of its range."""
    x = trial[name].values
    levels, counts = np.unique(x, return_counts=True)
    worst = 0
    for edge, near in ((levels[-1], counts[-6:-1]), (levels[0], counts[1:6])):
        at = x == edge
        changes = np.flatnonzero(np.diff(np.concatenate(([0], at.astype(int), [0]))))
        longest = np.max(changes[1::2] - changes[::2])
        if longest >= CLIPPED_RUN and at.sum() > CLIPPED_EXCESS * max(near.mean(), 1.0):
            worst = max(worst, int(at.sum()))
    unit = trial[name].attrs.get("units", "")
    if worst:
        share = 100.0 * worst / x.size
        text = f"{worst} samples ({share:.2g} %) stand at the end of the range of the {name}: widen the range."
        return Finding(f"clipping of the {name}", "warning" if share < 1.0 else "refused", text)
    return Finding(
        f"clipping of the {name}", "ok", f"none; it reaches from {levels[0]:.4g} to {levels[-1]:.4g} {unit}."
    )


def _sign(trial, regressors, delay, loop):
    """Positive stiffness, from instruments where the loop is closed: least squares can be negative there by itself."""
    motion = regressors.inputs[:, :3] - regressors.inputs[:, :3].mean(axis=0)
    torque = regressors.torque - regressors.torque.mean()
    instruments = motion
    if loop == "closed":
        instruments = predicted_inputs(trial, regressors, delay)[:, :3]
        instruments = instruments - instruments.mean(axis=0)
    scale = motion.std(axis=0)
    found = np.linalg.lstsq((instruments / scale).T @ (motion / scale), (instruments / scale).T @ torque, rcond=None)[0]
    explained = 1.0 - np.var(torque - motion / scale @ found) / np.var(torque)
    K, B, I = found / scale  # noqa: E741 - the field's name
    told = f"a second-order model has K = {K:.3g} N·m/rad, B = {B:.3g} N·m·s/rad, I = {I:.3g} kg·m²"
    if K < 0 and (I < 0 or explained > MODEL):
        return Finding(
            "sign of the torque",
            "refused",
            f"{told}: the torque has the other sign. Set torque_sign: -1 (turn round the torque, not the position: the "
            "rectifier would see the wrong half).",
        )
    return Finding("sign of the torque", "ok", f"{told}: the torque opposes stretch.")


def _spectra(regressors):
    """Spectra and coherence at the identification rate, in segments of about five seconds."""
    rate, size = regressors.rate, min(512, regressors.torque.size // 4)
    signals = {"position": regressors.inputs[:, 0], "torque": regressors.torque}
    if regressors.reference is not None:
        signals["reference"] = regressors.reference
    frequency = np.fft.rfftfreq(size, 1.0 / rate)
    inside = (frequency > 0) & (frequency <= PASSBAND * rate)
    found = {name: segment_spectra(x, size, size // 2)[:, inside] for name, x in signals.items()}
    power = {name: np.mean(np.abs(spectrum) ** 2, axis=0) for name, spectrum in found.items()}
    density = 0.5 * rate * np.sum(np.hanning(size) ** 2)

    def coherence(one, other):
        cross = np.mean(found[one] * found[other].conj(), axis=0)
        return np.abs(cross) ** 2 / np.maximum(power[one] * power[other], np.finfo(float).tiny)

    spectra = {"frequency": frequency[inside]} | {name: power[name] / density for name in ("position", "torque")}
    spectra["coherence"] = coherence("position", "torque")
    if "reference" in signals:
        spectra["reference_coherence"] = coherence("reference", "position")
    return spectra


def _coherence(spectra):
    """Up to where the movement and the torque have to do with each other."""
    coherent = spectra["coherence"] >= COHERENT
    highest = float(spectra["frequency"][coherent][-1]) if coherent.any() else 0.0
    low = spectra["frequency"] < 1.0
    told = (
        f"position and torque are coherent up to {highest:.3g} Hz; below 1 Hz the mean squared coherence is "
        f"{spectra['coherence'][low].mean():.2f}"
    )
    if highest < WIDTH:
        text = f"{told}: the torque has little to do with the movement. Check channels and perturbation."
        return Finding("coherence", "refused" if highest == 0 else "warning", text)
    return Finding("coherence", "ok", f"{told}.")


def _excitation(regressors, order, block_rows):
    """Rank of the velocity's Hankel matrix: a movement of q sinusoids is exciting of order 2 q."""
    needed = 2 * block_rows + order
    velocity = regressors.inputs[:, 1] / regressors.inputs[:, 1].std()
    lagged = np.lib.stride_tricks.sliding_window_view(velocity, needed)
    covariance = lagged.T @ lagged / len(lagged)
    values = np.linalg.eigvalsh(covariance)[::-1]
    rank = int(np.sum(values > 1e-6 * values[0]))
    # Decimation leaves the uppermost part of the band empty: that many directions are.
    usable = int(np.floor(2 * PASSBAND * needed))
    if rank < usable:
        return Finding(
            "excitation",
            "refused" if rank < 2 * (order + 3) else "warning",
            f"the movement excites {rank} of {usable} directions that {block_rows} block rows and order {order} need: "
            "perturb with a pseudorandom sequence, or take fewer block rows.",
        )
    return Finding("excitation", "ok", f"persistent for order {order} and {block_rows} block rows.")


def _drift(regressors):
    """Share of the torque that is slower than the perturbation."""
    torque = regressors.torque - regressors.torque.mean()
    power = np.abs(np.fft.rfft(torque)) ** 2
    slow = np.fft.rfftfreq(torque.size, 1.0 / regressors.rate) < DRIFT
    share = float(power[slow].sum() / power.sum())
    told = f"{100 * share:.1f} % of the torque's variance lie below {DRIFT:g} Hz"
    if share > DRIFT_SHARE:
        return Finding(
            "drift", "warning", f"{told}: remove it (drift, the degree of a polynomial), and look at its cause."
        )
    return Finding("drift", "ok", f"{told}.")


def _reference(regressors):
    """Whether the reference can serve as an instrument."""
    if regressors.reference is None:
        return False, Finding(
            "reference",
            "warning",
            "there is none. Record the command of the servo: without it a closed loop cannot be told from an open one.",
        )
    try:
        share = share_explained(regressors.inputs[:, 0], regressors.reference, regressors.rate)
    except DataError as error:
        return False, Finding("reference", "warning", f"what it explains cannot be told: {error}")
    told = f"{regressors.reference_name} explains {100 * max(share, 0.0):.1f} % of the position in unseen halves"
    if share < WEAKEST:
        return False, Finding(
            "reference", "warning", f"{told}: too weak an instrument. Is it the command of the servo?"
        )
    return True, Finding("reference", "ok", f"{told}.")


def _loop(regressors, usable):
    """Whether torque feeds back on the position."""
    if not usable:
        return "undecided", Finding(
            "loop", "warning", "cannot be decided without a reference. Methods for open loop hold only if it is open."
        )
    found = feedback_test(regressors.inputs[:, 0], regressors.torque, regressors.reference, regressors.rate)
    told = (
        f"what the reference leaves of position and torque has a mean squared coherence of {found.coherence:.2f} "
        f"(p = {found.p_value:.2g})"
    )
    if found.loop == "closed":
        return "closed", Finding("loop", "ok", f"closed: {told}, and the torque does work on the load.")
    if found.p_value < 0.01:
        return "open", Finding("loop", "warning", f"open: {told}, but the servo moves the joint, not the torque.")
    return "open", Finding("loop", "ok", f"open: {told}, no more than chance.")


def _methods(loop):
    """Methods that the record allows, and what to say of them."""
    instruments = {"riv": {}, "pr-moesp": {"input_matrices": "instruments"}}
    position = {
        "riv": {"reference": "position"},
        "pr-moesp": {"reference": "position"},
        "pi-moesp": {},
        "po-moesp": {},
        "parallel-cascade": {},
    }
    if loop == "closed":
        text = (
            "riv, and pr-moesp with instruments for B and D. All others take torque that is fed back for stiffness; "
            "the bias grows with voluntary torque."
        )
        return instruments, Finding("methods", "ok", text)
    if loop == "open":
        return {**position, "riv": {}, "pr-moesp": {}}, Finding("methods", "ok", "all.")
    text = (
        "those that need no reference (pi-moesp, po-moesp, parallel-cascade), and riv and pr-moesp with the position "
        "for one; none of them if the loop was closed."
    )
    return position, Finding("methods", "warning", text)
