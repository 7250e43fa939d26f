"""Windows of an ensemble: their conditions, what is used of them, and what is refused."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import special

from ankleloop.checks.channels import CHANNEL_CHECKS, check_spikes
from ankleloop.checks.data import refuse_other_rates, refuse_repeated_trials
from ankleloop.checks.findings import Finding, merge_findings
from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial, prepare_trials
from ankleloop.methods.ensemble.options import EnsembleOptions
from ankleloop.methods.method import Method
from ankleloop.signals.decimation import decimation_factor, design_lowpass
from ankleloop.trials.trial import REQUIRED
from ankleloop.trials.windows import WINDOW, cut, name_condition

CHANNEL_BAND = (40.0, 100.0)  # Hz: pass band and stop band of all channels
# Hz, of the velocity: a wider band rectifies more noise of the position, a narrower one loses the reflex
VELOCITY_BAND = (60.0, 120.0)
LOWEST_RATE = 250.0  # Hz, of the windows: these bands lie below half of it
FEWEST_TRIALS = 8  # of a condition
SHORTEST_AFTER = 0.12  # s from the onset to the end of what is used
SHORTEST_BEFORE = 0.05  # s of data before the onset


def filter_margin(rate: float) -> int:
    """Recorded samples that the filters of all channels need behind the last one that is used."""
    channel = design_lowpass(rate, *CHANNEL_BAND)[1]
    velocity = design_lowpass(rate, *VELOCITY_BAND, derivative=1)[1]
    return channel + velocity


def prepare_windows(_: Method, trial: Any, options: EnsembleOptions) -> list[PreparedTrial]:
    """Windows of a list, or those that are cut out of a record, or out of each of several, at the onsets."""
    trials = prepare_trials(trial)
    if options.onsets is not None:
        if options.condition is None or options.onset is not None:
            raise DataError(
                "onsets of a record need the condition of each, and no onset: say what was commanded, condition=..."
            )
        window = options.window or WINDOW
        trials = prepare_trials(
            [
                part
                for record in trials
                for part in cut(record.trial, options.onsets, window, condition=options.condition)
            ]
        )
    elif not isinstance(trial, (list, tuple)):
        raise DataError(
            "ensemble takes windows around perturbations: give the onsets and the condition of each, or a list of "
            "windows (ankleloop.cut)."
        )
    if not trials:
        raise DataError("there are no windows to identify.")
    refuse_other_rates(trials)
    refuse_repeated_trials(trials)
    return trials


def check_windows(
    _: Method, trials: Sequence[PreparedTrial], options: EnsembleOptions
) -> list[str]:
    """Refuse windows that say nothing: one condition, few trials, too little time; warnings about their channels."""
    conditions = list(map(condition_of, trials))
    counts = Counter(conditions)
    if len(counts) < 2:
        raise DataError(
            f"all windows have the condition {next(iter(counts))!r}: what is commanded in some and not in others is "
            "the instrument. Give windows of nominal trials, or of another perturbation."
        )
    few = {name: count for name, count in counts.items() if count < FEWEST_TRIALS}
    if few:
        listed = ", ".join(f"{name} {count}" for name, count in few.items())
        raise DataError(
            f"each condition needs {FEWEST_TRIALS} trials or more, and there are fewer of {listed}: leave it out, "
            "record more, or, where each trial has a sequence of its own, repeat a few sequences."
        )
    rate = trials[0].rate
    if rate < LOWEST_RATE:
        raise DataError(
            f"the windows have {rate:g} Hz, and the filters of ensemble need {LOWEST_RATE:g} Hz."
        )
    windows = Windows.of(trials, options)
    end = windows.time.max(initial=0.0)
    if windows.onset < SHORTEST_BEFORE * rate or end < SHORTEST_AFTER:
        margin = filter_margin(rate) / rate
        raise DataError(
            f"the windows begin {windows.onset / rate:.3g} s before the onset and are used until "
            f"{end:.3g} s after it: they have to begin {SHORTEST_BEFORE:g} s before it, and end "
            f"{SHORTEST_AFTER + margin:.2g} s after it, of which filters take {margin:.2g} s."
        )
    worst = [
        _find_fault(check, name, trials, conditions)
        for check in CHANNEL_CHECKS
        for name in REQUIRED
    ]
    return [finding.text for finding in worst if finding.verdict != "ok"]


def _find_fault(
    check: Callable[[PreparedTrial, str], Finding],
    name: str,
    trials: Sequence[PreparedTrial],
    conditions: Sequence[str],
) -> Finding:
    """Worst finding about a channel of the windows; a peak that half of a condition have is that of its command."""
    findings = [check(trial, name) for trial in trials]
    if check is check_spikes:
        faulty = [finding.verdict != "ok" for finding in findings]
        peaks = Counter(itertools.compress(conditions, faulty))
        counts = Counter(conditions)
        commanded = {condition for condition in peaks if 2 * peaks[condition] >= counts[condition]}
        findings = [
            replace(finding, verdict="ok") if condition in commanded else finding
            for finding, condition in zip(findings, conditions, strict=True)
        ]
    return merge_findings(findings)


def condition_of(trial: PreparedTrial) -> str:
    """Condition of a window."""
    attributes = trial.trial.attrs
    if "condition" not in attributes:
        raise DataError(
            "a window has no condition: give each its attribute `condition`, or cut it out of its record by "
            "ankleloop.cut."
        )
    return name_condition(attributes["condition"])


def _onset_of(trial: PreparedTrial, options: EnsembleOptions) -> int:
    """Sample of the onset of a window."""
    onset = options.onset
    if onset is None:
        onset = trial.trial.attrs.get("onset")
    if onset is None:
        raise DataError(
            "the windows do not say when the perturbation begins: give onset, its time from the start of each [s]."
        )
    sample = round(float(onset) * trial.rate)
    if sample >= trial.time.size:
        raise DataError(
            f"the onset at {onset:g} s lies behind the end of a window of {trial.time.size / trial.rate:g} s: give it "
            "in seconds from the start of each window."
        )
    return sample


@dataclass(frozen=True, eq=False)
class Windows:
    """Position and torque of all trials about the onset, which has the same sample in all, and their conditions."""

    conditions: dict[str, int]  # trials of each condition, by its name
    groups: np.ndarray  # shape (trials,): number of the condition of each trial
    position: np.ndarray  # shape (trials, samples) [rad]
    torque: np.ndarray  # shape (trials, samples) [N·m]
    rate: float  # of the samples [Hz]
    onset: int  # sample of the onset
    rows: np.ndarray  # shape (T,): samples that are used

    @classmethod
    def of(cls, trials: Sequence[PreparedTrial], options: EnsembleOptions) -> Windows:
        """Those of prepared trials: of all as much as the shortest has before and after the onset."""
        rate = trials[0].rate
        onsets = [_onset_of(trial, options) for trial in trials]
        before = min(onsets)
        after = min(trial.time.size - onset for trial, onset in zip(trials, onsets, strict=True))
        pairs = list(zip(trials, onsets, strict=True))
        position, torque = (
            np.array(
                [trial.samples[name][onset - before : onset + after] for trial, onset in pairs]
            )
            for name in ("position", "torque")
        )
        names = [condition_of(trial) for trial in trials]
        counts = dict(sorted(Counter(names).items()))
        numbers = {name: number for number, name in enumerate(counts)}
        attributes = trials[0].trial.attrs
        start, end = options.window or (
            attributes.get("window_start", WINDOW[0]),
            attributes.get("window_end", WINDOW[1]),
        )
        factor = decimation_factor(rate, options.identification_rate)
        first = max(start * rate, -before)
        last = min(end * rate, after - 1 - filter_margin(rate))
        steps = np.arange(np.ceil(first / factor - 1e-9), np.floor(last / factor + 1e-9) + 1)
        return cls(
            conditions=counts,
            groups=np.array([numbers[name] for name in names]),
            position=position,
            torque=torque,
            rate=rate,
            onset=before,
            rows=before + factor * steps.astype(int),
        )

    @property
    def time(self) -> np.ndarray:
        """Time of what is used from the onset [s], shape (T,)."""
        return (self.rows - self.onset) / self.rate

    @cached_property
    def sizes(self) -> np.ndarray:
        """Trials of each condition, shape (C,)."""
        return np.array([*self.conditions.values()])

    def average(self, values: np.ndarray) -> np.ndarray:
        """Means over the trials of each condition.

        Shapes: values (..., trials, T); returns (..., C, T).
        """
        members = self.groups == np.arange(self.sizes.size)[:, None]
        return members @ values / self.sizes[:, None]

    @property
    def balance_p(self) -> float:
        """Probability of differences between the conditions before the onset at least as large, were there none.

        F tests of the mean position and of the mean torque; the smaller of the two probabilities counts, twice.
        """
        probabilities = []
        for channel in (self.position, self.torque):
            means = channel[:, : self.onset].mean(axis=1, keepdims=True)
            fitted = self.average(means)
            between = self.sizes @ (fitted - means.mean()) ** 2
            within = np.sum((means - fitted[self.groups]) ** 2)
            first = self.sizes.size - 1
            second = self.groups.size - self.sizes.size
            ratio = between.item() / first / (within / second)
            probabilities.append(float(special.fdtrc(first, second, ratio)))
        return min(1.0, 2.0 * min(probabilities))
