"""Conclusions stand where the ledger has their verdict, and give way to the verdict of the run elsewhere."""

import pandas as pd
import pytest
from synthetic_results import PUBLISHED, build_ledger

from ankleloop_workflow.pages.index import render_ledger
from ankleloop_workflow.paper.judgement import (
    CONDITIONAL,
    NOT_REPRODUCED,
    OPEN,
    REPRODUCED,
)
from ankleloop_workflow.paper.ledger import (
    FINDING,
    PAPER,
    VERDICTS,
    conclude,
    read_conclusions,
    summarise,
    tabulate_table1,
)

CONCLUSIONS = read_conclusions(PUBLISHED.parent / "conclusions.yaml")


@pytest.fixture(scope="module")
def ledger():
    return build_ledger(spread=0.01).reset_index()


def test_a_paragraph_stands_where_all_of_its_claims_have_their_verdicts(ledger):
    claims = {"pr-unbiased": CONDITIONAL, "riv-unbiased": NOT_REPRODUCED}
    texts = {"k": {"claims": claims, "paragraph": "K is off by {ours:.1f} %."}}
    ledger = ledger.assign(verdict=ledger["id"].map(claims))
    rows = ledger.set_index("id")
    assert conclude(ledger, texts, "k") == f"K is off by {rows['ours']['pr-unbiased']:.1f} %."
    for claim in claims:
        other = ledger.assign(verdict=ledger["verdict"].mask(ledger["id"] == claim, OPEN))
        row = rows.loc[claim]
        reason = row["reason"][:1].upper() + row["reason"][1:]
        expected = f"**{row['statement']}: cannot be judged in this run.** {reason}"
        assert conclude(other, texts, "k") == expected
        assert conclude(ledger[ledger["id"] != claim], texts, "k") == ""


def test_every_claim_of_a_conclusion_is_in_the_ledger(ledger):
    claims = {claim for conclusion in CONCLUSIONS.values() for claim in conclusion["claims"]}
    verdicts = {v for conclusion in CONCLUSIONS.values() for v in conclusion["claims"].values()}
    assert claims <= set(ledger["id"])
    assert verdicts <= set(VERDICTS)


def test_the_opening_has_a_sentence_for_each_conclusion_of_the_run(ledger):
    judged = set(ledger.loc[ledger["ours"].notna(), "id"])  # not of settings that are drawn
    names = [
        name
        for name, conclusion in CONCLUSIONS.items()
        if "sentence" in conclusion and judged >= set(conclusion["claims"])
    ]
    assert 3 <= len(names) <= 5
    assert len(summarise(ledger, CONCLUSIONS)) == len(names)
    first = next(iter(CONCLUSIONS[names[0]]["claims"]))
    assert (
        summarise(ledger[ledger["id"] != first], CONCLUSIONS) == summarise(ledger, CONCLUSIONS)[1:]
    )


def test_table_1_stands_as_the_paper_prints_it(ledger):
    cells, verdicts = tabulate_table1(ledger)
    assert list(cells) == ["method", "net [% VAF]", "intrinsic [% VAF]", "reflex [% VAF]"]
    assert cells.shape == (3, 4)
    assert cells["net [% VAF]"].iloc[0].startswith("92 → 92.00 ± 0.")
    assert set(verdicts) == set(cells.iloc[:, 1:].to_numpy().ravel())
    nothing = pd.DataFrame(ledger).assign(ours=float("nan"))
    assert tabulate_table1(nothing)[0]["net [% VAF]"].iloc[0] == "92 → –"


def test_claims_of_the_paper_and_our_findings_are_counted_apart(ledger):
    ledger = ledger.assign(verdict=REPRODUCED)
    ledger.loc[ledger.index[0], "verdict"] = OPEN
    page = render_ledger(ledger)
    claims = int((ledger["source"] == PAPER).sum()) - 1
    findings = int((ledger["source"] == FINDING).sum())
    assert f"<b>{claims}</b> reproduced" in page
    assert f"and {findings} of our own findings" in page
    assert f"{claims} of the {claims} numbers and claims of the paper that are decided hold" in page
    assert "(not decided: 1, at the tolerance, open in this run" in page
