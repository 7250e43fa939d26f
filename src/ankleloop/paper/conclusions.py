"""Conclusions of the article: each is composed of the ledger and of the tables of the studies, or left out.

A conclusion is a function of the ledger and the tables that returns its text, or None where its study was not run. Its
words follow the verdicts and the 95 % intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from ankleloop.paper.comparisons import (
    ACCURATE,
    Tables,
    compare_sizes,
    describe_choice,
    describe_growth,
    describe_passes,
    format_mean,
    group_errors,
    list_errors,
    mean_columns,
    stiffness_errors,
)
from ankleloop.paper.judgement import CONDITIONAL, CONTRADICTION, OPEN, REPRODUCED
from ankleloop.paper.verdicts import describe_claim, list_by_verdict, phrase_verdict

BIAS_CLAIMS = (
    "openloop-biased",
    "eiv-unbiased",
    "pr-accurate",
    "pr-accurate-rectifier",
    "pr-unbiased",
    "cascade-openloop",
    "real-time-input",
)
POLE_ERROR = 0.1  # a pole this far from the true one counts as wrong
LEVEL = 95.0  # % of the intervals should hold the truth


class Conclusion(NamedTuple):
    """A conclusion in Markdown.

    Parameters
    ----------
    headline : str
        What was found.
    details : str
        The numbers behind it, where the headline does not have them.
    """

    headline: str
    details: str = ""

    @property
    def text(self) -> str:
        """All of it."""
        return f"{self.headline} {self.details}".strip()


Compose = Callable[[pd.DataFrame, Tables], "Conclusion | None"]

CONCLUSIONS: dict[str, Compose] = {}  # in the order of the article


def _conclusion(compose: Compose) -> Compose:
    """Register a conclusion under its name without "conclude_"."""
    CONCLUSIONS[compose.__name__.removeprefix("conclude_")] = compose
    return compose


def draw_conclusions(ledger: pd.DataFrame, tables: Tables) -> list[Conclusion]:
    """All conclusions that a run allows, in the order of the article."""
    conclusions = (compose(ledger, tables) for compose in CONCLUSIONS.values())
    return [conclusion for conclusion in conclusions if conclusion is not None]


def _find_rows(ledger: pd.DataFrame, claims: Collection[str]) -> pd.DataFrame | None:
    """Rows of some claims, in their order; None where there are no results for any of them."""
    rows = ledger.set_index("id").reindex([claim for claim in claims if claim in set(ledger["id"])]).reset_index()
    has_result = rows["ours"].notna() | (rows["verdict"] != OPEN)
    return rows if has_result.any() else None


def _find_table(tables: Tables, study: str, *columns: str) -> pd.DataFrame | None:
    """Table of a study; None where it was not run, or does not vary these settings."""
    table = tables.get(study)
    return None if table is None or not set(columns) <= set(table) else table


@_conclusion
def conclude_table1(ledger: pd.DataFrame, _tables: Tables) -> Conclusion | None:
    """How many of the numbers of Table 1 are reproduced, and which are not."""
    rows = _find_rows(ledger, ledger.loc[ledger["id"].str.startswith("table1/"), "id"])
    if rows is None:
        return None
    agree = rows[rows["verdict"].isin([REPRODUCED, CONDITIONAL])]
    conditions = agree.loc[agree["verdict"] == CONDITIONAL, "conditions"].dropna().unique()
    condition = f" ({'; '.join(conditions)})" if len(conditions) else ""
    others = rows[~rows.index.isin(agree.index)]
    texts = (
        f"{row.statement}{_compare_with_paper(row.ours, row.uncertainty, row.paper)}" for row in others.itertuples()
    )
    details = list_by_verdict(others, texts)
    return Conclusion(f"Reproduced: {len(agree)} of the {len(rows)} numbers of Table 1{condition}. {details}".strip())


def _compare_with_paper(ours: float, margin: float, paper: float) -> str:
    return "" if np.isnan(ours) else f", {format_mean(ours, margin)} % where the paper has {paper:g} %"


@_conclusion
def conclude_figure4(ledger: pd.DataFrame, _tables: Tables) -> Conclusion | None:
    """Which of the claims on Figure 4 are reproduced."""
    rows = _find_rows(ledger, ["figure4-pr", "figure4-cascade-biased", "figure4-cascade-falls"])
    if rows is None:
        return None
    return Conclusion(f"What Figure 4 shows. {_list_statements(rows)}")


def _list_statements(rows: pd.DataFrame) -> str:
    """Claims in groups of equal verdicts."""
    return list_by_verdict(rows, (f"“{statement}”" for statement in rows["statement"]))


@_conclusion
def conclude_cause(ledger: pd.DataFrame, tables: Tables) -> Conclusion | None:
    """Whether the published cause of the fall of the parallel cascade is reproduced."""
    rows = _find_rows(ledger, ["figure4-cause"])
    if rows is None:
        return None
    claim, table = rows.iloc[0], _find_table(tables, "figure4", "reflex_gain")
    text = "The cause that the paper gives for the fall of the parallel cascade in Figure 4, reflex torque that is fed "
    text += f"back, {phrase_verdict(claim)}"
    if claim["verdict"] == OPEN or table is None:
        return Conclusion(f"{text}: {str(claim['reason']).rstrip('.')}.")
    highest = table[(table["reflex_gain"] == table["reflex_gain"].max()) & (table["torque"] == "intrinsic")]
    highest = highest.set_index("method")
    methods = {"parallel-cascade-one-pass": "one pass", "parallel-cascade": "convergence"}
    means = " and ".join(
        f"{format_mean(*highest.loc[method, ['mean', 'margin']])} % after {name}"
        for method, name in methods.items()
        if method in highest.index
    )
    gain = table["reflex_gain"].max()
    return Conclusion(f"{text}: at gain {gain:g} its mean intrinsic VAF on the same trials is {means}.")


@_conclusion
def conclude_passes(_ledger: pd.DataFrame, tables: Tables) -> Conclusion | None:
    """How many passes the parallel cascade needs at each reflex gain."""
    table = _find_table(tables, "passes", "reflex_gain")
    return None if table is None else Conclusion(describe_passes(table))


@_conclusion
def conclude_feedback(_ledger: pd.DataFrame, tables: Tables) -> Conclusion | None:
    """Error of K of every method in closed loop against voluntary torque, and in open loop beside it."""
    table = _find_table(tables, "voluntary", "voluntary", "closed_loop")
    if table is None or not table["closed_loop"].any():
        return None
    closed, opened = (_errors_by_level(table[table["closed_loop"] == loop]) for loop in (True, False))
    low, high = min(closed), max(closed)
    place = f"in closed loop with voluntary torque of {100 * high:g} %"
    headline, details = f"Mean error of K {place}. {group_errors(closed[high])}", list_errors(closed[high])
    if high > low:
        growth = describe_growth(closed[low], closed[high])
        headline += f" From {100 * low:g} to {100 * high:g} % of voluntary torque, {growth}."
    if high in opened:
        details += f" In open loop at the same level: {list_errors(opened[high])}"
    return Conclusion(headline, f"In numbers: {details}")


def _errors_by_level(table: pd.DataFrame) -> dict[float, pd.DataFrame]:
    """Errors of K at each level of voluntary torque."""
    return {level: stiffness_errors(table[table["voluntary"] == level]) for level in table["voluntary"].unique()}


@_conclusion
def conclude_load(_ledger: pd.DataFrame, tables: Tables) -> Conclusion | None:
    """Error of K of every method against the compliance of the load."""
    table = _find_table(tables, "load", "load_stiffness")
    if table is None:
        return None
    stiff, compliant = table["load_stiffness"].max(), table["load_stiffness"].min()
    errors = {value: stiffness_errors(table[table["load_stiffness"] == value]) for value in (stiff, compliant)}
    text = f"Mean error of K against the most compliant load ({compliant:g} N·m/rad). {group_errors(errors[compliant])}"
    if stiff > compliant:
        growth = describe_growth(errors[stiff], errors[compliant])
        text += f" From the stiffest load ({stiff:g} N·m/rad) to it, {growth}."
    return Conclusion(text, f"In numbers: {list_errors(errors[compliant])}")


@_conclusion
def conclude_bias(ledger: pd.DataFrame, _tables: Tables) -> Conclusion | None:
    """What the paper says of bias in open and closed loop, by verdict."""
    rows = _find_rows(ledger, ledger.loc[ledger["id"].isin(BIAS_CLAIMS), "id"])
    return None if rows is None else Conclusion(f"What the paper says of bias. {_list_statements(rows)}")


@_conclusion
def conclude_instruments(_ledger: pd.DataFrame, tables: Tables) -> Conclusion | None:
    """What instruments for B and D change, beside least squares with the same A and C."""
    table = _find_table(tables, "voluntary", "voluntary", "closed_loop")
    closed = _errors_by_level(table[table["closed_loop"]]) if table is not None else {}
    methods = ["pr-moesp-instruments", "pr-moesp"]
    if not closed or not set(methods) <= set(closed[max(closed)]["method"]):
        return None
    errors = closed[max(closed)].set_index("method")
    values = [format_mean(errors.loc[method, "error"], errors.loc[method, "margin"], "+") for method in methods]
    comparison = compare_sizes(*(errors.loc[method] for method in methods))
    return Conclusion(
        "With instruments for B and D, and not for A and C alone, the error of K by PR-MOESP in closed loop at "
        f"{100 * max(closed):g} % voluntary torque is {values[0]} %, with least squares {values[1]} %: its size is "
        f"{comparison}."
    )


@_conclusion
def conclude_net_vaf(_ledger: pd.DataFrame, tables: Tables) -> Conclusion | None:
    """Whether scores that an experiment can show choose the method with the best intrinsic torque."""
    table = _find_table(tables, "choosing", "voluntary")
    return None if table is None else Conclusion(describe_choice(table))


@_conclusion
def conclude_poles(_ledger: pd.DataFrame, tables: Tables) -> Conclusion | None:
    """Whether an accurate intrinsic torque comes with wrong poles of the reflex."""
    table = _find_table(tables, "projection", "voluntary", "spectral_radius_mean")
    if table is None:
        return None
    vaf, vaf_margin = mean_columns(table, "vaf_intrinsic_true")
    pole, pole_margin = mean_columns(table, "spectral_radius")
    accurate = vaf - vaf_margin >= ACCURATE
    error = (pole - table["spectral_radius_true"]).abs()
    wrong = accurate & (error - pole_margin > POLE_ERROR)
    text = (
        f"Of {len(table)} combinations of projection, basis and voluntary torque, {accurate.sum()} have a mean "
        f"intrinsic VAF of {ACCURATE:g} % or more; {wrong.sum()} of these have a mean largest pole more than "
        f"{POLE_ERROR:g} off the true one, both beyond the 95 % interval"
    )
    if not wrong.any():
        return Conclusion(f"{text}.")
    row = table.loc[error.where(wrong).idxmax()]
    return Conclusion(
        f"{text}: VAF does not show wrong poles.",
        f"The furthest is {row['spectral_radius_mean']:.2f} where {row['spectral_radius_true']:.2f} is true "
        f"({row['label']}; voluntary torque {100 * row['voluntary']:g} %).",
    )


@_conclusion
def conclude_efficiency(_ledger: pd.DataFrame, tables: Tables) -> Conclusion | None:
    """Errors of all methods over the Cramér-Rao bound, and the share of intervals that hold the truth."""
    table = _find_table(tables, "efficiency")
    if table is None:
        return None
    ratios = table.groupby("label", sort=False)["ratio"].agg(["min", "median", "max"])
    medians = "; ".join(f"{label} {median:.2f}" for label, median in ratios["median"].items())
    ranges = "; ".join(f"{label} {low:.2f} … {high:.2f}" for label, low, high in ratios[["min", "max"]].itertuples())
    intervals, count = table.dropna(subset="covered"), table["point"].nunique()
    return Conclusion(
        f"Root mean square error over the Cramér-Rao bound, median of all parameters in {count} "
        f"setting{'s' if count > 1 else ''}: {medians}. "
        + " ".join(_describe_coverage(rows) for _, rows in intervals.groupby("label", sort=False)),
        f"The smallest and the largest ratio: {ranges}.",
    )


def _describe_coverage(rows: pd.DataFrame) -> str:
    """Share of the intervals of one method that hold the truth, with its 95 % interval.

    Parameters of the same trial may err together, so a trial counts once (Clopper and Pearson 1934).
    """
    trials = rows.groupby("point")["n"].max().sum()
    share = float(np.average(rows["covered"], weights=rows["n"]))
    hits = share / 100 * trials
    low = 100 * stats.beta.ppf(0.025, hits, trials - hits + 1) if hits > 0 else 0.0
    high = 100 * stats.beta.ppf(0.975, hits + 1, trials - hits) if hits < trials else 100.0
    word = "fewer than" if high < LEVEL else "more than" if low > LEVEL else "not shown to differ from"
    return (
        f"The 95 % intervals of {rows['label'].iloc[0]} hold the truth in {share:.1f} % of the cases "
        f"({low:.1f} … {high:.1f} %): {word} {LEVEL:g} %."
    )


@_conclusion
def conclude_economy(ledger: pd.DataFrame, _tables: Tables) -> Conclusion | None:
    """Whether PR-MOESP takes less time and memory than EIV-MOESP."""
    rows = _find_rows(ledger, ["economy-time", "economy-memory"])
    if rows is None:
        return None
    return Conclusion(" ".join(describe_claim(ledger, claim) or "" for claim in rows["id"]))


@_conclusion
def conclude_contradictions(ledger: pd.DataFrame, _tables: Tables) -> Conclusion | None:
    """Where the paper contradicts itself."""
    rows = ledger[ledger["verdict"] == CONTRADICTION]
    if rows.empty:
        return None
    texts = (f"“{row.statement}”, but {row.reason.rstrip('.')}" for row in rows.itertuples())
    return Conclusion(f"Contradictions in the paper: {'; '.join(texts)}.")
