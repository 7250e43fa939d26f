"""Summaries of a sweep over trials: means with their spread, differences of methods, effects of single parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from os import PathLike
from typing import Any

import pandas as pd

from ankleloop.errors import DataError
from ankleloop.paper.results import SETTINGS
from ankleloop.paper.sweep_quantities import FAULT_SHARES, error_source
from ankleloop.paper.trial_counts import COUNTS, list_faults
from ankleloop.paper.trial_tables import read_trial_table, trial_table_columns
from ankleloop.plotting.sweep_axes import MOST_LISTED, SweepAxis
from ankleloop.signals.vaf import confidence_margin
from ankleloop.simulation.settings import SimulationSettings

QUANTILES = {"low": 0.1, "median": 0.5, "high": 0.9}  # between the outer ones are 80 % of the trials
TRIAL = ["point", "trial"]
STATISTICS = ["mean", "sd", "n", "margin", *QUANTILES]


def available_quantities(quantities: Sequence[str], columns: Collection[str]) -> list[str]:
    """Quantities for which a table of trials has columns."""
    return [name for name in quantities if name in FAULT_SHARES or (error_source(name) or name) in columns]


def read_sweep(
    path: str | PathLike[str],
    varied: Sequence[str],
    quantities: Sequence[str],
    settings: Mapping[str, Any],
    methods: Collection[str] | None = None,
) -> pd.DataFrame:
    """Read what pictures of a sweep need of a table of trials; errors are relative to the truth of each point."""
    columns = trial_table_columns(path)
    missing = [name for name in (*TRIAL, "method", *varied) if name not in columns]
    if missing:
        raise DataError(f"{path}: the table has no column {missing[0]!r}: delete it, and run again: it is made anew.")
    sources = {name: _source_column(name, columns) for name in available_quantities(quantities, columns)}
    texts = [name for name in ("failure", "warnings") if name in columns]
    wanted = [*TRIAL, "method", *varied, *texts, *(name for name in sources.values() if name)]
    table = read_trial_table(path, columns=list(dict.fromkeys(wanted)))
    if methods is not None:
        table = table[table["method"].isin(list(methods))]
    if table.empty:
        raise DataError(f"{path}: the table has no trial of {', '.join(methods or ('any method',))}.")
    faults = list_faults(table)
    parts = {name: table[name] for name in (*TRIAL, *varied, "method")}
    parts |= {name: _quantity(table, name, source, settings) for name, source in sources.items() if source}
    parts |= {name: 100.0 * faults[name] for name, source in sources.items() if not source}
    return pd.DataFrame({**parts, "failed": faults["failures"], "warned": faults["warnings"]}).reset_index(drop=True)


def _source_column(quantity: str, columns: Collection[str]) -> str:
    """Column of the table that a quantity is made of, empty for a share of faults.

    Where the points of a sweep have a value of the same name, the estimate has another column.
    """
    if quantity in FAULT_SHARES:
        return ""
    name = error_source(quantity) or quantity
    return f"{name}_estimated" if f"{name}_estimated" in columns else name


def _quantity(table: pd.DataFrame, quantity: str, source: str, settings: Mapping[str, Any]) -> pd.Series:
    """A quantity of each trial; an error [%] does not exist where the truth is 0."""
    values = table[source].astype(float)
    name = error_source(quantity)
    if name is None:
        return values
    setting = SETTINGS[name]
    truth = table[setting].astype(float) if setting in table else pd.Series(float(settings[setting]), table.index)
    return 100.0 * (values / truth.where(truth != 0) - 1.0)


def pair_methods(trials: pd.DataFrame, first: str, second: str, quantities: Sequence[str]) -> pd.DataFrame:
    """Differences of two methods, trial by trial: both have identified the same record."""
    parts = []
    for method in (first, second):
        part = trials[trials["method"] == method]
        if part.duplicated(TRIAL).any():
            row = part[part.duplicated(TRIAL)].iloc[0]
            raise DataError(f"{method}, point {row['point']}: the table has the trial {row['trial']} twice.")
        parts.append(part.set_index(TRIAL))
    if len(parts[0]) != len(parts[1]) or not parts[0].index.isin(parts[1].index).all():
        raise DataError(f"the methods {first} and {second} have different trials: there are no differences of them.")
    own, other = parts[0], parts[1].reindex(parts[0].index)
    table = own.assign(method=f"{first} − {second}", **{name: own[name] - other[name] for name in quantities})
    failed = own["failed"] | other["failed"]
    warned = (own["warned"] | other["warned"]) & ~failed
    return table.assign(failed=failed, warned=warned).reset_index()[list(trials.columns)]


def summarise_sweep(trials: pd.DataFrame, by: Sequence[str], quantities: Sequence[str]) -> pd.DataFrame:
    """Means over trials with their spread, and what the means leave out."""
    groups = _group(trials, by)
    counts = groups.agg(trials=("failed", "size"), failures=("failed", "sum"), warnings=("warned", "sum"))
    tables = []
    for name in quantities:
        values = groups[name]
        table = values.agg(mean="mean", sd="std", n="count")
        table["margin"] = confidence_margin(table["sd"], table["n"])
        for column, level in QUANTILES.items():
            table[column] = values.quantile(level)
        tables.append(pd.concat([table, counts], axis=1).reset_index().assign(quantity=name))
    return pd.concat(tables, ignore_index=True)[[*by, "quantity", *STATISTICS, *counts]]


def _group(table: pd.DataFrame, by: Sequence[str]) -> Any:
    """Groups of rows in the order of their first appearance; an empty value makes a group, too."""
    return table.groupby(list(by), sort=False, dropna=False, observed=True)


def summarise_effects(
    trials: pd.DataFrame, axis: SweepAxis, quantities: Sequence[str], *, bins: int = 10, most: int = MOST_LISTED
) -> pd.DataFrame:
    """Means over all trials of the same value of a parameter, or of a bin of values, whatever the others are.

    The interval of a mean is that over conditions, since trials of one condition (the simulated settings of a point)
    share it, and points that differ in options alone share their trials, too. Where a value has a single condition, it
    is over the trials of that condition.
    """
    settings = [name for name in SimulationSettings.model_fields if name in trials]
    condition = _group(trials, settings).ngroup() if settings else 0
    place = axis.bin(trials[axis.name], bins, most)[0]
    table = trials.assign(parameter=axis.name, place=place, condition=condition)
    by = ["parameter", "place", "method"]
    summary = summarise_sweep(table, by, quantities)
    units = _unit_means(table, by, quantities)
    return summary.drop(columns=["mean", "sd", "n", "margin"]).merge(units, on=[*by, "quantity"], how="left")


def _unit_means(table: pd.DataFrame, by: Sequence[str], quantities: Sequence[str]) -> pd.DataFrame:
    """Mean over conditions, or over trials where there is one condition, with its interval."""
    several = _group(table, by)["condition"].transform("nunique") > 1
    table = table.assign(unit=table["condition"].where(several, table["trial"]))
    units = _group(table, [*by, "unit"])[list(quantities)].mean().reset_index()
    units = units.assign(failed=False, warned=False)
    return summarise_sweep(units, by, quantities)[[*by, "quantity", "mean", "sd", "n", "margin"]]


def widen_summary(summary: pd.DataFrame) -> pd.DataFrame:
    """A summary with the statistics of all quantities in one row."""
    quantities = list(dict.fromkeys(summary["quantity"]))
    parts = [summary[summary["quantity"] == name].reset_index(drop=True) for name in quantities]
    shared = parts[0].drop(columns=["quantity", *STATISTICS])
    counts = [name for name in COUNTS if name in shared]
    columns = {f"{name}_{key}": part[key] for name, part in zip(quantities, parts, strict=True) for key in STATISTICS}
    return pd.concat([shared.drop(columns=counts), pd.DataFrame(columns), shared[counts]], axis=1)
