"""The ledger: every number and claim of the paper against results, each verdict from a comparison."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from ankleloop.replication.claim_checks import JUDGES, CannotBeJudged, Judgement, table_number

__all__ = ["VERDICTS", "StudyResults", "as_markdown", "verify"]

VERDICTS = ("reproduced", "reproduced under stated conditions", "not reproduced", "cannot be judged")


@dataclass(frozen=True)
class StudyResults:
    """Tidy results of one study.

    Parameters
    ----------
    kind : str
        "simulation" or "recordings".
    points : dict of str to dict
        Parameters of each point.
    scores, parameters : pandas.DataFrame
        Tables of `ankleloop.assessment.scores.evaluate` and `parameters`, with columns `point`, `method` and `trial`.
    labels : dict of str to str
        Readable name of each method.
    """

    kind: str
    points: dict
    scores: pd.DataFrame
    parameters: pd.DataFrame
    labels: dict = field(default_factory=dict)


def verify(claims, tables, studies, measured):
    """Judge every claim and every number of the published tables.

    Parameters
    ----------
    claims : pandas.DataFrame
        Columns `id`, `section`, `statement`, `paper`, `unit`, `tolerance`, `judge` (one of
        `ankleloop.replication.claim_checks.JUDGES`), `conditions` (empty where the paper gives all of them) and `how`.
    tables : dict of str to pandas.DataFrame
        Published tables by the study that reproduces them: columns `method`, `torque`, `against`, `paper`, and
        `tolerance` [points].
    studies : dict of str to StudyResults
        Results by study.
    measured : pandas.DataFrame
        Further measurements: columns `quantity`, `value`.

    Returns
    -------
    pandas.DataFrame
        Columns `id`, `section`, `statement`, `unit`, `paper`, `ours`, `uncertainty` (half width of the 95 % interval),
        `tolerance`, `verdict` (one of `VERDICTS`), `reason`, `conditions`, `how`: tables first, then claims.
    """
    evidence = {"studies": studies, "measured": measured.set_index("quantity")["value"].to_dict(), "tables": tables}
    rows = []
    for name, published in tables.items():
        for number in published.to_dict("records"):
            labels = studies[name].labels if name in studies else {}
            rows.append(_row(_table_claim(name, number, labels), lambda claim: table_number(claim, evidence)))
    for claim in claims.to_dict("records"):
        rows.append(_row(claim, lambda claim: JUDGES[claim["judge"]](claim, evidence)))
    return pd.DataFrame(rows)


def _table_claim(name, number, labels):
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


def _row(claim, judge):
    try:
        judgement = judge(claim)
    except CannotBeJudged as reason:
        judgement = Judgement(None, np.nan, np.nan, str(reason))
    return {
        **{name: claim[name] for name in ("id", "section", "statement", "unit", "paper")},
        "ours": judgement.ours,
        "uncertainty": judgement.uncertainty,
        "tolerance": claim.get("tolerance"),
        "verdict": _verdict(judgement.holds, claim["conditions"]),
        "reason": judgement.reason,
        "conditions": claim["conditions"],
        "how": claim["how"],
    }


def _verdict(holds, conditions):
    if holds is None:
        return "cannot be judged"
    if not holds:
        return "not reproduced"
    return VERDICTS[1] if isinstance(conditions, str) and conditions else VERDICTS[0]


def as_markdown(ledger):
    """The ledger as a page.

    Parameters
    ----------
    ledger : pandas.DataFrame
        From `verify`.

    Returns
    -------
    str
        Markdown: how often each verdict was given, and a row for each claim.
    """
    counts = ledger["verdict"].value_counts()
    summary = [f"- {counts.get(verdict, 0)} × {verdict}" for verdict in VERDICTS]

    def number(value, sign=""):
        return "–" if pd.isna(value) else f"{value:{sign}.4g}"

    shown = pd.DataFrame(
        {
            "id": ledger["id"],
            "section": ledger["section"],
            "statement": ledger["statement"],
            "unit": ledger["unit"],
            "paper": ledger["paper"].map(number),
            "ours": [
                number(ours) + (f" ± {margin:.2g}" if pd.notna(margin) else "")
                for ours, margin in zip(ledger["ours"], ledger["uncertainty"], strict=True)
            ],
            "verdict": ledger["verdict"],
            "reason": [
                reason + (f" Condition: {conditions}." if verdict == VERDICTS[1] else "")
                for reason, conditions, verdict in zip(
                    ledger["reason"], ledger["conditions"], ledger["verdict"], strict=True
                )
            ],
        }
    )
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
        shown.to_markdown(index=False, disable_numparse=True),
        "",
    ]
    return "\n".join(lines)
