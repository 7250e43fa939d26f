"""What leaving out a step of the processing costs, step by step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from ankleloop.paper.comparisons import format_mean
from ankleloop.paper.omissions import COMPLETE

TORQUES = {"vaf_net_measured": "net VAF", "vaf_intrinsic_true": "intrinsic VAF", "vaf_reflex_true": "reflex VAF"}


class _Cost(NamedTuple):
    """What a step costs in one quantity: positive where the result is worse without it."""

    value: float
    margin: float
    text: str

    @property
    def evident(self) -> bool:
        """Whether the 95 % interval lies above zero."""
        return self.value > self.margin


def describe_costs(table: pd.DataFrame, truths: Mapping[str, float]) -> list[str]:
    """A sentence for each step, the most expensive step first.

    A step costs points of VAF, or accuracy of K, B and I in % of the truth. Its sentence has the largest cost in each
    of them over methods and conditions, as far as it is beyond the 95 % interval; steps are in the order of the largest
    of all.
    """
    complete = table[table["omitted_step"] == COMPLETE].set_index(["condition", "method"])
    texts = []
    for step, rows in table[table["omitted_step"] != COMPLETE].groupby("omitted_step", sort=False):
        costs = [max(group, key=lambda cost: cost.value) for group in _group_costs(rows, complete, truths) if group]
        phrases = [cost.text for cost in sorted(costs, key=lambda cost: -cost.value)]
        phrases = phrases or ["costs nothing that this study can show"]
        failures = int(rows["failures"].sum())
        if failures:
            phrases.append(f"{failures} of {int(rows['trials'].sum())} identifications failed")
        largest = max((cost.value for cost in costs), default=0.0)
        texts.append((np.inf if failures else largest, f"**{step}**: {'; '.join(phrases)}."))
    return [text for _, text in sorted(texts, key=lambda pair: -pair[0])]


def _group_costs(rows: pd.DataFrame, complete: pd.DataFrame, truths: Mapping[str, float]) -> Iterator[list[_Cost]]:
    """Costs of a step beyond their 95 % intervals: a list for each quantity, over methods and conditions."""
    records = [(row, complete.loc[(row["condition"], row["method"])]) for _, row in rows.iterrows()]
    for name, label in TORQUES.items():
        costs = [_vaf_cost(row, name, label) for row, _ in records]
        yield [cost for cost in costs if cost.evident]
    for name, truth in truths.items():
        costs = [_accuracy_cost(row, reference, name, truth) for row, reference in records]
        yield [cost for cost in costs if cost.evident]


def _vaf_cost(row: pd.Series, name: str, label: str) -> _Cost:
    """Points of VAF that are lost."""
    value, margin = -row[f"{name}_cost"], row[f"{name}_cost_margin"]
    return _Cost(value, margin, f"{format_mean(value, margin)} points of {label} ({row['method']}, {row['condition']})")


def _accuracy_cost(row: pd.Series, reference: pd.Series, name: str, truth: float) -> _Cost:
    """Growth of the size of the mean error of a parameter [% of the truth]."""
    errors = [100 * (part[f"{name}_mean"] / truth - 1) for part in (row, reference)]
    if np.sign(errors[0]) == np.sign(errors[1]):
        margin = row[f"{name}_cost_margin"]
    else:  # not the interval of the change: bounded by the sum of both
        margin = row[f"{name}_margin"] + reference[f"{name}_margin"]
    margin = 100 * margin / truth
    value = abs(errors[0]) - abs(errors[1])
    text = f"the error of {name} grows by {format_mean(value, margin)} % to {errors[0]:+.1f} %"
    return _Cost(value, margin, f"{text} ({row['method']}, {row['condition']})")
