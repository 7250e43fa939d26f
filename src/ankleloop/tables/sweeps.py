"""A sweep as its report shows it: summaries over its trials, pictures with their captions, best and worst points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from os import PathLike
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ankleloop.errors import DataError
from ankleloop.plotting.style import MethodStyle, label_styles
from ankleloop.plotting.sweeps import SweepAxis, SweepPanel, lines_figure, maps_figure
from ankleloop.quantities import ERRORS, FAULTS, QUANTITIES, SETTINGS, point_column
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.tables.comparisons import format_pairs
from ankleloop.tables.means import list_faults, means, measure_statistics
from ankleloop.tables.outcomes import CONDITIONS, true_values
from ankleloop.tables.trial_tables import (
    default_quantities,
    label_parameter,
    read_trial_table,
)

MOST_COLUMNS = 8  # parameters over which lines are drawn
LEAST_SHARE = 0.5  # of the trials of a point that need an estimate for its mean to be ranked
FAULT_SHARE = (
    0.05  # of the trials of a mean that failed or came with a warning, from which on it is marked
)
QUANTILES = {
    "low": 0.1,
    "median": 0.5,
    "high": 0.9,
}  # between the outer ones are 80 % of the trials
STATISTICS = ["mean", "sd", "n", "margin", *QUANTILES]
COUNTS = ["trials", "failures", "warnings"]
DIFFERENCE = MethodStyle("#222222", "o")
BANDS = (
    "bands are 95 % confidence intervals of the mean over the conditions of a value, or over its trials where it has "
    "one condition"
)
MARKS = (
    f" A ring, or an asterisk: at least {100 * FAULT_SHARE:g} % of the trials of a mean failed, which it leaves out, "
    "or came with a warning, which it holds. A cross: no trial has a value."
)
EXTREMES = (
    "Points with the best and the worst mean (of an error: by the root mean square over trials), or the lowest and "
    "the highest of a quantity that has no best; mean ± standard deviation over trials. Points where less than half "
    "of the trials have a value are not ranked. Means leave out failures and hold estimates with a warning. All points "
    "are in the CSV file."
)


@dataclass(frozen=True)
class SweepStudy:
    """A sweep as its report shows it.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop.config.settings import SweepSettings
    >>> row = {"point": "p", "point.reflex_gain": 5.0, "method": "riv", "trial": 0, "vaf_net_true": 99.0}
    >>> shown = SweepSettings(quantities=["vaf_net_true"]).model_dump()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pd.DataFrame([row]).to_parquet(f"{folder}/s-trials.parquet")
    ...     sweep = SweepStudy.read(f"{folder}/s-trials.parquet", ["reflex_gain"], {"riv": "RIV"}, shown, {})
    >>> [axis.name for axis in sweep.axes], len(sweep.trials)
    (['reflex_gain'], 1)
    """

    # A row for each point, method and trial with the quantities, and whether it failed or warned; behind them, as a
    # method of its own, differences of two methods.
    trials: pd.DataFrame
    parameters: tuple[SweepAxis, ...]  # parameters with more than one value
    axes: tuple[SweepAxis, ...]  # those that pictures are drawn over
    quantities: list[str]  # that are shown
    absent: list[str]  # quantities that the configuration names and the table does not have
    labels: Mapping[str, str]  # of the methods that are shown
    difference: str  # label of the difference of two methods; empty without one
    simulation: Mapping[str, Any]  # settings that all points share
    styles: Mapping[str, MethodStyle]  # by label

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
        """Read the table of trials of a study, in which the settings and options `varied` differ."""
        table = read_trial_table(path)
        wanted = list(settings["quantities"] or default_quantities(table.columns))
        trials = measure_trials(table, varied, wanted, simulation)
        quantities = [name for name in wanted if trials[name].notna().any()]
        if not quantities:
            raise DataError(
                f"{path}: no method has a value of {', '.join(wanted)}: name other quantities under sweep."
            )
        points = trials.drop_duplicates("point")
        axes = {
            name: SweepAxis.of(
                name,
                label_parameter(name, methods),
                points[point_column(name)],
                CONDITIONS.get(name, {}),
            )
            for name in varied
        }
        parameters = tuple(axis for axis in axes.values() if len(axis.values) > 1)
        drawn = tuple(axes[name] for name in settings["axes"] or ()) or parameters[:MOST_COLUMNS]
        labels = {
            name: label
            for name, label in methods.items()
            if name in (settings["methods"] or methods)
        }
        shown, pair = trials[trials["method"].isin(list(labels))], settings["difference"] or ()
        difference = " − ".join(methods[name] for name in pair)
        if pair:
            shown = pd.concat(
                [shown, pair_methods(trials, pair[0], pair[1], quantities)], ignore_index=True
            )
        absent = [name for name in wanted if name not in quantities]
        styles = label_styles(methods, algorithms or {}) | {difference: DIFFERENCE}
        drawn = drawn or tuple(axes.values())[:1]
        return cls(
            shown, parameters, drawn, quantities, absent, labels, difference, simulation, styles
        )

    @cached_property
    def panels(self) -> dict[tuple[str, bool], SweepPanel]:
        """Panels of quantities and, behind each, of the difference of two methods."""
        panels, varied = {}, [axis.name for axis in self.parameters]
        for name in self.quantities:
            quantity, truth = QUANTITIES[name], None  # of a parameter that all points share
            if name in SETTINGS and SETTINGS[name] not in varied:
                truth = true_values(self.simulation, [name])[name]
            panels[name, False] = SweepPanel(name, quantity.label, QUANTITIES[name].goal, truth)
            if self.difference:
                label = (
                    f"Δ {quantity.symbol} [{'points' if quantity.unit == '%' else quantity.unit}]"
                )
                panels[name, True] = SweepPanel(name, label, "zero")
        return panels

    def summarise(self) -> pd.DataFrame:
        """Means over trials of each point and method, as `summarise_sweep`."""
        by = ["point", *(axis.column for axis in self.parameters), "method"]
        return summarise_sweep(self.trials, by, self.quantities)

    def label_rows(self, summary: pd.DataFrame) -> pd.DataFrame:
        """A summary as figures take it: panels, series, bands and marks; shares of trials have neither of these."""
        table = summary.rename(columns={"mean": "value"})
        is_share, series = table["quantity"].isin([*FAULTS]), table["method"].map(self.labels)
        keys = zip(table["quantity"], series.isna(), strict=True)
        table["series"], table["panel"] = (
            series.fillna(self.difference),
            [self.panels[key].label for key in keys],
        )
        margin = table["margin"].mask(is_share)
        table["low"], table["high"] = table["value"] - margin, table["value"] + margin
        faults = table["failures"] + table["warnings"]
        table["failed"] = ~is_share & (table["failures"] == table["trials"])
        table["marked"] = ~is_share & ~table["failed"] & (faults >= FAULT_SHARE * table["trials"])
        return table.drop(columns="quantity")


def measure_trials(
    table: pd.DataFrame,
    varied: Sequence[str],
    quantities: Sequence[str],
    simulation: Mapping[str, Any],
) -> pd.DataFrame:
    """Quantities of each trial of a table; errors are relative to the truth of each point, in per cent."""
    faults = list_faults(table)
    values = map(point_column, varied)
    trials = table[["point", "trial", *values, "method"]].assign(
        failed=faults["failures"], warned=faults["warnings"]
    )
    table = table.assign(**(100.0 * faults))
    for name in quantities:
        source = name.removesuffix("_error")
        values = table.get(source, pd.Series(np.nan, table.index)).astype(float)
        if name in ERRORS:  # an error [%] does not exist where the truth is 0
            setting = SETTINGS[source]
            truth = table.get(
                point_column(setting), pd.Series(simulation.get(setting), table.index)
            ).astype(float)
            values = 100.0 * (values / truth.where(truth != 0) - 1.0)
        trials[name] = values
    return trials


def pair_methods(
    trials: pd.DataFrame, first: str, second: str, quantities: Sequence[str]
) -> pd.DataFrame:
    """Differences of two methods, trial by trial: both have identified the same record."""
    own, other = (
        trials[trials["method"] == name].set_index(["point", "trial"]) for name in (first, second)
    )
    other = other.reindex(own.index)
    table = own.assign(
        method=f"{first} − {second}", **{name: own[name] - other[name] for name in quantities}
    )
    failed, warned = own["failed"] | other["failed"], own["warned"] | other["warned"]
    return table.assign(failed=failed, warned=warned & ~failed).reset_index()[list(trials.columns)]


def _group(table: pd.DataFrame, by: Sequence[str]) -> Any:
    """Groups of rows in the order of their first appearance; an empty value makes a group, too."""
    return table.groupby(list(by), sort=False, dropna=False, observed=True)


def summarise_sweep(
    trials: pd.DataFrame, by: Sequence[str], quantities: Sequence[str]
) -> pd.DataFrame:
    """Means over trials with their spread, and what the means leave out."""
    return means(trials, by, quantities, QUANTILES)[[*by, "quantity", *STATISTICS, *COUNTS]]


def summarise_effects(
    trials: pd.DataFrame, axis: SweepAxis, quantities: Sequence[str], *, binned: bool = True
) -> pd.DataFrame:
    """Means over all trials of the same value of a parameter, or of a bin of values, whatever the others are.

    The interval of a mean is that over conditions, since trials of one condition (the simulated settings of a point)
    share it, and points that differ in options alone share their trials, too. Where a value has a single condition, it
    is over the trials of that condition.
    """
    settings = [
        point_column(name)
        for name in SimulationSettings.model_fields
        if point_column(name) in trials
    ]
    condition = _group(trials, settings).ngroup() if settings else 0
    values = axis.bin(trials[axis.column]) if binned else trials[axis.column]
    table = trials.assign(parameter=axis.name, setting=values, condition=condition)
    by = ["parameter", "setting", "method"]
    several = _group(table, by)["condition"].transform("nunique") > 1
    table["unit"] = table["condition"].where(several, table["trial"])
    units = _group(table, [*by, "unit"])[list(quantities)].mean().reset_index()
    over_units = measure_statistics(units, by, quantities)[["mean", "sd", "n", "margin"]]
    return summarise_sweep(table, by, quantities).assign(**over_units)


def draw_sweep(sweep: SweepStudy) -> tuple[Figure, str]:
    """The picture of a sweep with its caption: lines over one axis, maps over two, a matrix of effects over more."""
    if len(sweep.axes) == 2:
        return draw_map(sweep)
    binned = len(sweep.axes) > 1
    effects = [
        summarise_effects(sweep.trials, axis, sweep.quantities, binned=binned)
        for axis in sweep.axes
    ]
    rows = sweep.label_rows(pd.concat(effects))
    figure = lines_figure(rows, sweep.axes, list(sweep.panels.values()), sweep.styles)
    return figure, f"{_describe(sweep, sweep.axes)}; {BANDS}.{MARKS}"


def draw_map(sweep: SweepStudy) -> tuple[Figure, str]:
    """Maps over the first two axes of a sweep; a random design is binned."""
    x, y = sweep.axes[:2]
    trials = sweep.trials
    if 2 * len(trials[[x.column, y.column]].drop_duplicates()) < len(x.values) * len(
        y.values
    ):  # no grid
        trials = trials.assign(**{axis.column: axis.bin(trials[axis.column]) for axis in (x, y)})
        x, y = (
            SweepAxis.of(axis.name, axis.label, trials[axis.column], axis.words) for axis in (x, y)
        )
    table = trials.assign(x=trials[x.column], y=trials[y.column])
    cells = sweep.label_rows(summarise_sweep(table, ["x", "y", "method"], sweep.quantities))
    figure = maps_figure(cells, (x, y), list(sweep.panels.values()))
    truths = [
        QUANTITIES[panel.quantity].symbol
        for panel in sweep.panels.values()
        if panel.truth is not None
    ]
    white = f" White is the true value of {', '.join(truths)}." if truths else ""
    text = f"{_describe(sweep, sweep.axes[:2])}. The ends of colour bars stand for all values beyond them."
    return figure, f"{text}{white}{MARKS}"


def _describe(sweep: SweepStudy, axes: tuple[SweepAxis, ...]) -> str:
    """What a picture over some parameters shows."""
    names = {axis.name for axis in axes}
    others = [axis.description for axis in sweep.parameters if axis.name not in names]
    text = f"Means over trials against {', '.join(axis.description for axis in axes)}"
    text += f"; each is over all values of {', '.join(others)}" if others else ""
    return text + (
        f"; differences (Δ) are {sweep.difference}, trial by trial" if sweep.difference else ""
    )


def describe_design(sweep: SweepStudy) -> str:
    """What was varied: each parameter with its values, and the numbers of points, conditions, trials and faults."""
    points = sweep.trials.drop_duplicates("point")
    settings = [
        axis.column for axis in sweep.parameters if axis.name in SimulationSettings.model_fields
    ]
    conditions = len(points[settings].drop_duplicates()) if settings else 1
    own = sweep.trials[sweep.trials["method"].isin(list(sweep.labels))]
    absent = ", ".join(QUANTITIES[name].symbol for name in sweep.absent)
    return (
        f"Varied: {'; '.join(map(_list_values, sweep.parameters)) or 'nothing'}. Points: {len(points):,}; conditions "
        f"(points that differ in options alone share their trials): {conditions:,}; trials at each point: "
        f"{own['trial'].nunique()}. Identifications: {len(own):,}; failed: {own['failed'].sum():,}; with a warning: "
        f"{own['warned'].sum():,}."
    ) + (f" No method of this study gives {absent}." if absent else "")


def _list_values(axis: SweepAxis) -> str:
    """A parameter with its values, or with their limits where there are many."""
    texts = [axis.format(value) for value in axis.values]
    if axis.ordered and len(texts) > 5:
        return f"{axis.heading}: {texts[0]} to {texts[-1]} ({len(texts):,} values)"
    return f"{axis.heading}: {', '.join(texts)}"


def list_extremes(sweep: SweepStudy, summary: pd.DataFrame) -> pd.DataFrame:
    """Points with the best and the worst mean of each quantity and method; lowest and highest without a goal."""
    table = summary[summary["n"] >= LEAST_SHARE * summary["trials"]]
    goals = table["quantity"].map(lambda name: QUANTITIES[name].goal)
    error = np.sqrt(
        table["mean"] ** 2 + table["sd"].fillna(0.0) ** 2 * (table["n"] - 1) / table["n"]
    )
    size = (
        table["mean"].mask(goals == "high", -table["mean"]).mask(goals == "zero", error)
    )  # the less, the better
    table = table.assign(size=size).sort_values("size", kind="stable")
    rows = []
    for name, method in product(sweep.quantities, sweep.labels):
        part = table[(table["quantity"] == name) & (table["method"] == method)]
        ranks = ("best", "worst") if QUANTITIES[name].goal else ("lowest", "highest")
        for rank, (_, point) in (
            zip(ranks, part.iloc[[0, -1]].iterrows(), strict=True) if len(part) > 1 else ()
        ):
            row = {
                "quantity": QUANTITIES[name].label,
                "method": sweep.labels[method],
                "rank": rank,
            }
            row |= {axis.heading: axis.format(point[axis.column]) for axis in sweep.parameters}
            row["mean ± sd"] = format_pairs([point["mean"]], [point["sd"]], "{:.4g} ± {:.2g}")[0]
            rows.append(row | {count: str(point[count]) for count in COUNTS})
    return pd.DataFrame(rows)
