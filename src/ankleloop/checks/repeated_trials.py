"""Trials that are merged have to be different records."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.records.validation import REQUIRED

__all__ = ["refuse_repeated_trials"]

COMPARED = 8  # samples of each channel that are compared first


def refuse_repeated_trials(trials: Sequence[PreparedTrial]) -> None:
    """Refuse trials of which one is there twice: merged, it would count twice, and intervals would be too narrow.

    Two trials are one record where every sample of position and torque is the same, whatever object or file it comes
    from. Two measurements never are.
    """
    alike: dict[tuple[bytes, ...], list[int]] = {}
    for number, trial in enumerate(trials):
        earlier = alike.setdefault(_sample(trial), [])
        for other in earlier:
            if _is_same(trials[other], trial):
                raise DataError(
                    f"trials {other + 1} and {number + 1} of {len(trials)} are the same record, which would count "
                    "twice: leave one of them out."
                )
        earlier.append(number)


def _sample(trial: PreparedTrial) -> tuple[bytes, ...]:
    """A few samples of each channel: what differs in them need not be compared."""
    channels = [trial.samples(name) for name in REQUIRED]
    return tuple(x[:: max(1, x.size // COMPARED)].tobytes() for x in channels)


def _is_same(first: PreparedTrial, second: PreparedTrial) -> bool:
    return first is second or all(np.array_equal(first.samples(name), second.samples(name)) for name in REQUIRED)
