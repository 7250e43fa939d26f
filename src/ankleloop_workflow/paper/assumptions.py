"""What rests on assumptions: claims on Table 1 at settings that are drawn at random.

At a setting a claim holds if the means over its trials are within what is accepted. A setting has too few trials for an
interval, and needs none: the settings are the sample.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import pandas as pd
from scipy import stats

from ankleloop_workflow.paper.checks import (
    CASCADE_CONVERGED,
    CASCADE_ONCE,
    DRAWN,
    VAF_COLUMNS,
    Case,
    StudyResults,
)
from ankleloop_workflow.paper.judgement import Mean

# Settings at which claims on Table 1 are judged, in the place of which those that are drawn come here.
TABLE1 = {"reflex_gain": 13, "voluntary": 0.05, "snr_db": 10}
NEAREST = 10  # settings that have most of the numbers of Table 1


def judge_settings(claims: pd.DataFrame, results: StudyResults) -> pd.DataFrame:
    """Whether each claim on Table 1 that these trials decide holds at each setting: a column for each claim.

    Settings at which a method failed in every trial are left out.
    """
    means = find_means(results)
    held = {}
    for claim in claims.itertuples():
        if claim.settings != TABLE1 or not claim.comparisons:
            continue
        with suppress(KeyError):  # of a method that the study does not have
            held[claim.id] = _judge(Case(claim, {}, pd.DataFrame()), means)
    return pd.DataFrame(held)


def find_means(results: StudyResults) -> pd.DataFrame:
    """Means over the trials of each setting, a column for each score and method, and the errors of K [%].

    The parallel cascade, whatever its passes, stands for the published one.
    """
    table = results.table
    point = table["point"].astype(str)
    method = table["method"].astype(str).replace({CASCADE_CONVERGED: CASCADE_ONCE})
    truth = point.map({name: settings["stiffness"] for name, settings in results.points.items()})
    scores = table[list(VAF_COLUMNS.values())].assign(K_error=100.0 * (table["K"] / truth - 1.0))
    return scores.groupby([point, method], sort=False).mean().unstack("method").dropna()


def _judge(case: Case, means: pd.DataFrame) -> pd.Series:
    """Whether all comparisons of a claim are accepted, at each setting."""
    is_held = pd.Series(True, means.index)
    for listed in case.claim.comparisons.values():
        difference = _find_mean(means, listed["mean"]) - listed.get("from", 0.0)
        if "less" in listed:
            difference -= _find_mean(means, listed["less"])
        low, high = case.find_accepted(listed)
        is_held &= difference.between(low, high)
    return is_held


def _find_mean(means: pd.DataFrame, text: str) -> pd.Series:
    """A mean as claims name it, by its quantity and method, behind the study."""
    *_, quantity, method = text.split()
    return means[VAF_COLUMNS.get(quantity, quantity), method]


def measure_assumptions(claims: pd.DataFrame, results: StudyResults) -> pd.DataFrame:
    """Shares [%] of the settings at which claims hold, and how many numbers of Table 1 the nearest settings have.

    Whoever searches for a setting finds one that suits his trials. So the nearest settings are chosen by every second
    trial, and their numbers are those of the other trials. The columns are those of
    `ankleloop_workflow.paper.economy.measure_economy`.
    """
    rows = []
    for claim, held in judge_settings(claims, results).items():
        low, high = stats.binomtest(held.sum(), held.size).proportion_ci(method="wilson")
        rows.append((f"{DRAWN}/{claim}", 100.0 * held.mean(), 100.0 * low, 100.0 * high))
    halves = results.table.groupby(results.table["trial"] % 2)
    chosen, fresh = (count_numbers(claims, replace(results, table=half)) for _, half in halves)
    nearest = Mean.of(fresh[chosen.nlargest(NEAREST).index])
    rows.append((f"{DRAWN}/nearest", nearest.value, *nearest.interval()))
    return pd.DataFrame(rows, columns=["quantity", "value", "low", "high"])


def count_numbers(claims: pd.DataFrame, results: StudyResults) -> pd.Series:
    """How many numbers of Table 1 hold at each setting."""
    return judge_settings(claims, results).filter(like="table1/").sum(axis=1)
