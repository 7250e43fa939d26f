"""Findings about the recorded samples of a channel: clipping, stretches at rest, filled gaps, spikes.

Each check costs a few passes over the samples at most, so that every identification can afford it.
"""

from __future__ import annotations

import numpy as np

from ankleloop.checks.findings import Finding
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.signals.gaps import find_runs, find_straight
from ankleloop.trials.channels import VARIABLES
from ankleloop.trials.trial import REQUIRED

CLIPPED_RUN = 5  # consecutive samples at the very end of the range
CLIPPED_EXCESS = 5.0  # times as many samples there as at the next values
NEXT_VALUES = 5
MINOR_CLIPPING = 1.0  # % of the samples: less is only a warning of the recording check
SHORTEST_REST = 1.0  # s at exactly the same value: noise of a sensor moves any channel sooner
LONG_REST = 2.0  # s where no other channel moves either
LONG_REST_SHARE = 0.2  # of the record, in such stretches
# Share of its range by which the channel moves that shows a rest of another one. A position that stands still while the
# torque moves may be a perturbation that pauses.
MOVEMENT_SHARES = {"position": 0.5, "torque": 0.5, "reference": 0.1}
LARGE_GAP_SHARE = 0.5  # of the record: more is refused
GAPS = "gaps of the"  # begins the name of a finding
STRAIGHT_SHARE = 0.9  # of the samples of gaps, in a reference that was filled as well
SPIKE_REACH = 0.003  # s on either side
# Fewest and most parts of the record: a perturbation is in most of them, a spike is not.
SPIKE_PARTS = (5, 10)
SPIKE_EXCESS = 5.0  # times the usual largest peak of a part
SPIKE_SIZE = 0.5  # standard deviations of the channel


def check_clipping(trial: PreparedTrial, name: str) -> Finding:
    """A channel that stays at its largest or smallest value has reached the end of its range.

    It does if many samples are there, at least some of them in a row, compared to the next values.
    """
    x = trial.samples[name]
    ends = [_find_clipping(x, end) for end in (x.min(), x.max())]
    clipped, first = max(ends)
    if not clipped:
        return Finding(f"clipping of the {name}", "ok", "none.")
    share = 100.0 * clipped / x.size
    verdict = "warning" if share < MINOR_CLIPPING else "refused"
    text = (
        f"{clipped} samples ({share:.3g} %) stand at the end of the range of the {name}, first at "
        f"{_place(trial, first)}: what lies beyond is lost, and K, B, I and G are off. Record again: widen the range."
    )
    return Finding(f"clipping of the {name}", verdict, text)


def _find_clipping(x: np.ndarray, end: float) -> tuple[int, int]:
    """Samples at an end of the range and the first one of their longest run, where the channel is clipped; or zeros."""
    at_end = np.flatnonzero(x == end)
    if at_end.size < CLIPPED_RUN:
        return 0, 0
    starts, lengths = find_runs(at_end)
    longest = np.argmax(lengths)
    if lengths[longest] < CLIPPED_RUN:
        return 0, 0
    counts = np.unique(np.abs(x - end), return_counts=True)[1]
    if at_end.size <= CLIPPED_EXCESS * np.mean(counts[1 : 1 + NEXT_VALUES]):
        return 0, 0
    return at_end.size, starts[longest]


def check_rest(trial: PreparedTrial, name: str) -> Finding:
    """A channel that keeps one value for a second while another one moves, or together with all others for long."""
    rests = _find_dead_rests(trial, name)
    if not len(rests):
        return Finding(f"rest of the {name}", "ok", "none.")
    time = trial.samples["time"]
    samples = np.sum(np.diff(rests))
    share = 100.0 * samples / time.size
    start, stop = rests[0]
    text = (
        f"{samples} samples ({share:.3g} %) of the {name} keep one value, first from {start} to "
        f"{stop - 1} ({time[start]:.6g} … {time[stop - 1]:.6g} s): the channel was dead or the record is padded there, "
        "and K, B, I and G mix that with the joint. Cut the record there (segment)."
    )
    return Finding(f"rest of the {name}", "refused", text)


