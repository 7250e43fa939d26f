"""The ledger: every number and claim of the paper against results, each verdict from a comparison."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ankleloop.replication.claim_checks import CLAIM_CHECKS, CheckResult, Claim, check_table_number
from ankleloop.replication.evidence import Evidence, MissingEvidence, StudyResults
from ankleloop.replication.tables import format_number

__all__ = ["VERDICTS", "format_ledger", "verify"]

VERDICTS = ("reproduced", "reproduced under stated conditions", "not reproduced", "cannot be judged")


def verify(
    claims: pd.DataFrame,
    tables: Mapping[str, pd.DataFrame],
    studies: Mapping[str, StudyResults],
    measurements: pd.DataFrame,
) -> pd.DataFrame:
    """Check every claim and every number of the published tables.

    Parameters
    ----------
    claims : pandas.DataFrame
        Columns `id`, `section`, `statement`, `paper`, `unit`, `tolerance`, `check` (one of
        `ankleloop.replication.claim_checks.CLAIM_CHECKS`), `conditions` (empty where the paper gives all of them) and
        `how`.
    tables : dict of str to pandas.DataFrame
        Published tables by the study that reproduces them: columns `method`, `torque`, `against`, `paper`, and
        where it is set `tolerance` [points].
    studies : dict of str to StudyResults
        Results by study.
    measurements : pandas.DataFrame
        Further measurements: columns `quantity`, `value`.

    Returns
    -------
    pandas.DataFrame
        Columns `id`, `section`, `statement`, `unit`, `paper`, `ours`, `uncertainty` (half width of the 95 % interval),
        `tolerance`, `verdict` (one of `VERDICTS`), `reason`, `conditions`, `how`: tables first, then claims.
    """
    evidence = Evidence(studies, measurements.set_index("quantity")["value"].to_dict(), tables)
    numbers = [
        _table_claim(name, number, studies[name].labels if name in studies else {})
        for name, table in tables.items()
        for number in table.to_dict("records")
    ]
    return pd.DataFrame([_ledger_row(claim, evidence) for claim in [*numbers, *claims.to_dict("records")]])


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
        result = check(claim, evidence)
    except MissingEvidence as reason:
        result = CheckResult(None, np.nan, np.nan, str(reason))
    return {
        **{name: claim[name] for name in ("id", "section", "statement", "unit", "paper")},
        "ours": result.value,
        "uncertainty": result.margin,
        "tolerance": claim.get("tolerance"),
        "verdict": _verdict(result.holds, claim["conditions"]),
        "reason": result.reason,
        "conditions": claim["conditions"],
        "how": claim["how"],
    }


def _verdict(holds: bool | None, conditions: Any) -> str:
    if holds is None:
        return "cannot be judged"
    if not holds:
        return "not reproduced"
    return VERDICTS[1] if isinstance(conditions, str) and conditions else VERDICTS[0]


def format_ledger(ledger: pd.DataFrame) -> str:
    """The ledger as a page.

    Parameters
    ----------
    ledger : pandas.DataFrame
        From `verify`.

    Returns
    -------
    str
        Markdown: the count of each verdict, and a row for each claim.
    """
    counts = ledger["verdict"].value_counts()
    summary = [f"- {counts.get(verdict, 0)} × {verdict}" for verdict in VERDICTS]
    lines = [
        "# Verification",
        "",
        f"{len(ledger)} numbers and claims of the paper, each judged by a comparison in code (column `how` of "
        "`verification.csv`; the claims are in `data/published`):",
        "",
        *summary,
        "",
        "± is half the 95 % confidence interval of the mean over trials.",
        "",
        _format_rows(ledger).to_markdown(index=False, disable_numparse=True),
        "",
    ]
    return "\n".join(lines)


def _format_rows(ledger: pd.DataFrame) -> pd.DataFrame:
    """Columns of the ledger that the page has, as text."""
    cells = ledger[["id", "section", "statement", "unit"]].copy()
    cells["paper"] = [format_number(paper, ".4g") for paper in ledger["paper"]]
    cells["ours"] = [
        format_number(row.ours, ".4g") + (f" ± {row.uncertainty:.2g}" if pd.notna(row.uncertainty) else "")
        for row in ledger.itertuples()
    ]
    cells["verdict"] = ledger["verdict"]
    cells["reason"] = [
        row.reason + (f" Condition: {row.conditions}." if row.verdict == VERDICTS[1] else "")
        for row in ledger.itertuples()
    ]
    return cells
