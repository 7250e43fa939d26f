"""Whether the tables of a study hold every trial: a file that was cut off would give other means in silence."""

from __future__ import annotations

import itertools
import os
from collections.abc import Collection, Sequence

import pandas as pd

from ankleloop.errors import DataError
from ankleloop.paper.results import KEYS, read_results

PathLike = str | os.PathLike[str]
SCORE = ["torque", "against"]


def check_study(
    parameters: Sequence[PathLike],
    scores: Sequence[PathLike],
    points: Collection[str],
    methods: Collection[str],
    trials: int | None = None,
) -> None:
    """Refuse tables of a simulated study in which rows are missing, or in which nothing was identified."""
    tables = [read_results([path]) for path in parameters]
    for table, path in zip(tables, scores, strict=True):
        check_scores(path, read_results([path]), table)
    table = pd.concat(tables, ignore_index=True)
    counts = table.groupby(["point", "method"]).size()
    expected = trials or int(counts.max())
    for point, method in itertools.product(points, methods):
        count = counts.get((point, method), 0)
        if count != expected:
            files = " … ".join(dict.fromkeys([str(parameters[0]), str(parameters[-1])]))
            raise DataError(
                f"{files}: point {point}, method {method} has {count} of {expected} trials: delete these files, and "
                "run again: they are made anew."
            )
    if "failure" in table and table["failure"].notna().all():
        raise DataError(
            "no trial of the study could be identified by any method; the most frequent reason: "
            f"{table['failure'].value_counts().index[0]}"
        )


def check_scores(path: PathLike, scores: pd.DataFrame, parameters: pd.DataFrame) -> None:
    """Refuse tables of a chunk in which an estimate lacks a score that estimates of its point have."""
    estimates = parameters[parameters["failure"].isna()] if "failure" in parameters else parameters
    expected = scores[["point", *SCORE]].drop_duplicates()
    keys = estimates[KEYS].merge(expected, how="left", on="point")
    merged = keys.merge(scores[[*KEYS, *SCORE]], how="left", on=[*KEYS, *SCORE], indicator=True)
    missing = merged[(merged["_merge"] == "left_only") | merged["torque"].isna()]
    if len(missing):
        row = missing.iloc[0]
        raise DataError(
            f"{path}: point {row['point']}, method {row['method']}, trial {row['trial']}: a score is missing: delete "
            "the file, and run again: it is made anew."
        )