def _find_dead_rests(trial: PreparedTrial, name: str) -> np.ndarray:
    """First sample of each rest during which the joint moves, or that is too long, and the sample after it.

    Shapes: returns (rests, 2).
    """
    x = trial.samples[name]
    shortest = SHORTEST_REST * trial.rate - 1
    repeats = np.flatnonzero(x[1:] == x[:-1])
    starts, lengths = find_runs(repeats)
    runs = np.stack([starts, starts + lengths + 1], axis=1)
    rests = runs[lengths >= shortest]
    witness = "reference" if "reference" in trial.trial else "torque"
    if name == "torque":
        witness = "position"
    other = trial.samples[witness]
    moved = MOVEMENT_SHARES[witness] * np.ptp(other)
    is_dead = np.array([np.ptp(other[slice(*rest)]) > moved for rest in rests], dtype=bool)
    durations = np.diff(rests)[:, 0]
    is_common = durations >= LONG_REST * trial.rate
    if np.sum(durations[is_common]) > LONG_REST_SHARE * x.size:
        is_dead |= is_common
    return rests[is_dead]


def check_gaps(trial: PreparedTrial, name: str) -> Finding:
    """Gaps that were filled by the last value or by a line: no sensor records an exactly straight line.

    What comes to rest by itself does so smoothly; a held value begins and ends with a break. Values that are held for a
    second are a matter of `check_rest`.
    """
    gaps = trial.gaps(name)
    if not len(gaps):
        return Finding(f"{GAPS} {name}", "ok", "none was filled.")
    share = np.sum(np.diff(gaps)) / trial.time.size
    verdict = "warning" if share < LARGE_GAP_SHARE else "refused"
    text = (
        f"{len(gaps)} stretches of the {name} ({100 * share:.2g} % of the record) are exactly straight, "
        f"the first from {_place(trial, gaps[0, 0])}: gaps were filled by the last value or a line, and K, B, I and G "
        "mix that with the joint. Take riv, which leaves them out, or cut the record there (segment)."
    )
    return Finding(f"{GAPS} {name}", verdict, text)


def is_reference_filled(trial: PreparedTrial, reference: str) -> bool:
    """Whether a reference is straight wherever position or torque were filled."""
    gaps = [gap for name in REQUIRED for gap in trial.gaps(name)]
    # In open loop there are no instruments; a method refuses a reference that is not there.
    if not gaps or reference == "position" or reference not in trial.samples:
        return False
    straight = find_straight(trial.samples[reference])
    inside = np.concatenate([straight[start : stop - 2] for start, stop in gaps])
    return bool(np.mean(inside) > STRAIGHT_SHARE)


def check_spikes(trial: PreparedTrial, name: str) -> Finding:
    """A peak of a few milliseconds that stands out from all that the rest of the record has.

    The height of a peak is the geometric mean of the two changes from 3 ms before it and to 3 ms after it; it is
    compared with the median of the largest peaks of ten parts of the record.
    """
    x = trial.samples[name]
    reach = max(1, round(SPIKE_REACH * trial.rate))
    here = x[reach:-reach]
    products = (here - x[: -2 * reach]) * (here - x[2 * reach :])  # positive at a peak
    for start, stop in trial.gaps(name):  # steps at the ends of what was filled
        products[max(0, start - 2 * reach) : stop] = 0.0
    count = int(np.clip(x.size / trial.rate, *SPIKE_PARTS))
    peaks = np.array([part.max(initial=0.0) for part in np.array_split(products, count)])
    height = np.sqrt(peaks.max())
    usual = np.sqrt(np.median(peaks[peaks > 0.0])) if height > 0.0 else 0.0
    stands_out = height > SPIKE_EXCESS * usual and height > SPIKE_SIZE * np.std(x)
    if not stands_out:
        return Finding(f"spikes of the {name}", "ok", "none.")
    sample = int(np.argmax(products)) + reach
    text = (
        f"the {name} has a spike of about {height:.2g} {VARIABLES[name][0]} at "
        f"{_place(trial, sample)}, {height / usual:.2g} times as high as other peaks of this length: it acts on K, B, "
        "I and G like a blow that nobody gave. Repair the sample, or cut the record there (segment)."
    )
    return Finding(f"spikes of the {name}", "refused", text)


def _place(trial: PreparedTrial, sample: int) -> str:
    """Number and time of a sample."""
    return f"sample {sample} ({trial.samples['time'][sample]:.6g} s)"


CHANNEL_CHECKS = (check_clipping, check_rest, check_gaps, check_spikes)
