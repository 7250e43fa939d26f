"""Findings, and those about the recorded samples of a channel: clipping, stretches at rest, filled gaps, spikes.

Each check costs a few passes over the samples at most, so that every identification can afford it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ankleloop.joint.prepared import PreparedTrial

CLIPPED_RUN = 5  # consecutive samples at the very end of the range
CLIPPED_EXCESS = 5.0  # times as many samples there as at the next values
MINOR = 1.0  # % of the samples: less clipping is only a warning of the recording check
REST = 1.0  # s at exactly the same value: noise of a sensor moves any channel sooner
LONG_REST, REST_SHARE = 2.0, 0.2  # s, and share of the record, where no other channel moves either
MOVEMENT = {
    "position": 0.5,
    "torque": 0.1,
    "reference": 0.1,
}  # share of its range by which another channel moves
GAP = 0.05  # s on an exactly straight line
GAP_SHARE, LARGE_GAP_SHARE = 0.01, 0.05  # of the record, in such lines
SLOPED = 1e-3  # of the usual slope
ROUNDING = 8.0 * np.finfo(float).eps  # of the largest value
SPIKE = 0.003  # s on either side
PARTS = (
    5,
    10,
)  # fewest and most parts of the record: a perturbation is in most of them, a spike is not
SPIKE_EXCESS = 5.0  # times the usual largest peak of a part
SPIKE_SIZE = 0.5  # standard deviations of the channel
VERDICTS = ("ok", "warning", "refused")
CHANNEL_UNITS = {"position": "rad", "torque": "N·m", "reference": "rad"}


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
    """The worst finding about one property of several trials, with the number of its trial."""
    verdicts = [VERDICTS.index(finding.verdict) for finding in findings]
    number = int(np.argmax(verdicts))
    worst = findings[number]
    if len(findings) == 1:
        return worst
    place = (
        f"trial {number + 1} of {len(findings)}"
        if any(verdicts)
        else f"all {len(findings)} trials pass; the first"
    )
    return Finding(worst.name, worst.verdict, f"{place}: {worst.text}")


def check_clipping(trial: PreparedTrial, name: str) -> Finding:
    """A channel that stays at its largest or smallest value has reached the end of its range.

    It does if many samples are there, at least some of them in a row, compared to the next values.
    """
    x = trial.samples[name]
    clipped = first = 0
    for edge in (x.min(), x.max()):
        at_edge = np.flatnonzero(x == edge)
        if at_edge.size < max(CLIPPED_RUN, clipped + 1):
            continue
        starts, lengths = _runs(at_edge)
        longest = int(np.argmax(lengths))
        if lengths[longest] < CLIPPED_RUN:
            continue
        # As many samples again, the nearest to the end, have more than five other values if it is clipped.
        count = min(2 * at_edge.size, x.size)
        nearest = np.partition(np.abs(x - edge), count - 1)[:count]
        counts = np.unique(nearest[nearest > 0], return_counts=True)[1][:5]
        nearby = max(float(counts.mean()), 1.0) if counts.size else 1.0
        if at_edge.size > CLIPPED_EXCESS * nearby:
            clipped, first = at_edge.size, int(starts[longest])
    if not clipped:
        return Finding(f"clipping of the {name}", "ok", "none.")
    share = 100.0 * clipped / x.size
    text = (
        f"{clipped} samples ({share:.3g} %) stand at the end of the range of the {name}, first at "
        f"{_place(trial, first)}: what lies beyond is lost, and K, B, I and G are off. Record again: widen the range."
    )
    return Finding(f"clipping of the {name}", "warning" if share < MINOR else "refused", text)


def _runs(samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First sample and length of each run of consecutive samples."""
    breaks = np.flatnonzero(np.diff(samples) != 1) + 1
    edges = np.concatenate(([0], breaks, [samples.size]))
    return samples[edges[:-1]], np.diff(edges)


