"""Tables: ours beside the published ones, as CSV for programs and as Markdown for people."""

from pathlib import Path

import numpy as np
import pandas as pd

from ankleloop.assessment.scores import summarise
from ankleloop.records.files import whole_file

__all__ = ["against_published", "efficiency", "readable", "write_table"]


def against_published(scores, published, by):
    """Mean and standard deviation over trials beside the published numbers.

    Parameters
    ----------
    scores : pandas.DataFrame
        Tables of `evaluate` with columns `method` and those of `by`.
    published : pandas.DataFrame
        Columns `method`, `torque`, `against`, `paper`.
    by : sequence of str
        Columns that tell the points apart.

    Returns
    -------
    pandas.DataFrame
        Columns `by`, `method`, `torque`, `against`, `paper` (empty where the paper has no such number), `mean`, `sd`,
        `n`; and where there is a single trial of each, `low` and `high`, the 95 % interval of its VAF.

    Examples
    --------
    >>> scores = pd.DataFrame({"method": "m", "torque": "net", "against": "true", "vaf": [90.0, 92.0]})
    >>> published = pd.DataFrame({"method": ["m"], "torque": ["net"], "against": ["true"], "paper": [93.0]})
    >>> against_published(scores, published, [])[["paper", "mean", "n"]].values.tolist()
    [[93.0, 91.0, 2.0]]
    """
    keys = ["method", "torque", "against"]
    table = summarise(scores, [*by, *keys]).merge(published, how="left", on=keys)
    columns = [*by, *keys, "paper", "mean", "sd", "n"]
    if "low" in scores and (table["n"] == 1).all():  # one record each: no spread over trials, but an interval
        table = table.merge(scores[[*by, *keys, "low", "high"]], on=[*by, *keys])
        columns += ["low", "high"]
    return table[columns]


def efficiency(details, truths, bounds):
    """Errors of estimated parameters over trials, beside the Cramér-Rao bound.

    Parameters
    ----------
    details : pandas.DataFrame
        Rows of `ankleloop.assessment.scores.parameters` with columns `point` and `method`.
    truths : dict of str to dict of str to float
        For each point the true parameters.
    bounds : dict of tuple to dict of str to float
        For each point and method the smallest standard deviation of each of them.

    Returns
    -------
    pandas.DataFrame
        One row for each point, method and parameter that the method gives: `truth`, `mean`, `bias`, `sd`, `rmse`,
        `n`, `bound`, `ratio` (rmse over bound), and `covered`, the share [%] of 95 % intervals that hold the truth,
        where there are intervals.

    Examples
    --------
    >>> details = pd.DataFrame({"point": "p", "method": "m", "K": [149.0, 151.0], "K_low": 150.5, "K_high": 153.0})
    >>> row = efficiency(details, {"p": {"K": 150.0}}, {("p", "m"): {"K": 0.5}}).iloc[0]
    >>> float(row["rmse"]), float(row["ratio"]), float(row["covered"])
    (1.0, 2.0, 0.0)
    """
    rows = []
    for (point, method), part in details.groupby(["point", "method"], sort=False):
        for name, truth in truths[point].items():
            if name not in part or part[name].isna().all():
                continue
            found = part[name].to_numpy()
            rmse = float(np.sqrt(np.mean((found - truth) ** 2)))
            bound = bounds[point, method].get(name, np.nan)
            row = {"point": point, "method": method, "parameter": name, "truth": truth, "mean": found.mean()}
            row |= {"bias": found.mean() - truth, "sd": np.std(found, ddof=1), "rmse": rmse, "n": found.size}
            row |= {"bound": bound, "ratio": rmse / bound, "covered": _covered(part, name, truth)}
            rows.append(row)
    return pd.DataFrame(rows)


def _covered(part, name, truth):
    """Share of the intervals that hold the truth [%]."""
    if f"{name}_low" not in part or part[f"{name}_low"].isna().all():
        return np.nan
    return float(100.0 * ((part[f"{name}_low"] <= truth) & (truth <= part[f"{name}_high"])).mean())


def readable(table, labels, decimals=1):
    """A table as people read it: labels for methods, mean ± sd, difference to the paper.

    Parameters
    ----------
    table : pandas.DataFrame
        A table of `against_published`.
    labels : dict of str to str
        Label of each method.
    decimals : int
        Decimals of VAF.

    Returns
    -------
    pandas.DataFrame
        All cells are text; what does not exist is a dash.
    """

    def number(value, sign=""):
        return "–" if pd.isna(value) else f"{value:{sign}.{decimals}f}"

    numbers = [name for name in ("paper", "mean", "sd", "n", "low", "high") if name in table]
    shown = table.drop(columns=numbers).assign(method=table["method"].map(labels))
    numbers = shown.select_dtypes("number").columns
    shown[numbers] = shown[numbers].map("{:g}".format).astype(object)
    shown["paper [%]"] = [number(value) for value in table["paper"]]
    if "low" in table:
        shown["ours [%], 95 % interval"] = [
            f"{number(row.mean)} ({number(row.low)} … {number(row.high)})" for row in table.itertuples()
        ]
    else:
        shown["ours [%], mean ± sd"] = [
            number(mean) + (f" ± {sd:.{decimals + 1}f}" if pd.notna(sd) else "")
            for mean, sd in zip(table["mean"], table["sd"], strict=True)
        ]
    shown["difference [points]"] = [number(value, "+") for value in table["mean"] - table["paper"]]
    shown["trials"] = table["n"].astype(str)
    return shown


def write_table(table, stem, shown=None, caption=""):
    """Write a table as CSV, and as Markdown with its caption.

    Parameters
    ----------
    table : pandas.DataFrame
        What the CSV holds.
    stem : path-like
        Path without its ending.
    shown : pandas.DataFrame, optional
        What the Markdown shows; the table itself by default.
    caption : str
        Text below the Markdown table.
    """
    stem = Path(stem)
    shown = table if shown is None else shown
    with whole_file(stem.with_name(stem.name + ".csv")) as path:
        table.to_csv(path, index=False)
    with whole_file(stem.with_name(stem.name + ".md")) as path:
        path.write_text(f"{shown.to_markdown(index=False)}\n\n{caption}\n", encoding="utf-8")
