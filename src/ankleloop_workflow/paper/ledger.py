"""The ledger: every number and claim of the paper against results, and the texts that rest on its rows."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from ankleloop.trials.files import PathLike
from ankleloop_workflow.paper import checks, judgement
from ankleloop_workflow.paper.assumptions import TABLE1, measure_assumptions
from ankleloop_workflow.paper.checks import DRAWN, Case, MissingEvidence, Row, StudyResults
from ankleloop_workflow.tables.comparisons import format_pairs, format_rows

VERDICTS = {
    judgement.REPRODUCED: "the whole 95 % interval of the difference lies within what is accepted",
    judgement.CONDITIONAL: "the same, with something assumed that the paper does not give",
    judgement.AT_TOLERANCE: "the interval holds the limit, to which our value is near (a fifth of the tolerance)",
    judgement.NOT_REPRODUCED: "the whole interval of a comparison lies outside; all intervals hold together with 95 %",
    judgement.OPEN: "the interval reaches across the limit, a result or an interval is missing, or the data are others",
    judgement.CONTRADICTION: "the paper says two things; no run can change that",
    judgement.BY_CONSTRUCTION: "it follows from a definition; no run can change that",
}
PAPER, FINDING = "paper", "finding"  # whose statement a row is: the paper's or ours
HOLDS = "holds in … % of the settings drawn"  # heading
SECTIONS = {"table1": "IV, Table 1", "table2": "V, Table 2"}
MEANS = {
    "table1": "mean VAF [%]",
    "table2": "mean VAF of a simulated stand-in, as the recording is not public [%]",
}
SETTINGS = {"table1": TABLE1, "table2": {}}  # of the points that are compared
LEDGER_COLUMNS = (
    "id",
    "section",
    "statement",
    "method",
    "torque",
    "unit",
    "paper",
    "ours",
    "uncertainty",
    "tolerance",
    "difference",
    "difference_low",
    "difference_high",
    "verdict",
    "holds",
    "holds_low",
    "holds_high",
    "reason",
    "conditions",
    "how",
    "source",
)

Conclusions = Mapping[str, Mapping[str, Any]]


def verify(
    published: Mapping[str, pd.DataFrame],
    studies: Mapping[str, StudyResults],
    measurements: pd.DataFrame,
) -> pd.DataFrame:
    """Check every number of the published tables, every claim of the paper, and our own findings, by one rule."""
    labels = {name: studies[name].labels if name in studies else {} for name in SECTIONS}
    rows = [claim_numbers(name, published[name], labels[name]) for name in SECTIONS]
    rows += [published["claims"].assign(source=PAPER), published["findings"].assign(source=FINDING)]
    claims = pd.concat(rows, ignore_index=True)
    if DRAWN in studies:
        drawn = measure_assumptions(claims, studies[DRAWN])
        measurements = pd.concat([measurements, drawn], ignore_index=True)
    by_quantity = measurements.set_index("quantity")
    shares = by_quantity.reindex(f"{DRAWN}/" + claims["id"])[["value", "low", "high"]]
    claims[["holds", "holds_low", "holds_high"]] = shares.to_numpy()
    results = [_check(Case(claim, studies, by_quantity)) for claim in claims.itertuples()]
    return claims.join(pd.DataFrame(results)).reindex(columns=LEDGER_COLUMNS)


def read_claims(path: PathLike) -> pd.DataFrame:
    """Claims from a YAML file, a row for each, with its name as `id`."""
    claims = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    defaults: dict[str, Any] = {"comparisons": {}, "settings": {}}
    return pd.DataFrame([{"id": name, **defaults, **claim} for name, claim in claims.items()])


def claim_numbers(name: str, table: pd.DataFrame, labels: Mapping[str, str]) -> pd.DataFrame:
    """Numbers of a published table as claims, with the label of the method."""
    method, torque = table["method"], table["torque"]
    label = method.replace(dict(labels))
    comparisons = [
        {
            "": {
                "mean": f"{name} vaf_{number.torque}_{number.against} {number.method}",
                "from": number.paper,
                "accept": "within",
            }
        }
        for number in table.itertuples()
    ]
    return table.assign(
        id=f"{name}/" + method + "/" + torque,
        check=f"means {MEANS[name]}",
        comparisons=comparisons,
        settings=[SETTINGS[name]] * len(table),
        section=SECTIONS[name],
        statement=torque + " torque by " + label,
        method=label,
        unit="% VAF",
        conditions="reflex gain, load, actuator and voluntary torque assumed",
        how="mean VAF over trials is within the tolerance of the published number",
        source=PAPER,
    )


def _check(case: Case) -> Row:
    """Verdict on a claim, with the numbers that it rests on and its reason."""
    name, *arguments = case.claim.check.split()
    try:
        return getattr(checks, f"check_{name}")(case, *arguments)
    except MissingEvidence as missing:
        return {"verdict": judgement.OPEN, "reason": str(missing)}


def is_held(ledger: pd.DataFrame) -> pd.Series:
    """Whether each row is reproduced, under stated conditions or without any."""
    return ledger["verdict"].isin([judgement.REPRODUCED, judgement.CONDITIONAL])


def count_held(ledger: pd.DataFrame) -> str:
    """How many numbers and claims of the paper hold, of those that are decided, and why the others are not."""
    paper = ledger[ledger["source"] == PAPER]
    held = int(is_held(paper).sum())
    decided = held + int((paper["verdict"] == judgement.NOT_REPRODUCED).sum())
    text = f"{held} of the {decided} numbers and claims of the paper that are decided hold"
    others = len(paper) - decided
    if not others:
        return text
    return f"{text} (not decided: {others}, at the tolerance, open in this run, or such that no run decides)"


def tabulate_ledger(ledger: pd.DataFrame) -> pd.DataFrame:
    """The ledger as a table for people."""
    is_conditional = ledger["verdict"] == judgement.CONDITIONAL
    conditions = (" Condition: " + ledger["conditions"] + ".").where(is_conditional, "")
    columns = {
        "id": "{id}",
        "section": "{section}",
        "statement": "{statement}",
        "unit": "{unit}",
        "paper": "{paper:.4g}",
        "ours": "{ours:.4g} ± {uncertainty:.2g}",
        "difference": "{difference:+.3g} ({difference_low:+.3g} … {difference_high:+.3g})",
        "tolerance": "{tolerance:g}",
        "verdict": "{verdict}",
        HOLDS: "{holds:.0f} ({holds_low:.0f} … {holds_high:.0f})",
        "reason": "{reason}",
    }
    return format_rows(ledger.assign(reason=ledger["reason"] + conditions), columns)


def read_conclusions(path: PathLike) -> Conclusions:
    """Conclusions that a person has written: the verdicts of the claims that each states, a sentence, a paragraph."""
    return yaml.safe_load(Path(path).read_text(encoding="utf-8"))


def conclude(
    ledger: pd.DataFrame, conclusions: Conclusions, name: str, part: str = "paragraph"
) -> str:
    """A conclusion with the numbers of its first claim in the run, where all of its claims have their verdicts.

    Elsewhere the first claim that has another verdict, with its reason; nothing where a claim is not part of the run.
    """
    conclusion = conclusions[name]
    claims = conclusion["claims"]
    rows = ledger[ledger["id"].isin(claims)].set_index("id", drop=False)
    if len(rows) < len(claims):
        return ""
    for claim, verdict in claims.items():
        row = rows.loc[claim]
        if row["verdict"] != verdict:
            reason = row["reason"]
            return f"**{row['statement']}: {row['verdict']} in this run.** {reason[:1].upper()}{reason[1:]}"
    first = rows.loc[next(iter(claims))]
    table1 = ledger[ledger["id"].str.startswith("table1/")]
    counts = {"held": int(is_held(table1).sum()), "numbers": len(table1)}
    return conclusion[part].format(**first, **counts, size=abs(first["ours"])).strip()


def summarise(ledger: pd.DataFrame, conclusions: Conclusions) -> list[str]:
    """The sentences that open the article and the index, of what the run has results of."""
    ledger = ledger[ledger["ours"].notna()]
    names = [name for name, conclusion in conclusions.items() if "sentence" in conclusion]
    return [text for name in names if (text := conclude(ledger, conclusions, name, "sentence"))]


def tabulate_table1(ledger: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, str]]:
    """Table 1 as the paper prints it, "paper → ours ± half a 95 % interval", and the verdict of each cell."""
    rows = ledger[ledger["id"].str.startswith("table1/")]
    ours = format_pairs(rows["ours"], rows["uncertainty"], "{:.2f} ± {:.2f}")
    cells = rows["paper"].map("{:g} → ".format) + ours
    torques = rows["torque"] + " [% VAF]"
    table = rows.assign(torque=torques, cell=cells).pivot_table(
        "cell", "method", "torque", aggfunc="first", sort=False
    )
    verdicts = dict(zip(cells, rows["verdict"], strict=True))
    return table.rename_axis(columns=None).reset_index(), verdicts
