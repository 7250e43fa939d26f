"""What a check has found about a property of the data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

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
    remedy : mapping of str to object
        Options of `read_trial` or of a command that would help, with their values, as a `DataError` has them.
    """

    name: str
    verdict: str
    text: str
    remedy: Mapping[str, Any] = field(default_factory=dict)


def name_trial(number: int, trials: int) -> str:
    """Which of several trials a text is about, in front of it; nothing where there is one."""
    return f"trial {number} of {trials}: " if trials > 1 else ""


def merge_findings(findings: Sequence[Finding]) -> Finding:
    """The worst finding about one property of several trials, with the number of its trial."""
    trials = len(findings)
    worst = max(findings, key=lambda finding: VERDICTS.index(finding.verdict))
    place = name_trial(findings.index(worst) + 1, trials)
    if trials > 1 and worst.verdict == "ok":
        place = f"all {trials} trials pass; the first: "
    return replace(worst, text=f"{place}{worst.text}")
