"""Results of the reduced configuration, and how much of a difference matters.

Seeds are fixed, so the same code gives the same numbers but for rounding. A difference matters from a quarter of the
standard error of the mean on: other seeds would do four times as much. The spread over trials is measured, and kept
beside each number.
"""

import numpy as np

from ankleloop_workflow.tables.trial_tables import read_results

SHARE = 0.25  # of the standard error
LEAST = 1e-4  # of the number itself: rounding in other builds of linear algebra
KEY = ["point", "method", "quantity"]


def summarise_results(results, study):
    """Mean, spread and number of trials of every VAF, and of K, B, I and G, of a study."""
    details = read_results(results / "tables" / f"{study}-trials.parquet")
    names = [name for name in details if name.startswith("vaf_") or name in ("K", "B", "I", "G")]
    everything = details.melt(["point", "method", "trial"], names, "quantity", "value").dropna(
        subset="value"
    )
    everything["quantity"] = everything["quantity"].str.replace(
        r"vaf_(\w+)_(\w+)", r"VAF \1 (\2)", regex=True
    )
    table = (
        everything.groupby(KEY, sort=False)["value"]
        .agg(mean="mean", sd="std", n="count")
        .reset_index()
    )
    table = table[table["n"] > 1].reset_index(drop=True)  # one trial that has a G has no spread
    standard_error = table["sd"].fillna(0.0) / np.sqrt(table["n"])
    return table.assign(tolerance=np.maximum(SHARE * standard_error, LEAST * table["mean"].abs()))


def list_differences(expected, results):
    """Rows that are missing, new, or further from the expected mean than its tolerance."""
    merged = expected.merge(results, on=KEY, how="outer", suffixes=("", "_result"), indicator=True)
    difference = merged["mean_result"] - merged["mean"]
    changed = merged[(merged["_merge"] != "both") | (difference.abs() > merged["tolerance"])]
    return changed[KEY].assign(
        expected=changed["mean"],
        result=changed["mean_result"],
        difference=difference[changed.index],
        tolerance=changed["tolerance"],
    )
