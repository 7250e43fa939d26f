"""A finding: the result of one check of data, in a sentence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
    place = f"trial {number + 1} of {len(findings)}" if any(verdicts) else f"all {len(findings)} trials pass; the first"
    return Finding(worst.name, worst.verdict, f"{place}: {worst.text}")
