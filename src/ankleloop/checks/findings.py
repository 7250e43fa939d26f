"""What a check has found about a property of the data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

VERDICTS = ("ok", "warning", "refused")


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
    trials = len(findings)
    verdicts = [VERDICTS.index(finding.verdict) for finding in findings]
    number = verdicts.index(max(verdicts))
    worst = findings[number]
    if trials == 1:
        return worst
    place = f"trial {number + 1} of {trials}"
    if worst.verdict == "ok":
        place = f"all {trials} trials pass; the first"
    return replace(worst, text=f"{place}: {worst.text}")
