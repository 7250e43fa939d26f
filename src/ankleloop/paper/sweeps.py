"""A sweep as its report shows it: summaries over its trials, pictures with their captions, best and worst points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ankleloop.errors import DataError
from ankleloop.paper.results import CONDITIONS, SETTINGS, list_faults, true_values
from ankleloop.paper.sweep_quantities import (
    FAULT_SHARES,
    SWEEP_QUANTITIES,
    default_quantities,
    desired_value,
    error_source,
    label_parameter,
)
from ankleloop.paper.tables import format_pairs
from ankleloop.paper.trial_tables import read_trial_table, trial_table_columns
from ankleloop.plotting.style import method_styles
from ankleloop.plotting.sweeps import (
    FAULT_SHARE,
    MOST_LISTED,
    SweepAxis,
    SweepPanel,
    SweepSeries,
    lines_figure,
    maps_figure,
)
from ankleloop.signals.vaf import confidence_margin
from ankleloop.simulation.settings import SimulationSettings

MOST_COLUMNS = 8  # parameters over which lines are drawn
MOST_SLICES = 4  # combinations of other parameters that have panels of their own
LINE_BINS = {"bins": 40, "most": 100}  # of lines over a single parameter
LEAST_SHARE = 0.5  # of the trials of a point that need an estimate for its mean to be ranked
QUANTILES = {"low": 0.1, "median": 0.5, "high": 0.9}  # between the outer ones are 80 % of the trials
TRIAL = ["point", "trial"]
STATISTICS = ["mean", "sd", "n", "margin", *QUANTILES]
FAULTS = ["trials", "failures", "warnings"]
BANDS = {
    "mean": "bands are 95 % confidence intervals of the mean over the conditions of a value, or over its trials where "
    "it has one condition",
    "trials": "bands hold 80 % of the trials (quantiles 10 to 90 %)",
}
MARKS = (
    f" A ring, or an asterisk behind a number: at least {100 * FAULT_SHARE:g} % of the trials of a mean failed, which "
    "it leaves out, or came with a warning, which it holds. A cross: no trial has a value."
)
EXTREMES = (
    "Points with the best and the worst mean (of an error: by the root mean square over trials), or the lowest and "
    "the highest of a quantity that has no best; mean ± standard deviation over trials. Points where less than half "
    "of the trials have a value are not ranked; a point where half came with a warning is never the best. Failures "
    "are trials without an estimate, which means leave out; warnings are trials whose estimate came with a warning, "
    "which means hold. All points are in the CSV file."
)


@dataclass(frozen=True)
class SweepStudy:
    """A sweep as its report shows it.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop.studies.config import SweepSettings
    >>> row = {"point": "p", "reflex_gain": 5.0, "method": "riv", "trial": 0, "vaf_net_true": 99.0}
    >>> shown = SweepSettings(quantities=["vaf_net_true"]).model_dump()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pd.DataFrame([row]).to_parquet(f"{folder}/s-trials.parquet")
    ...     sweep = SweepStudy.read(f"{folder}/s-trials.parquet", ["reflex_gain"], {"riv": "RIV"}, shown, {})
    >>> [axis.name for axis in sweep.axes], len(sweep.trials)
    (['reflex_gain'], 1)
    """

    trials: pd.DataFrame  # a row for each point, method and trial, with the quantities, and whether it failed or warned
    parameters: tuple[SweepAxis, ...]  # parameters with more than one value
    axes: tuple[SweepAxis, ...]  # those that pictures are drawn over
    quantities: list[str]  # that are shown
    absent: list[str]  # quantities that the configuration names and the table does not have
    methods: Mapping[str, str]  # label of each method of the study
    settings: Mapping[str, Any]  # fields of `ankleloop.studies.config.SweepSettings`
    simulation: Mapping[str, Any]  # settings of the simulation that all points share
    algorithms: Mapping[str, str] = field(default_factory=dict)  # in the registry; by default those of the same name

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
        trials = read_sweep(path, varied, quantities, simulation)
        trials = trials[trials["method"].isin(needed)].reset_index(drop=True)
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
        varied, panels = {axis.name for axis in self.parameters}, []
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
    path: str | PathLike[str], varied: Sequence[str], quantities: Sequence[str], simulation: Mapping[str, Any]
) -> pd.DataFrame:
    """Read what pictures of a sweep need of a table of trials; errors are relative to the truth of each point."""
    columns = trial_table_columns(path)
    names = {name: error_source(name) or name for name in quantities if name not in FAULT_SHARES}
    # Where the points of a sweep have a value of the same name, the estimate has another column.
    sources = {name: f"{name}_estimated" if f"{name}_estimated" in columns else name for name in names.values()}
    others = [name for name in ("failure", "warnings", *SETTINGS.values()) if name in columns]
    wanted = dict.fromkeys([*TRIAL, "method", *varied, *others, *sources.values()])
    table = read_trial_table(path, columns=list(wanted))
    faults = list_faults(table)
    trials = table[[*TRIAL, *varied, "method"]].assign(failed=faults["failures"], warned=faults["warnings"])
    for name in quantities:
        if name in FAULT_SHARES:
            trials[name] = 100.0 * faults[name]
            continue
        trials[name] = table[sources[names[name]]].astype(float)
        if names[name] != name:  # an error [%], which does not exist where the truth is 0
            setting = SETTINGS[names[name]]
            truth = table.get(setting, pd.Series(simulation.get(setting), table.index)).astype(float)
            trials[name] = 100.0 * (trials[name] / truth.where(truth != 0) - 1.0)
    return trials


def pair_methods(trials: pd.DataFrame, first: str, second: str, quantities: Sequence[str]) -> pd.DataFrame:
    """Differences of two methods, trial by trial: both have identified the same record."""
    own, other = (trials[trials["method"] == method].set_index(TRIAL) for method in (first, second))
    other = other.reindex(own.index)
    table = own.assign(method=f"{first} − {second}", **{name: own[name] - other[name] for name in quantities})
    failed, warned = own["failed"] | other["failed"], own["warned"] | other["warned"]
    return table.assign(failed=failed, warned=warned & ~failed).reset_index()[list(trials.columns)]


def _group(table: pd.DataFrame, by: Sequence[str]) -> Any:
    """Groups of rows in the order of their first appearance; an empty value makes a group, too."""
    return table.groupby(list(by), sort=False, dropna=False, observed=True)


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
    return pd.concat(tables, ignore_index=True)[[*by, "quantity", *STATISTICS, *FAULTS]]


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
    parts = {name: part.reset_index(drop=True) for name, part in summary.groupby("quantity", sort=False)}
    columns = {f"{name}_{key}": part[key] for name, part in parts.items() for key in STATISTICS}
    shared = next(iter(parts.values())).drop(columns=["quantity", *STATISTICS])
    return pd.concat([shared.drop(columns=FAULTS), pd.DataFrame(columns), shared[FAULTS]], axis=1)


def draw_sweep(sweep: SweepStudy) -> tuple[Figure, str]:
    """The picture of a sweep with its caption: lines over one axis, maps over two, a matrix of effects over more."""
    if len(sweep.axes) == 2:
        return draw_map(sweep)
    band, bins = sweep.settings["band"], LINE_BINS if len(sweep.axes) == 1 else {}
    effects = pd.concat([summarise_effects(sweep.shown_trials, axis, sweep.quantities, **bins) for axis in sweep.axes])
    if band == "mean":
        effects = _add_ends(effects)
    effects.loc[effects["quantity"].isin(FAULT_SHARES), ["low", "high"]] = np.nan  # counts have no band
    return lines_figure(effects, sweep.axes, sweep.panels), f"{_describe(sweep, sweep.axes)}; {BANDS[band]}.{MARKS}"


def draw_map(sweep: SweepStudy) -> tuple[Figure, str]:
    """Maps over the first two axes of a sweep; a few values of the other parameters have panels of their own."""
    x, y = sweep.axes[:2]
    trials = sweep.shown_trials
    slices = list_slices(trials, [axis for axis in sweep.parameters if axis.name not in (x.name, y.name)])
    table = trials.assign(x=trials[x.name], y=trials[y.name], slice=trials["point"].map(slices) if slices else "")
    cells = _add_ends(summarise_sweep(table, ["x", "y", "slice", "method"], sweep.quantities))
    is_grid = 2 * len(trials[[x.name, y.name]].drop_duplicates()) >= len(x.values) * len(y.values)
    names = list(dict.fromkeys(slices.values())) or [""]
    figure = maps_figure(cells, (x, y), sweep.panels, names, is_grid=is_grid)
    text = _describe(sweep, sweep.parameters if slices else (x, y))
    truths = [SWEEP_QUANTITIES[panel.quantity].symbol for panel in sweep.panels if panel.truth is not None]
    white = f" White is the true value of {', '.join(truths)}." if truths else ""
    return figure, f"{text}. Arrows at the ends of colour bars: some values are beyond them.{white}{MARKS}"


def _add_ends(table: pd.DataFrame) -> pd.DataFrame:
    """Ends of the intervals of means."""
    return table.assign(low=table["mean"] - table["margin"], high=table["mean"] + table["margin"])


def list_slices(trials: pd.DataFrame, others: list[SweepAxis]) -> dict[str, str]:
    """Slice of each point: the values of the parameters that are not axes of the map, where there are few of them."""
    points = trials.drop_duplicates("point").set_index("point")
    words = {point: ", ".join(axis.describe(row[axis.name]) for axis in others) for point, row in points.iterrows()}
    return words if 1 < len(set(words.values())) <= MOST_SLICES else {}


def _describe(sweep: SweepStudy, axes: tuple[SweepAxis, ...]) -> str:
    """What a picture over some parameters shows."""
    others = [axis.description for axis in sweep.parameters if axis not in axes]
    text = f"Means over trials against {', '.join(axis.description for axis in axes)}"
    text += f"; each is over all values of {', '.join(others)}" if others else ""
    return text + (f"; differences (Δ) are {sweep.difference.label}, trial by trial" if sweep.difference else "")


def describe_design(sweep: SweepStudy) -> str:
    """What was varied: each parameter with its values, and the numbers of points, conditions, trials and faults."""
    points = sweep.trials.drop_duplicates("point")
    settings = [axis.name for axis in sweep.parameters if axis.name in SimulationSettings.model_fields]
    conditions = len(points[settings].drop_duplicates()) if settings else 1
    own = sweep.trials[sweep.trials["method"].isin([item.method for item in sweep.series])]
    numbers = own.groupby(["point", "method"], sort=False, observed=True).size()
    trials = " to ".join(f"{number}" for number in dict.fromkeys([numbers.min(), numbers.max()]))
    shared = " (points that differ in options of methods alone share their trials)" * (conditions < len(points))
    absent = ", ".join(SWEEP_QUANTITIES[name].symbol for name in sweep.absent)
    return (
        f"Varied: {'; '.join(map(_list_values, sweep.parameters)) or 'nothing'}. Points: {len(points):,}; conditions: "
        f"{conditions:,}{shared}; trials at each point: {trials}. Identifications: {len(own):,}; failed: "
        f"{own['failed'].sum():,}; with a warning: {own['warned'].sum():,}."
    ) + (f" No method of this study gives {absent}." if absent else "")


def _list_values(axis: SweepAxis) -> str:
    """A parameter with its values, or with their limits where there are many."""
    if axis.ordered and len(axis.values) > 5:
        scale = ", spaced logarithmically" if axis.kind == "log" else ""
        limits = f"{axis.texts[0]} to {axis.texts[-1]} {axis.unit}".rstrip()
        return f"{axis.description} {limits} ({len(axis.values):,} values{scale})"
    return f"{axis.heading}: {', '.join(axis.texts)}"


def list_extremes(sweep: SweepStudy, summary: pd.DataFrame) -> pd.DataFrame:
    """Points with the best and the worst mean of each quantity and method; highest and lowest without a goal."""
    ranked = summary[summary["mean"].notna() & (summary["n"] >= LEAST_SHARE * summary["trials"])]
    labels = {item.method: item.label for item in sweep.series}
    rows = []
    for name in sweep.quantities:
        for method, label in labels.items():
            part = ranked[(ranked["quantity"] == name) & (ranked["method"] == method)]
            for rank, index in _rank(part, name):
                point = summary.loc[index]
                row = {"quantity": SWEEP_QUANTITIES[name].label, "method": label, "rank": rank}
                row |= {axis.heading: axis.format(point[axis.name]) for axis in sweep.parameters}
                row["mean ± sd"] = format_pairs([point["mean"]], [point["sd"]], "{:.4g} ± {:.2g}")[0]
                rows.append(row | {count: str(point[count]) for count in FAULTS})
    return pd.DataFrame(rows)


def _rank(part: pd.DataFrame, quantity: str) -> list[tuple[str, int]]:
    """Words and rows of the two ends; nothing for a single point."""
    if len(part) < 2:
        return []
    goal, size = desired_value(quantity), part["mean"]
    if not goal:
        return [("lowest", size.idxmin()), ("highest", size.idxmax())]
    if goal == "zero":  # the root mean square over trials: bias and spread together
        size = np.sqrt(size**2 + (part["sd"] ** 2 * (part["n"] - 1) / part["n"]).fillna(0.0))
    elif goal == "high":
        size = -size
    plain = size[part["warnings"] < LEAST_SHARE * part["trials"]]
    return [*([("best", plain.idxmin())] if len(plain) else []), ("worst", size.idxmax())]