def check_rest(trial: PreparedTrial, name: str) -> Finding:
    """A channel that keeps one value for a second while another one moves, or together with all others for long."""
    x = trial.samples[name]
    repeats = np.flatnonzero(x[1:] == x[:-1])
    starts, lengths = _runs(repeats) if repeats.size else (repeats, repeats)
    long = lengths >= REST * trial.rate - 1
    rests = [
        (int(start), int(start + length) + 1)
        for start, length in zip(starts[long], lengths[long], strict=True)
    ]
    witness = (
        "position" if name == "torque" else "reference" if "reference" in trial.trial else "torque"
    )
    other = trial.samples[witness]
    # A position that stands still while the torque moves may be a perturbation that pauses.
    share = MOVEMENT["position"] if (name, witness) == ("position", "torque") else MOVEMENT[witness]
    dead = [rest for rest in rests if np.ptp(other[slice(*rest)]) > share * np.ptp(other)]
    common = [rest for rest in rests if rest[1] - rest[0] >= LONG_REST * trial.rate]
    if sum(stop - start for start, stop in common) > REST_SHARE * x.size:
        dead = sorted({*dead, *common})
    if not dead:
        return Finding(
            f"rest of the {name}", "ok", f"the {name} does not stand still for {REST:g} s."
        )
    samples = sum(stop - start for start, stop in dead)
    start, stop = dead[0]
    time = trial.samples["time"]
    text = (
        f"{samples} samples ({100.0 * samples / x.size:.3g} %) of the {name} keep one value, first from {start} to "
        f"{stop - 1} ({time[start]:.6g} … {time[stop - 1]:.6g} s): the channel was dead or the record is padded there, "
        "and K, B, I and G mix that with the joint. Cut the record there (segment)."
    )
    return Finding(f"rest of the {name}", "refused", text)


def check_gaps(trial: PreparedTrial, name: str) -> Finding:
    """Gaps that were filled by the last value or by a line: no sensor records an exactly straight line.

    What comes to rest by itself does so smoothly; a held value begins and ends with a break. Values that are held for a
    second are a matter of `check_rest`.
    """
    x = trial.samples[name]
    slopes = np.diff(x)
    bends = np.abs(np.diff(slopes))
    largest = ROUNDING * float(np.abs(x).max())
    straight = np.flatnonzero(bends <= largest)
    if straight.size < GAP_SHARE * x.size:
        return Finding(f"gaps of the {name}", "ok", "none was filled.")
    starts, lengths = _runs(straight)
    heights, usual = np.abs(slopes), float(np.sqrt(np.mean(slopes**2)))
    step = float(heights[heights > largest].min(initial=np.inf))  # of a converter
    begins = np.append(np.inf, bends)[starts] > SLOPED * usual
    ends = np.append(bends, 0.0)[starts + lengths] > max(usual, 2.5 * step)
    held = ends & (lengths < REST * trial.rate - 1)
    filled = (lengths >= GAP * trial.rate) & begins & ((heights[starts] > SLOPED * usual) | held)
    share = float(np.sum(lengths[filled] + 2)) / x.size
    if share < GAP_SHARE:
        return Finding(f"gaps of the {name}", "ok", "none was filled.")
    text = (
        f"{np.count_nonzero(filled)} stretches of the {name} ({100 * share:.2g} % of the record) are exactly straight, "
        f"the first from {_place(trial, int(starts[filled][0]))}: gaps were filled by the last value or a line, "
        "and K, B, I and G mix that with the joint. Cut the record there (segment)."
    )
    return Finding(f"gaps of the {name}", "warning" if share < LARGE_GAP_SHARE else "refused", text)


def check_spikes(trial: PreparedTrial, name: str) -> Finding:
    """A peak of a few milliseconds that stands out from all that the rest of the record has.

    The height of a peak is the geometric mean of the two changes from 3 ms before it and to 3 ms after it; it is
    compared with the median of the largest peaks of ten parts of the record.
    """
    x, ok = (
        trial.samples[name],
        Finding(f"spikes of the {name}", "ok", f"no peak of {1000 * SPIKE:g} ms stands out."),
    )
    reach = max(1, round(SPIKE * trial.rate))
    here = x[reach:-reach]
    products = (here - x[: -2 * reach]) * (here - x[2 * reach :])  # positive at a peak
    parts = min(max(int(x.size / trial.rate), PARTS[0]), PARTS[1])
    peaks = np.array([part.max(initial=0.0) for part in np.array_split(products, parts)])
    largest = float(peaks.max())
    usual = float(np.median(peaks[peaks > 0.0])) if largest > 0.0 else 0.0
    height = np.sqrt(largest)
    if not largest > SPIKE_EXCESS**2 * usual or not height > SPIKE_SIZE * float(np.std(x)):
        return ok
    sample = int(np.argmax(products)) + reach
    excess = (
        f", {height / np.sqrt(usual):.2g} times as high as other peaks of this length"
        if usual > 0
        else ""
    )
    text = (
        f"the {name} has a spike of about {height:.2g} {CHANNEL_UNITS[name]} at "
        f"{_place(trial, sample)}{excess}: it acts on K, B, I and G like a blow that nobody "
        "gave. Repair the sample, or cut the record there (segment)."
    )
    return Finding(f"spikes of the {name}", "refused", text)


def _place(trial: PreparedTrial, sample: int) -> str:
    return f"sample {sample} ({float(trial.samples['time'][sample]):.6g} s)"


CHANNEL_CHECKS = (check_clipping, check_rest, check_gaps, check_spikes)
