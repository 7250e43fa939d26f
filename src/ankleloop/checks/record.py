"""Findings about one record that an identification does without: its length, coherence and drift."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ankleloop.checks.findings import Finding
from ankleloop.checks.movement import select_references
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import Regressors
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import coherence, mean_power, segment_spectra

SHORTEST_RECORD, SHORT_RECORD = 10.0, 25.0  # s
SHORTEST_TRIAL = 2.0  # s, of those that are merged: filters and Hankel rows touch a second of each
DRIFT_FREQUENCY = 0.1  # Hz
DRIFT_SHARE = 0.05  # of the torque's variance
COHERENT_LEVEL = 0.5
COHERENT_WIDTH = 4.0  # Hz up to which the movement must be coherent with the torque, at least
LONGEST_SEGMENT = 512  # samples of a spectrum: about five seconds


def check_length(trials: Sequence[PreparedTrial], identification_rate: float) -> Finding:
    """Length of a trial, or of all trials that are merged."""
    rates = sorted({trial.rate for trial in trials})
    durations = [trial.time.size / trial.rate for trial in trials]
    total = sum(durations)
    text = f"{total:.4g} s at {' and '.join(f'{rate:g}' for rate in rates)} Hz"
    if not any("gaps" in trial.trial.attrs for trial in trials):  # where they were looked for
        text += ", without gaps in time"
    if len(trials) > 1:
        text = f"{len(trials)} trials of {min(durations):.4g} s or more, {text}"
    if total < SHORTEST_RECORD:
        return Finding("length", "refused", f"{text}: record at least {SHORTEST_RECORD:g} s.")
    if min(durations) < SHORTEST_TRIAL:
        return Finding(
            "length", "refused", f"{text}: leave out trials of less than {SHORTEST_TRIAL:g} s."
        )
    if total < SHORT_RECORD:
        return Finding(
            "length",
            "warning",
            f"{text}: short for a reflex; {2 * SHORT_RECORD:g} s or more are usual.",
        )
    return Finding("length", "ok", f"{text}; identified at {identification_rate:g} Hz.")


def estimate_spectra(records: Sequence[Regressors]) -> dict[str, np.ndarray]:
    """Spectra and coherence at the identification rate, in segments of about five seconds of all records."""
    rate = records[0].rate
    size = min(LONGEST_SEGMENT, min(record.torque.size for record in records) // 4)
    frequency = np.fft.rfftfreq(size, 1.0 / rate)
    inside = (frequency > 0) & (frequency <= PASSBAND * rate)
    segments = (size, size // 2)
    position = segment_spectra([record.inputs[:, 0] for record in records], *segments)[:, inside]
    torque = segment_spectra([record.torque for record in records], *segments)[:, inside]
    density = 0.5 * rate * np.sum(np.hanning(size) ** 2)
    spectra = {
        "frequency": frequency[inside],
        "position": mean_power(position) / density,
        "torque": mean_power(torque) / density,
        "coherence": coherence(position, torque),
    }
    references = select_references(records)
    if references:
        reference = segment_spectra(references, *segments)[:, inside]
        spectra["reference_coherence"] = coherence(reference, position)
    return spectra


def check_coherence(record: Regressors) -> Finding:
    """Highest frequency at which position and torque are related."""
    spectra = estimate_spectra([record])
    frequency = spectra["frequency"]
    highest = frequency[spectra["coherence"] >= COHERENT_LEVEL].max(initial=0.0)
    low = frequency < 1.0
    text = f"position and torque are coherent up to {highest:.3g} Hz"
    if low.any():
        slow = spectra["coherence"][low].mean()
        text = f"{text}; below 1 Hz the mean squared coherence is {slow:.2f}"
    if highest >= COHERENT_WIDTH:
        return Finding("coherence", "ok", f"{text}.")
    verdict = "refused" if highest == 0.0 else "warning"
    return Finding(
        "coherence",
        verdict,
        f"{text}: the torque has little to do with the movement. Check channels and perturbation.",
    )


def check_drift(record: Regressors) -> Finding:
    """Share of the torque that is slower than the perturbation."""
    torque = record.torque - record.torque.mean()
    power = np.abs(np.fft.rfft(torque)) ** 2
    slow = np.fft.rfftfreq(torque.size, 1.0 / record.rate) < DRIFT_FREQUENCY
    share = power[slow].sum() / power.sum()
    text = f"{100 * share:.1f} % of the torque's variance lie below {DRIFT_FREQUENCY:g} Hz"
    if share > DRIFT_SHARE:
        return Finding(
            "drift",
            "warning",
            f"{text}: remove it (drift, the degree of a polynomial), and look at its cause.",
            {"drift": 1},
        )
    return Finding("drift", "ok", f"{text}.")
