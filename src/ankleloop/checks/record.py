"""Findings about one record that an identification does without: its length, coherence and drift."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from ankleloop.checks.findings import Finding
from ankleloop.joint.regressors import Regressors
from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import coherence, segment_spectra

SHORTEST, SHORT = 10.0, 25.0  # s
SHORTEST_TRIAL = 2.0  # s, of those that are merged: filters and Hankel rows touch a second of each
DRIFT = 0.1  # Hz
DRIFT_SHARE = 0.05  # of the torque's variance
COHERENT = 0.5
WIDTH = 4.0  # Hz up to which the movement must be coherent with the torque, at least


def check_length(trials: Sequence[xr.Dataset], identification_rate: float) -> Finding:
    """Length of a trial, or of all trials that are merged."""
    rates = sorted({float(trial.attrs["sampling_rate"]) for trial in trials})
    durations = [trial.sizes["time"] / float(trial.attrs["sampling_rate"]) for trial in trials]
    total = sum(durations)
    text = f"{total:.4g} s at {' and '.join(f'{rate:g}' for rate in rates)} Hz, without gaps"
    if len(trials) > 1:
        text = f"{len(trials)} trials of {min(durations):.4g} s or more, {text}"
    if total < SHORTEST:
        return Finding("length", "refused", f"{text}: record at least {SHORTEST:g} s.")
    if min(durations) < SHORTEST_TRIAL:
        return Finding(
            "length", "refused", f"{text}: leave out trials of less than {SHORTEST_TRIAL:g} s."
        )
    if total < SHORT:
        return Finding(
            "length", "warning", f"{text}: short for a reflex; {2 * SHORT:g} s or more are usual."
        )
    return Finding("length", "ok", f"{text}; identified at {identification_rate:g} Hz.")


def estimate_spectra(records: Sequence[Regressors]) -> dict[str, np.ndarray]:
    """Spectra and coherence at the identification rate, in segments of about five seconds of all records."""
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
    power = {
        name: np.mean(np.abs(transform) ** 2, axis=0) for name, transform in transforms.items()
    }
    density = 0.5 * rate * np.sum(np.hanning(size) ** 2)

    spectra = {"frequency": frequency[inside]} | {
        name: power[name] / density for name in ("position", "torque")
    }
    spectra["coherence"] = coherence(transforms["position"], transforms["torque"])
    if "reference" in transforms:
        spectra["reference_coherence"] = coherence(transforms["reference"], transforms["position"])
    return spectra


def check_coherence(record: Regressors) -> Finding:
    """Highest frequency at which position and torque are related."""
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


def check_drift(record: Regressors) -> Finding:
    """Share of the torque that is slower than the perturbation."""
    torque = record.torque - record.torque.mean()
    power = np.abs(np.fft.rfft(torque)) ** 2
    slow = np.fft.rfftfreq(torque.size, 1.0 / record.rate) < DRIFT
    share = float(power[slow].sum() / power.sum())
    text = f"{100 * share:.1f} % of the torque's variance lie below {DRIFT:g} Hz"
    if share > DRIFT_SHARE:
        text = f"{text}: remove it (drift, the degree of a polynomial), and look at its cause."
        return Finding("drift", "warning", text)
    return Finding("drift", "ok", f"{text}.")
