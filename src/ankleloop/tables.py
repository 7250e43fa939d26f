"""Tables: ours beside the published ones, as CSV for programs and as Markdown for people."""

from pathlib import Path

import pandas as pd

from ankleloop.evaluation import summarise
from ankleloop.storage import whole_file

__all__ = ["against_published", "readable", "write_table"]


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
        `n`.

    Examples
    --------
    >>> scores = pd.DataFrame({"method": "m", "torque": "net", "against": "true", "vaf": [90.0, 92.0]})
    >>> published = pd.DataFrame({"method": ["m"], "torque": ["net"], "against": ["true"], "paper": [93.0]})
    >>> against_published(scores, published, [])[["paper", "mean", "n"]].values.tolist()
    [[93.0, 91.0, 2.0]]
    """
    keys = ["method", "torque", "against"]
    table = summarise(scores, [*by, *keys]).merge(published, how="left", on=keys)
    return table[[*by, *keys, "paper", "mean", "sd", "n"]]


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

    shown = table.drop(columns=["paper", "mean", "sd", "n"]).assign(method=table["method"].map(labels))
    numbers = shown.select_dtypes("number").columns
    shown[numbers] = shown[numbers].map("{:g}".format).astype(object)
    shown["paper [%]"] = [number(value) for value in table["paper"]]
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
