"""Tables for people, as CSV."""

from __future__ import annotations

import os
from typing import Any

import pandas as pd

from ankleloop.trials.files import atomic_file

FORMULA = ("=", "+", "-", "@")  # with which a spreadsheet begins a formula


def write_csv(table: pd.DataFrame, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write a table; text in it that begins like a formula gets a quote in front."""
    with atomic_file(path, overwrite=overwrite) as partial:
        quote_formulas(table).to_csv(partial, index=False, lineterminator="\n")


def quote_formulas(table: pd.DataFrame) -> pd.DataFrame:
    """A table with a quote in front of text that a spreadsheet would take for a formula."""
    texts = table.select_dtypes(exclude=["number", "bool"]).columns
    return table.assign(**{name: table[name].map(_quote) for name in texts})


def _quote(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value
