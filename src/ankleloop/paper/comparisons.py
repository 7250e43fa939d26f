"""Comparisons of means over trials, and the words that follow from their 95 % intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ankleloop.signals.vaf import confidence_margin

Tables = Mapping[str, pd.DataFrame]

ACCURATE = 99.0  # % VAF: from here on a torque counts as accurate
BIAS = 5.0  # % of K: smallest error that counts, as in the claim that methods made for open loop are biased


def mean_margin(sd: ArrayLike, n: ArrayLike) -> np.ndarray:
    """Half of the 95 % interval of a mean; infinite for a single trial, which shows nothing."""
    return np.nan_to_num(confidence_margin(sd, n), nan=np.inf)


def mean_columns(table: pd.DataFrame, name: str) -> tuple[pd.Series, pd.Series]:
    """Means of a quantity, and half of their 95 % intervals."""
    margins = mean_margin(table[f"{name}_std"], table[f"{name}_count"])
    return table[f"{name}_mean"], pd.Series(margins, table.index)


def stiffness_errors(table: pd.DataFrame) -> pd.DataFrame:
    """Mean error of K of each method."""
    _, margins = mean_columns(table, "K")
    truth = table["K_mean"] - table["K_bias"]
    errors = table[["method", "label"]].assign(error=100 * table["K_bias"] / truth, margin=100 * margins / truth)
    return errors.reset_index(drop=True)


def format_mean(value: float, margin: float, sign: str = "") -> str:
    """A mean and half of its 95 % interval, to the digits that the interval has."""
    if not np.isfinite(margin):
        return f"{value:{sign}.1f}"
    digits = min(2, max(0, 1 - math.floor(math.log10(margin)))) if margin > 0 else 2
    rounded = round(value, digits) + 0.0  # no minus sign in front of zero
    return f"{rounded:{sign}.{digits}f} ± {margin:.{digits}f}"


def join_phrases(phrases: Iterable[str]) -> str:
    """Phrases in one, with commas and "and"."""
    *first, last = phrases
    return f"{', '.join(first)} and {last}" if first else last


def group_errors(errors: pd.DataFrame) -> str:
    """Which methods have a mean error of K above 5 %, and which have not, as far as the 95 % intervals tell."""
    size, margin = errors["error"].abs(), errors["margin"]
    groups = {f"Above {BIAS:g} %": size - margin > BIAS, f"Within {BIAS:g} %": size + margin <= BIAS}
    groups["Left open by the 95 % interval"] = ~np.logical_or(*groups.values())
    return _list_groups(groups, errors["label"])


def _list_groups(groups: Mapping[str, pd.Series], labels: pd.Series) -> str:
    """A sentence for each group that has members."""
    return " ".join(f"{name}: {'; '.join(labels[members])}." for name, members in groups.items() if members.any())


def list_errors(errors: pd.DataFrame) -> str:
    """Mean error of K of each method with half of its 95 % interval."""
    texts = (f"{row.label} {format_mean(row.error, row.margin, '+')} %" for row in errors.itertuples())
    return "; ".join(texts) + "."


def describe_growth(first: pd.DataFrame, last: pd.DataFrame) -> str:
    """How the size of the error of K changes from one point to another."""
    pairs = first.merge(last, on=["method", "label"], suffixes=("_first", "_last"))
    change = pairs["error_last"].abs() - pairs["error_first"].abs()
    margin = np.hypot(pairs["margin_first"], pairs["margin_last"])
    groups = {"grows for": change > margin, "falls for": change < -margin}
    groups["is not shown to change for"] = ~np.logical_or(*groups.values())
    texts = (f"{name}: {' / '.join(pairs['label'][members])}" for name, members in groups.items() if members.any())
    return f"its size {'; '.join(texts)}"


def compare_sizes(first: Mapping[str, Any], second: Mapping[str, Any]) -> str:
    """Whether the error of one method is smaller than that of another, on the same trials.

    The margins are added: this bounds the interval of the difference whatever the correlation of the two.
    """
    difference = abs(first["error"]) - abs(second["error"])
    if not abs(difference) > first["margin"] + second["margin"]:
        return "not shown to differ"
    return "smaller" if difference < 0 else "larger"


def describe_passes(table: pd.DataFrame) -> str:
    """After how many passes of the parallel cascade each torque is accurate, at each reflex gain."""
    gains = sorted(table["reflex_gain"].unique())
    texts = []
    for torque, rows in table.groupby("torque", sort=False):
        accurate = rows[rows["mean"] - mean_margin(rows["sd"], rows["n"]) >= ACCURATE]
        fewest = accurate.groupby("reflex_gain")["passes"].min().reindex(gains)
        most = rows.groupby("reflex_gain")["passes"].max()
        phrases = [
            f"{fewest[gain]:g} at gain {gain:g}" if pd.notna(fewest[gain]) else f"over {most[gain]:g} at gain {gain:g}"
            for gain in gains
        ]
        texts.append(f"{torque} torque {join_phrases(phrases)}")
    return (
        f"Passes until the mean VAF of a torque is {ACCURATE:g} % or more (lower end of its 95 % interval), among the "
        f"numbers of passes that were run: {'; '.join(texts)}."
    )


SCORES = {
    "the net VAF of the fitted record": "vaf_net_measured",
    "the net VAF of unseen halves": "unseen_cross_validation",
    "the instrumental VAF of unseen halves": "unseen_instrumental",
}


def describe_choice(table: pd.DataFrame) -> str:
    """How often each score that an experiment can show prefers the method with the best intrinsic torque."""
    levels = [rows for _, rows in table.groupby("voluntary")]
    texts = []
    for name, column in SCORES.items():
        pairs = [(_best(rows, column), _best(rows, "vaf_intrinsic_true")) for rows in levels]
        choices = [chosen == right for chosen, right in pairs if chosen and right]
        texts.append(f"by {name} {sum(choices)} of {len(choices)} times")
    return (
        f"Choice between {join_phrases(table['label'].unique())} at {len(levels)} levels of voluntary torque, as far "
        "as the highest mean of the score and that of the true intrinsic VAF both lead beyond the 95 % interval: the "
        f"method with the highest true VAF is chosen {'; '.join(texts)}."
    )


def _best(rows: pd.DataFrame, column: str) -> str | None:
    """Method with the highest mean; None if its lead is within the 95 % interval of the difference."""
    means, margins = mean_columns(rows, column)
    order = means.sort_values(ascending=False).index
    if len(order) < 2:
        return None
    first, second = order[:2]
    # Margins of means over the same trials are added, which bounds the interval in any correlation.
    return str(rows.loc[first, "method"]) if means[first] - means[second] > margins[first] + margins[second] else None
