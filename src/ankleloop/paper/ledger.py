"""The ledger: every number and claim of the paper against results, each verdict from a comparison."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.paper.checks import CLAIM_CHECKS
from ankleloop.paper.claim_checks import CheckResult, Claim, check_table_number
from ankleloop.paper.evidence import Evidence, MissingEvidence, StudyResults
from ankleloop.paper.judgement import (
    AT_TOLERANCE,
    BY_CONSTRUCTION,
    CONDITIONAL,
    CONTRADICTION,
    NOT_REPRODUCED,
    OPEN,
    REPRODUCED,
    judge,
)
from ankleloop.paper.tables import format_number

VERDICTS = {
    REPRODUCED: "the whole 95 % interval of the difference lies within what is accepted",
    CONDITIONAL: "the same, with something assumed that the paper does not give",
    AT_TOLERANCE: "the limit lies in a narrow interval, our value within a fifth of the tolerance from it: no number "
    "of trials that a run has decides",
    NOT_REPRODUCED: "the whole interval lies outside; if a claim needs several comparisons, that of one of them, all "
    "intervals taken to hold together with 95 %",
    OPEN: "the interval reaches across the limit, there is none (a single trial), or a result is missing",
    CONTRADICTION: "the paper says two things; no run can change that",
    BY_CONSTRUCTION: "it follows from a definition; no run can change that",
}
PAPER, FINDING = "paper", "finding"  # whose statement a row is: the paper's or ours


def verify(
    claims: pd.DataFrame,
    tables: Mapping[str, pd.DataFrame],
    studies: Mapping[str, StudyResults],
    measurements: pd.DataFrame,
    findings: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """Check every number of the published tables, every claim of the paper, and our own findings, by one rule."""
    evidence = Evidence(studies, measurements.set_index("quantity"), tables)
    numbers = [
        _table_claim(name, number, studies[name].labels if name in studies else {})
        for name, table in tables.items()
        for number in table.to_dict("records")
    ]
    rows = [_ledger_row(claim, evidence) | {"source": PAPER} for claim in [*numbers, *claims.to_dict("records")]]
    if findings is not None:
        rows += [_ledger_row(claim, evidence) | {"source": FINDING} for claim in findings.to_dict("records")]
    return pd.DataFrame(rows)


def _table_claim(name: str, number: Mapping[str, Any], labels: Mapping[str, str]) -> dict[str, Any]:
    """A number of a published table as a claim; it has no check of its own."""
    return {
        **number,
        "id": f"{name}/{number['method']}/{number['torque']}",
        "study": name,
        "section": {"table1": "IV, Table 1", "table2": "V, Table 2"}.get(name, name),
        "statement": f"{number['torque']} torque by {labels.get(number['method'], number['method'])}",
        "unit": "% VAF",
        "conditions": "reflex gain, load, actuator and voluntary torque assumed",
        "how": "mean VAF over trials is within the tolerance of the published number",
    }


def _ledger_row(claim: Claim, evidence: Evidence) -> dict[str, Any]:
    check = CLAIM_CHECKS[claim["check"]] if "check" in claim else check_table_number
    try:
        outcome = _judge_result(check(claim, evidence))
    except MissingEvidence as missing:
        outcome = {"verdict": OPEN, "reason": str(missing)}
    if outcome["verdict"] == REPRODUCED and isinstance(claim["conditions"], str) and claim["conditions"]:
        outcome["verdict"] = CONDITIONAL
    outcome["reason"] = outcome["reason"].rstrip(".") + "."
    numbers = ("ours", "uncertainty", "difference", "difference_low", "difference_high")
    return {
        **{name: claim[name] for name in ("id", "section", "statement", "unit", "paper")},
        **{name: outcome.get(name, np.nan) for name in numbers[:2]},
        "tolerance": claim.get("tolerance"),
        **{name: outcome.get(name, np.nan) for name in numbers[2:]},
        **{name: outcome[name] for name in ("verdict", "reason")},
        **{name: claim[name] for name in ("conditions", "how")},
    }


def _judge_result(result: CheckResult) -> dict[str, Any]:
    """Verdict on the result of a check, with the numbers that it rests on and its reason."""
    if result.fact is not None:
        return {"verdict": result.fact.verdict, "ours": result.fact.value, "reason": result.reason}
    judgement = judge(result.comparisons)
    decisive = judgement.decisive
    ours = result.ours or decisive.ours
    low, high = ours.interval()
    difference_low, difference_high = judgement.interval
    explanation = judgement.explanation
    return {
        "verdict": judgement.verdict,
        "ours": ours.value,
        "uncertainty": (high - low) / 2.0,
        "difference": decisive.difference,
        "difference_low": difference_low,
        "difference_high": difference_high,
        "reason": result.reason + (f" – {explanation}" if explanation else ""),
    }


def count_held(ledger: pd.DataFrame) -> str:
    """How many numbers and claims of the paper hold, of those that can be decided."""
    counts = ledger.loc[ledger["source"] == PAPER, "verdict"].value_counts()
    held = sum(int(counts.get(verdict, 0)) for verdict in (REPRODUCED, CONDITIONAL))
    decided = held + int(counts.get(NOT_REPRODUCED, 0))
    return f"{held} of the {decided} numbers and claims of the paper that can be decided hold"


def format_ledger(ledger: pd.DataFrame) -> str:
    """The ledger as a page."""
    counts = ledger["verdict"].value_counts()
    summary = [f"- {counts.get(verdict, 0)} × **{verdict}**: {meaning}" for verdict, meaning in VERDICTS.items()]
    lines = [
        "# Verification",
        "",
        f"{count_held(ledger)}, under the assumptions that are stated. One rule in code judges all rows (column `how` "
        "of `verification.csv` says what is compared; the claims are in `data/published`):",
        "",
        *summary,
        "",
        "± is half of the 95 % confidence interval of the result. The difference is that which decides the verdict, "
        "with its interval: our result less the published one, or less what column `how` names. It is compared with "
        "the tolerance.",
        "",
        tabulate_ledger(ledger).to_markdown(index=False, disable_numparse=True),
        "",
    ]
    return "\n".join(lines)


def tabulate_ledger(ledger: pd.DataFrame) -> pd.DataFrame:
    """The ledger as a table for people."""
    cells = ledger[["id", "section", "statement", "unit"]].copy()
    cells["paper"] = [format_number(paper, ".4g") for paper in ledger["paper"]]
    cells["ours"] = [
        format_number(row.ours, ".4g") + (f" ± {row.uncertainty:.2g}" if pd.notna(row.uncertainty) else "")
        for row in ledger.itertuples()
    ]
    cells["difference"] = [
        format_number(row.difference, "+.3g")
        + ("" if pd.isna(row.difference_low) else f" ({row.difference_low:+.3g} … {row.difference_high:+.3g})")
        for row in ledger.itertuples()
    ]
    cells["tolerance"] = [format_number(tolerance, "g") for tolerance in ledger["tolerance"].astype(float)]
    cells["verdict"] = ledger["verdict"]
    cells["reason"] = [
        row.reason + (f" Condition: {row.conditions}." if row.verdict == CONDITIONAL else "")
        for row in ledger.itertuples()
    ]
    return cells
