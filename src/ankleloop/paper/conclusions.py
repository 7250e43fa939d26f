"""Conclusions that a person has written, each shown where the ledger has the verdict for which it was written."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import pandas as pd
import yaml

Conclusions = Mapping[str, Mapping[str, str]]


def read_conclusions(path: str | PathLike[str]) -> Conclusions:
    """Conclusions by the claim that each rests on: its verdict, a sentence and a paragraph."""
    return yaml.safe_load(Path(path).read_text(encoding="utf-8"))


def conclude(ledger: pd.DataFrame, conclusions: Conclusions, claim: str, part: str = "paragraph") -> str:
    """A conclusion with the numbers of the run; where the run has another verdict, that verdict and its reason."""
    rows = ledger[ledger["id"] == claim]
    if rows.empty:
        return ""
    row = rows.iloc[0]
    if row["verdict"] == conclusions[claim]["verdict"]:
        return conclusions[claim][part].format(**row, size=abs(row["ours"])).strip()
    return f"**{row['statement']}: {row['verdict']} in this run.** {row['reason']}"


def summarise(ledger: pd.DataFrame, conclusions: Conclusions) -> list[str]:
    """The sentences that open the article and the index."""
    claims = [claim for claim, conclusion in conclusions.items() if "sentence" in conclusion]
    return [text for claim in claims if (text := conclude(ledger, conclusions, claim, "sentence"))]


def tabulate_table1(ledger: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, str]]:
    """Table 1 as the paper prints it, "paper → ours ± half a 95 % interval", and the verdict of each cell."""
    rows = ledger[ledger["id"].str.startswith("table1/")]
    keys = rows["id"].str.split("/", expand=True)
    texts = [
        f"{row.paper:g} → " + ("–" if pd.isna(row.ours) else f"{row.ours:.1f} ± {row.uncertainty:.1g}")
        for row in rows.itertuples()
    ]
    methods = rows["statement"].str.split(" by ").str[-1]
    cells = pd.DataFrame({"method": methods, "torque": keys[2] + " [% VAF]", "cell": texts})
    table = cells.pivot(index="method", columns="torque", values="cell")
    table = table.loc[cells["method"].unique(), cells["torque"].unique()]
    return table.rename_axis(columns=None).reset_index(), dict(zip(texts, rows["verdict"], strict=True))
