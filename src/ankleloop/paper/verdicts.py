"""Words for the verdicts of the ledger."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import pandas as pd

from ankleloop.paper.judgement import (
    BY_CONSTRUCTION,
    CONDITIONAL,
    CONTRADICTION,
    NOT_REPRODUCED,
    OPEN,
    REPRODUCED,
)

PHRASES = {
    REPRODUCED: "is reproduced",
    CONDITIONAL: "is reproduced under a stated condition",
    NOT_REPRODUCED: "is not reproduced",
    OPEN: "cannot be judged",
    CONTRADICTION: "is contradicted by the paper itself",
    BY_CONSTRUCTION: "holds by construction",
}


def count_verdicts(ledger: pd.DataFrame) -> str:
    """Number of claims with each verdict that occurs."""
    counts = ledger["verdict"].value_counts(sort=False)
    known = [verdict for verdict in PHRASES if verdict in counts]
    others = [verdict for verdict in counts.index if verdict not in PHRASES]
    return ", ".join(f"{counts[verdict]} {verdict}" for verdict in [*known, *others])


def phrase_verdict(claim: Mapping[str, object]) -> str:
    """Verdict on a claim as the second half of a sentence."""
    verdict, conditions = str(claim["verdict"]), claim["conditions"]
    phrase = PHRASES.get(verdict, f"has the verdict “{verdict}”")
    return f"{phrase} ({conditions})" if "condition" in verdict and isinstance(conditions, str) else phrase


def describe_claim(ledger: pd.DataFrame, claim: str) -> str | None:
    """A claim of the paper with its verdict and the reason."""
    rows = ledger[ledger["id"] == claim]
    if rows.empty:
        return None
    row = rows.iloc[0]
    phrase, _, condition = phrase_verdict(row).partition(" (")
    condition = f" ({condition}" if condition else ""
    return f"“{row['statement']}” **{phrase}**{condition}: {str(row['reason']).rstrip('.')}."


def describe_claims(ledger: pd.DataFrame, claims: Iterable[str]) -> str:
    """Claims of the paper as a list, each with its verdict and the reason."""
    texts = (describe_claim(ledger, claim) for claim in claims)
    return "\n".join(f"- {text}" for text in texts if text is not None)


def list_by_verdict(rows: pd.DataFrame, texts: Iterable[str]) -> str:
    """Texts in groups of equal verdicts, each group a sentence."""
    groups = pd.Series(list(texts)).groupby(rows["verdict"].to_numpy(), sort=False)
    order = {verdict: number for number, verdict in enumerate(PHRASES)}
    parts = sorted(groups, key=lambda group: order.get(str(group[0]), len(order)))
    return " ".join(f"{str(verdict).capitalize()}: {'; '.join(group)}." for verdict, group in parts)
