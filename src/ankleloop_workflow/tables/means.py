"""Means over trials with their intervals, and what came of the trials: how many a mean leaves out, or warn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from ankleloop.signals.vaf import confidence_margin

KEYS = ["point", "method", "trial"]  # of an estimate
COUNTS = ["trials", "failures", "warnings", "without G"]  # columns of every table of means
# Of the trials of a mean that failed or came with a warning, from which on figures mark it.
FAULT_SHARE = 0.05
STATISTICS = {"mean": "mean", "sd": "std", "n": "count"}  # by the functions of pandas


def means(
    table: pd.DataFrame,
    by: Sequence[str],
    quantities: Sequence[str],
    quantiles: Mapping[str, float] | None = None,
) -> pd.DataFrame:
    """Means of quantities over the trials of each group, and what they leave out.

    Parameters
    ----------
    table : pandas.DataFrame
        Trials: a row for each point, method and trial.
    by : sequence of str
        Columns whose values make a group; groups stand in the order of their first appearance.
    quantities : sequence of str
        Columns of numbers; of one that the table does not have no trial has a value.
    quantiles : mapping of str to float, optional
        Shares of the trials by the name of a column.

    Returns
    -------
    pandas.DataFrame
        A row for each group and `quantity`: `mean`, `sd`, `n` (trials with a value), `margin` (half of the 95 %
        interval of the mean), the quantiles, and `COUNTS`.

    Examples
    --------
    >>> trials = pd.DataFrame({"point": "p", "method": "riv", "trial": [0, 1], "K": [149.0, 151.0]})
    >>> means(trials, ["point", "method"], ["K"])[["quantity", "mean", "n", "trials", "failures"]].values.tolist()
    [['K', 150.0, 2, 2, 0]]
    """
    rows = measure_statistics(table, by, quantities, quantiles)
    return rows.merge(count_outcomes(table, by), how="left", on=list(by))


def measure_statistics(
    table: pd.DataFrame,
    by: Sequence[str],
    quantities: Sequence[str],
    quantiles: Mapping[str, float] | None = None,
) -> pd.DataFrame:
    """Mean, standard deviation, number, margin and quantiles of each quantity in each group, as `means` has them."""
    numbers = table.reindex(columns=[*by, *quantities]).astype(dict.fromkeys(quantities, float))
    groups = group_rows(numbers, by)[list(quantities)]
    parts = {name: getattr(groups, function)() for name, function in STATISTICS.items()}
    parts["margin"] = confidence_margin(parts["sd"], parts["n"])
    parts |= {name: groups.quantile(share) for name, share in (quantiles or {}).items()}
    rows = pd.concat(parts, axis="columns").stack(level=1, future_stack=True)
    return rows.rename_axis([*by, "quantity"]).reset_index().astype({"n": int})


def count_outcomes(table: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Count the trials that a mean is over, those that it leaves out, and those with a warning, which it counts.

    A trial that several methods identify is one trial: it failed where one of them failed.
    """
    keys = list(dict.fromkeys([*by, "point", "trial"]))
    faults = table[keys].assign(**list_faults(table))
    gains = table.get("G", pd.Series(0.0, table.index))
    faults["without G"] = gains.isna() & ~faults["failures"]
    trials = group_rows(faults, keys).any().reset_index().assign(trials=1)
    return group_rows(trials, by)[COUNTS].sum().reset_index()


def group_rows(table: pd.DataFrame, by: Sequence[str]) -> Any:
    """Groups of rows in the order of their first appearance; an empty value makes a group, too."""
    return table.groupby(list(by), sort=False, dropna=False, observed=True)


def list_faults(table: pd.DataFrame) -> pd.DataFrame:
    """Whether each identification failed, and whether its estimate came with a warning; such an estimate counts."""
    if "failed" in table:  # of rows that are made of those of other tables
        return table[["failed", "warned"]].set_axis(["failures", "warnings"], axis="columns")
    texts = table.reindex(columns=["failure", "warnings"])
    failed = texts["failure"].notna()
    warned = texts["warnings"].notna() & (texts["warnings"] != "") & ~failed
    return pd.DataFrame({"failures": failed, "warnings": warned})


def mark_faults(rows: pd.DataFrame) -> pd.Series:
    """Whether so many trials of a mean failed or came with a warning that figures mark it."""
    return _fault_share(rows) >= FAULT_SHARE


def mark_more_faults(rows: pd.DataFrame, by: Sequence[str]) -> pd.Series:
    """Whether a mean has so many more faults than the median of its group, a curve, that figures mark it."""
    share = _fault_share(rows)
    usual = share.groupby([rows[name] for name in by]).transform("median")
    return share - usual >= FAULT_SHARE


def _fault_share(rows: pd.DataFrame) -> pd.Series:
    """Share of the trials of each mean that failed or came with a warning."""
    return rows[["failures", "warnings"]].sum(axis=1) / rows["trials"]


def widen(rows: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Means with a row for each group, and columns NAME_mean, NAME_std, NAME_count of each quantity."""
    keys = list(by)
    groups = rows.drop_duplicates(keys, ignore_index=True)
    table = groups[keys]
    for name, part in rows.groupby("quantity", sort=False):
        numbers = part[list(STATISTICS)].rename(columns=STATISTICS).reset_index(drop=True)
        table = table.join(numbers.add_prefix(f"{name}_"))
    return table.join(groups[COUNTS])


def mean_scores(table: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Means of each VAF over trials, a row for each torque and what it is scored against."""
    rows = means(table, by, [name for name in table if name.startswith("vaf_")])
    words = rows["quantity"].str.extract("vaf_(?P<torque>.*)_(?P<against>.*)")
    return rows.join(words)[[*by, "torque", "against", *STATISTICS, "margin", *COUNTS]]


def curve_means(
    table: pd.DataFrame, columns: Mapping[str, str], x: str = "x", by: Sequence[str] = ()
) -> pd.DataFrame:
    """Means as figures take them: a panel for each of some columns, over `x`, for each `series` of a table of trials.

    `columns` are the quantities by panel, `by` further columns that make groups.
    """
    keys = [*by, "series", x]
    panels = pd.DataFrame({"panel": list(columns), "quantity": list(columns.values())})
    quantities = list(dict.fromkeys(columns.values()))
    rows = panels.merge(means(table, keys, quantities), on="quantity")
    shown = rows[[*by, "panel", "series"]].assign(
        x=rows[x],
        value=rows["mean"],
        low=rows["mean"] - rows["margin"],
        high=rows["mean"] + rows["margin"],
        trials=rows["n"],
        marked=mark_more_faults(rows, [*by, "panel", "series"]),
        failed=rows["failures"] == rows["trials"],
        number=pd.factorize(rows["series"])[0],
    )
    return shown.sort_values(["number", "x"]).drop(columns="number")
