"""A sweep as its report shows it: its trials, what of them is shown, and summaries over trials."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import Any

import pandas as pd

from ankleloop.errors import DataError
from ankleloop.paper.results import CONDITIONS, SETTINGS, true_values
from ankleloop.paper.sweep_quantities import (
    FAULT_SHARES,
    SWEEP_QUANTITIES,
    default_quantities,
    desired_value,
    error_source,
    label_parameter,
)
from ankleloop.paper.trial_counts import COUNTS, list_faults
from ankleloop.paper.trial_tables import read_trial_table, trial_table_columns
from ankleloop.plotting.style import method_styles
from ankleloop.plotting.sweeps import MOST_LISTED, SweepAxis, SweepPanel, SweepSeries
from ankleloop.signals.vaf import confidence_margin
from ankleloop.simulation.settings import SimulationSettings

MOST_COLUMNS = 8  # parameters over which lines are drawn
QUANTILES = {"low": 0.1, "median": 0.5, "high": 0.9}  # between the outer ones are 80 % of the trials
TRIAL = ["point", "trial"]
STATISTICS = ["mean", "sd", "n", "margin", *QUANTILES]


@dataclass(frozen=True)
class SweepStudy:
    """A sweep as its report shows it.

    Parameters
    ----------
    trials : pandas.DataFrame
        A row for each point, method and trial, with the quantities, and whether the trial `failed` or `warned`.
    parameters : tuple of SweepAxis
        Parameters with more than one value.
    axes : tuple of SweepAxis
        Those that pictures are drawn over.
    quantities, absent : list of str
        Quantities that are shown, and those that the configuration names and the table does not have.
    methods : dict of str to str
        Label of each method of the study.
    settings : dict
        Fields of `ankleloop.studies.config.SweepSettings`.
    simulation : dict
        Settings of the simulation that all points share.
    algorithms : dict of str to str
        Name of each method in the registry; methods that are left out are those of their own name.

    Examples
    --------
    >>> import tempfile
    >>> import pandas as pd
    >>> from ankleloop.simulation.settings import SimulationSettings
    >>> from ankleloop.studies.config import SweepSettings
    >>> table = pd.DataFrame(
    ...     [
    ...         {"study": "s", "point": f"G={gain}", "reflex_gain": gain, "method": "riv", "trial": trial}
    ...         | {"vaf_net_true": 99.0, "failure": None, "warnings": ""}
    ...         for gain in (5.0, 10.0)
    ...         for trial in range(2)
    ...     ]
    ... )
    >>> shown = SweepSettings(quantities=["vaf_net_true"]).model_dump()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table.to_parquet(f"{folder}/s-trials.parquet")
    ...     sweep = SweepStudy.read(
    ...         f"{folder}/s-trials.parquet", ["reflex_gain"], {"riv": "RIV"}, shown, SimulationSettings.defaults()
    ...     )
    >>> [axis.name for axis in sweep.axes], len(sweep.trials)
    (['reflex_gain'], 4)
    """

    trials: pd.DataFrame
    parameters: tuple[SweepAxis, ...]
    axes: tuple[SweepAxis, ...]
    quantities: list[str]
    absent: list[str]
    methods: Mapping[str, str]
    settings: Mapping[str, Any]
    simulation: Mapping[str, Any]
    algorithms: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def read(
        cls,
        path: str | PathLike[str],
        varied: Sequence[str],
        methods: Mapping[str, str],
        settings: Mapping[str, Any],
        simulation: Mapping[str, Any],
        algorithms: Mapping[str, str] | None = None,
    ) -> SweepStudy:
        """Read the table of trials of a study, whose parameters are the columns `varied`."""
        columns = trial_table_columns(path)
        wanted = list(settings["quantities"] or default_quantities(columns))
        quantities = [name for name in wanted if name in FAULT_SHARES or (error_source(name) or name) in columns]
        needed = {*(settings["methods"] or methods), *(settings["difference"] or ())}
        trials = read_sweep(path, varied, quantities, simulation, [name for name in methods if name in needed])
        points = trials.drop_duplicates("point")
        axes = {
            name: SweepAxis.of(name, label_parameter(name, methods), points[name], CONDITIONS.get(name))
            for name in varied
        }
        parameters = tuple(axis for axis in axes.values() if len(axis.values) > 1)
        drawn = tuple(axes[name] for name in settings["axes"] or ()) or parameters[:MOST_COLUMNS]
        shown = [name for name in quantities if trials[name].notna().any()]
        if not shown:
            raise DataError(f"{path}: no method has a value of {', '.join(wanted)}: name other quantities under sweep.")
        absent = [name for name in wanted if name not in shown]
        drawn = drawn or tuple(axes.values())[:1]
        return cls(trials, parameters, drawn, shown, absent, methods, settings, simulation, algorithms or {})

    @cached_property
    def series(self) -> list[SweepSeries]:
        """Methods that are shown; each keeps its style whichever of the others are."""
        shown = self.settings["methods"] or self.methods
        styles = method_styles({name: self.algorithms.get(name, name) for name in self.methods})
        return [SweepSeries(name, label, styles[name]) for name, label in self.methods.items() if name in shown]

    @cached_property
    def difference(self) -> SweepSeries | None:
        """The difference of two methods, where it is to be shown."""
        if not self.settings["difference"]:
            return None
        first, second = self.settings["difference"]
        label = f"{self.methods[first]} − {self.methods[second]}"
        return SweepSeries(f"{first} − {second}", label, is_difference=True)

    @cached_property
    def shown_trials(self) -> pd.DataFrame:
        """Trials of the methods that are shown, and differences of methods behind them."""
        shown = self.trials[self.trials["method"].isin([item.method for item in self.series])]
        if not self.settings["difference"]:
            return shown
        first, second = self.settings["difference"]
        paired = [name for name in self.quantities if name not in FAULT_SHARES]
        return pd.concat([shown, pair_methods(self.trials, first, second, paired)], ignore_index=True)

    @cached_property
    def panels(self) -> list[SweepPanel]:
        """Quantities of the methods that are shown and, behind each, of the difference."""
        varied = {axis.name for axis in self.parameters}
        panels = []
        for name in self.quantities:
            quantity, marked = SWEEP_QUANTITIES[name], name not in FAULT_SHARES
            truth = None  # of a parameter that all points share
            if name in SETTINGS and SETTINGS[name] not in varied:
                truth = true_values(self.simulation, [name])[name]
            panels.append(SweepPanel(name, quantity.label, self.series, desired_value(name), truth, marked))
            if self.difference and marked:
                label = f"Δ {quantity.symbol} [{'points' if quantity.unit == '%' else quantity.unit}]"
                panels.append(SweepPanel(name, label, [self.difference], "zero"))
        return panels

    def summarise(self) -> pd.DataFrame:
        """Means over trials of each point and method, as `summarise_sweep`."""
        by = ["point", *(axis.name for axis in self.parameters), "method"]
        return summarise_sweep(self.shown_trials, by, self.quantities)


def read_sweep(
    path: str | PathLike[str],
    varied: Sequence[str],
    quantities: Sequence[str],
    simulation: Mapping[str, Any],
    methods: Collection[str] | None = None,
) -> pd.DataFrame:
    """Read what pictures of a sweep need of a table of trials; errors are relative to the truth of each point."""
    columns = trial_table_columns(path)
    missing = [name for name in (*TRIAL, "method", *varied) if name not in columns]
    if missing:
        raise DataError(f"{path}: the table has no column {missing[0]!r}: delete it, and run again: it is made anew.")
    # Where the points of a sweep have a value of the same name, the estimate has another column.
    names = {name: error_source(name) or name for name in quantities if name not in FAULT_SHARES}
    sources = {key: f"{name}_estimated" if f"{name}_estimated" in columns else name for key, name in names.items()}
    truths = [SETTINGS[name] for key, name in names.items() if name != key and SETTINGS[name] in columns]
    texts = [name for name in ("failure", "warnings") if name in columns]
    wanted = [*TRIAL, "method", *varied, *texts, *sources.values(), *truths]
    table = read_trial_table(path, columns=list(dict.fromkeys(wanted)))
    if methods is not None:
        table = table[table["method"].isin(list(methods))]
    if table.empty:
        raise DataError(f"{path}: the table has no trial of {', '.join(methods or ('any method',))}.")
    faults = list_faults(table)
    parts = {name: table[name] for name in (*TRIAL, *varied, "method")}
    for name in quantities:
        if name in FAULT_SHARES:
            parts[name] = 100.0 * faults[name]
            continue
        parts[name] = table[sources[name]].astype(float)
        if names[name] != name:  # an error [%], which does not exist where the truth is 0
            setting = SETTINGS[names[name]]
            truth = pd.Series(table.get(setting, simulation.get(setting)), table.index).astype(float)
            parts[name] = 100.0 * (parts[name] / truth.where(truth != 0) - 1.0)
    return pd.DataFrame({**parts, "failed": faults["failures"], "warned": faults["warnings"]}).reset_index(drop=True)


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
        table = groups[name].agg(mean="mean", sd="std", n="count")
        table["margin"] = confidence_margin(table["sd"], table["n"])
        for column, level in QUANTILES.items():
            table[column] = groups[name].quantile(level)
        tables.append(pd.concat([table, counts], axis=1).reset_index().assign(quantity=name))
    return pd.concat(tables, ignore_index=True)[[*by, "quantity", *STATISTICS, *counts]]


def _group(table: pd.DataFrame, by: Sequence[str]) -> Any:
    """Groups of rows in the order of their first appearance; an empty value makes a group, too."""
    return table.groupby(list(by), sort=False, dropna=False, observed=True)


def summarise_effects(
    trials: pd.DataFrame, axis: SweepAxis, quantities: Sequence[str], *, most: int = MOST_LISTED, bins: int = 10
) -> pd.DataFrame:
    """Means over all trials of the same value of a parameter, or of a bin of values, whatever the others are.

    The interval of a mean is that over conditions, since trials of one condition (the simulated settings of a point)
    share it, and points that differ in options alone share their trials, too. Where a value has a single condition, it
    is over the trials of that condition.
    """
    settings = [name for name in SimulationSettings.model_fields if name in trials]
    condition = _group(trials, settings).ngroup() if settings else 0
    value = axis.bin(trials[axis.name], most, bins)
    table = trials.assign(parameter=axis.name, value=value, condition=condition)
    by = ["parameter", "value", "method"]
    several = _group(table, by)["condition"].transform("nunique") > 1
    table["unit"] = table["condition"].where(several, table["trial"])
    units = _group(table, [*by, "unit"])[list(quantities)].mean().reset_index().assign(failed=False, warned=False)
    own = ["mean", "sd", "n", "margin"]
    means = summarise_sweep(units, by, quantities)[[*by, "quantity", *own]]
    return summarise_sweep(table, by, quantities).drop(columns=own).merge(means, on=[*by, "quantity"], how="left")


def widen_summary(summary: pd.DataFrame) -> pd.DataFrame:
    """A summary with the statistics of all quantities in one row."""
    quantities = list(dict.fromkeys(summary["quantity"]))
    parts = [summary[summary["quantity"] == name].reset_index(drop=True) for name in quantities]
    shared = parts[0].drop(columns=["quantity", *STATISTICS])
    counts = [name for name in COUNTS if name in shared]
    columns = {f"{name}_{key}": part[key] for name, part in zip(quantities, parts, strict=True) for key in STATISTICS}
    return pd.concat([shared.drop(columns=counts), pd.DataFrame(columns), shared[counts]], axis=1)
