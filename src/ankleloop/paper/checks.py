"""What a check of a claim returns, and what several checks share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ankleloop.paper.evidence import Evidence, parse_settings
from ankleloop.paper.judgement import Comparison, Fact, Mean, Quantity

NEARLY_ALL = 90.0  # % VAF: from here on what is left unexplained tells more than the VAF

Claim = Mapping[str, Any]


@dataclass(frozen=True)
class CheckResult:
    """Result of a check."""

    reason: str  # what was found, in a sentence without its full stop
    comparisons: Sequence[Comparison] = ()  # comparisons that the claim needs all
    fact: Fact | None = None  # what no run can change, instead of comparisons
    ours: Quantity | None = None  # our value for the ledger; by default that of the decisive comparison


Check = Callable[[Claim, Evidence], CheckResult]

CLAIM_CHECKS: dict[str, Check] = {}


def claim_check(check: Check) -> Check:
    """Register a check under its name without "check_", as the claims give it."""
    CLAIM_CHECKS[check.__name__.removeprefix("check_")] = check
    return check


def within(tolerance: float) -> tuple[float, float]:
    """Accepted are differences of either sign up to a tolerance."""
    return -tolerance, tolerance


def at_least(smallest: float) -> tuple[float, float]:
    """Accepted are differences from a smallest one on."""
    return smallest, np.inf


def at_most(largest: float) -> tuple[float, float]:
    """Accepted are differences up to a largest one."""
    return -np.inf, largest


def claim_settings(claim: Claim) -> dict[str, Any]:
    """Settings of the one point that a claim needs."""
    return {name: values[0] for name, values in parse_settings(claim.get("settings")).items()}


def describe_unexplained(ours: float, paper: float) -> str:
    """Ratio of the unexplained variances of two VAFs [%] near 100 %, where their difference says little."""
    if min(ours, paper) < NEARLY_ALL or paper >= 100.0:
        return ""
    return f"{(100.0 - ours) / (100.0 - paper):.2g} times the unexplained variance"


def format_signed(mean: Mean, digits: int = 1) -> str:
    """A mean with its sign and half of its 95 % interval."""
    margin = mean.margin()
    return f"{mean.value:+.{digits}f}" + ("" if np.isnan(margin) else f" ± {margin:.{digits}f}")
