"""A sweep as its report shows it: summaries over its trials, and pictures with their captions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from ankleloop.errors import DataError
from ankleloop.plotting.style import MethodStyle, label_styles
from ankleloop.quantities import ERRORS, FAULTS, QUANTITIES, SETTINGS, point_column
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.trials.files import PathLike
from ankleloop_workflow.plotting.sweeps import SweepAxis, SweepPanel, lines_figure, maps_figure
from ankleloop_workflow.tables.means import (
    FAULT_SHARE,
    group_rows,
    list_faults,
    mark_faults,
    means,
    measure_statistics,
)
from ankleloop_workflow.tables.outcomes import CONDITIONS, Labels, Settings
from ankleloop_workflow.tables.trial_tables import (
    default_quantities,
    label_parameter,
    read_trial_table,
)

MOST_COLUMNS = 8  # parameters over which lines are drawn
LEAST_CONDITIONS = 3  # of which the interval of a mean says something
QUANTILES = {"low": 0.1, "median": 0.5, "high": 0.9}  # between the outer ones are 80 % of trials
DIFFERENCE_STYLE = MethodStyle("#222222", "o")
BANDS = (
    "bands are 95 % confidence intervals of the mean over the conditions of a value, or over its trials where it has "
    "one condition; a mean over two conditions has none, as two do not tell how others would spread"
)
MARKS = (
    f" A ring: at least {100 * FAULT_SHARE:g} % of the trials of a mean failed, which it leaves out, or came with a "
    "warning, which it holds. A cross, or a grey cell: no trial has a value."
)

Axes = tuple[SweepAxis, ...]
CaptionedFigure = tuple[Figure, str]


@dataclass(frozen=True)
class SweepStudy:
    """A sweep as its report shows it.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop_workflow.config.settings import SweepSettings
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
    parameters: Axes  # parameters with more than one value
    axes: Axes  # those that pictures are drawn over
    quantities: list[str]  # that are shown
    absent: list[str]  # quantities that the configuration names and the table does not have
    labels: Labels  # of the methods that are shown
    difference: str  # label of the difference of two methods; empty without one
    simulation: Settings  # settings that all points share
    styles: Mapping[str, MethodStyle]  # by label

    @classmethod
    def read(
        cls,
        path: PathLike,
        varied: Sequence[str],
        methods: Labels,
        settings: Mapping[str, Any],
        simulation: Settings,
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
        axes = {}
        for name in varied:
            label = label_parameter(name, methods)
            values = points[point_column(name)]
            axes[name] = SweepAxis.of(name, label, values, CONDITIONS.get(name, {}))
        parameters = [axis for axis in axes.values() if len(axis.values) > 1]
        drawn = [axes[name] for name in settings["axes"] or ()]
        chosen = settings["methods"] or methods
        labels = {name: label for name, label in methods.items() if name in chosen}
        shown = trials[trials["method"].isin(list(labels))]
        pair = settings["difference"] or ()
        difference = " − ".join(methods[name] for name in pair)
        if pair:
            differences = pair_methods(trials, pair[0], pair[1], quantities)
            shown = pd.concat([shown, differences], ignore_index=True)
        return cls(
            trials=shown,
            parameters=tuple(parameters),
            axes=tuple(drawn or parameters[:MOST_COLUMNS] or list(axes.values())[:1]),
            quantities=quantities,
            absent=[name for name in wanted if name not in quantities],
            labels=labels,
            difference=difference,
            simulation=simulation,
            styles=label_styles(methods, algorithms or {}) | {difference: DIFFERENCE_STYLE},
        )

    @cached_property
    def panels(self) -> dict[tuple[str, bool], SweepPanel]:
        """Panels of quantities and, behind each, of the difference of two methods."""
        panels = {}
        varied = [axis.name for axis in self.parameters]
        shared = {name: value for name, value in self.simulation.items() if name not in varied}
        for name in self.quantities:
            quantity = QUANTITIES[name]
            truth = shared.get(SETTINGS.get(name, ""))
            panels[name, False] = SweepPanel(name, quantity.label, quantity.goal, truth)
            if self.difference:
                unit = "points" if quantity.unit == "%" else quantity.unit
                label = f"Δ {quantity.symbol} [{unit}]"
                panels[name, True] = SweepPanel(name, label, "zero")
        return panels

    def summarise(self) -> pd.DataFrame:
        """Means over trials of each point and method, as `summarise_sweep`."""
        by = ["point", *(axis.column for axis in self.parameters), "method"]
        return summarise_sweep(self.trials, by, self.quantities)

    def label_rows(self, summary: pd.DataFrame) -> pd.DataFrame:
        """A summary as figures take it: panels, series, bands and marks; shares of trials have neither of these."""
        table = summary.rename(columns={"mean": "value"})
        quantities = table.pop("quantity")
        is_share = quantities.isin(list(FAULTS))
        series = table["method"].map(self.labels)
        keys = zip(quantities, series.isna(), strict=True)
        margin = table["margin"].mask(is_share)
        failed = ~is_share & (table["failures"] == table["trials"])
        return table.assign(
            series=series.fillna(self.difference),
            panel=[self.panels[key].label for key in keys],
            low=table["value"] - margin,
            high=table["value"] + margin,
            failed=failed,
            marked=~is_share & ~failed & mark_faults(table),
        )


def measure_trials(
    table: pd.DataFrame,
    varied: Sequence[str],
    quantities: Sequence[str],
    simulation: Settings,
) -> pd.DataFrame:
    """Quantities of each trial of a table; errors are relative to the truth of each point, in per cent."""
    faults = list_faults(table)
    keys = ["point", "trial", *map(point_column, varied), "method"]
    trials = table[keys].assign(failed=faults["failures"], warned=faults["warnings"])
    table = table.assign(**(100.0 * faults))
    for name in quantities:
        source = name.removesuffix("_error")
        values = pd.Series(table.get(source), table.index, dtype=float)
        if name in ERRORS:  # an error [%] does not exist where the truth is 0
            setting = SETTINGS[source]
            truth = table.get(point_column(setting), simulation.get(setting))
            truth = pd.Series(truth, table.index, dtype=float)
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
    names = list(quantities)
    failed = own["failed"] | other["failed"]
    table = own.assign(
        method=f"{first} − {second}",
        failed=failed,
        warned=(own["warned"] | other["warned"]) & ~failed,
    )
    table[names] = own[names] - other[names]
    return table.reset_index()[list(trials.columns)]


def summarise_sweep(
    trials: pd.DataFrame, by: Sequence[str], quantities: Sequence[str]
) -> pd.DataFrame:
    """Means over trials with their spread, and what the means leave out."""
    return means(trials, by, quantities, QUANTILES).drop(columns="without G")


def _number_conditions(trials: pd.DataFrame) -> pd.Series:
    """Number of the condition of each trial, which points share that differ in options alone."""
    columns = map(point_column, SimulationSettings.model_fields)
    settings = [column for column in columns if column in trials]
    return group_rows(trials, settings).ngroup() if settings else pd.Series(0, trials.index)


def summarise_effects(
    trials: pd.DataFrame, axis: SweepAxis, quantities: Sequence[str], *, binned: bool = True
) -> pd.DataFrame:
    """Means over all trials of the same value of a parameter, or of a bin of values, whatever the others are.

    The interval of a mean is that over conditions, since trials of one condition (the simulated settings of a point)
    share it, and points that differ in options alone share their trials, too. Where a value has a single condition, it
    is over the trials of that condition. Over two conditions there is none: it would be 13 times as wide as they
    are apart.
    """
    values = trials[axis.column]
    table = trials.assign(
        parameter=axis.name,
        setting=axis.bin(values) if binned else values,
        condition=_number_conditions(trials),
    )
    by = ["parameter", "setting", "method"]
    table["several"] = group_rows(table, by)["condition"].transform("nunique") > 1
    table["unit"] = table["condition"].where(table["several"], table["trial"])
    units = group_rows(table, [*by, "several", "unit"])[list(quantities)].mean().reset_index()
    rows = measure_statistics(units, [*by, "several"], quantities)
    is_vague = rows["several"] & (rows["n"] < LEAST_CONDITIONS)
    rows["margin"] = rows["margin"].mask(is_vague)
    return summarise_sweep(table, by, quantities).assign(**rows[["mean", "sd", "n", "margin"]])


def draw_sweep(sweep: SweepStudy) -> CaptionedFigure:
    """The picture of a sweep with its caption: maps over a grid of two parameters, else a column of lines for each."""
    if len(sweep.axes) == 2:
        places = sweep.trials[[axis.column for axis in sweep.axes]].drop_duplicates()
        if 2 * len(places) >= math.prod(len(axis.values) for axis in sweep.axes):
            return _draw_maps(sweep)
    binned = len(sweep.axes) > 1
    effects = [
        summarise_effects(sweep.trials, axis, sweep.quantities, binned=binned)
        for axis in sweep.axes
    ]
    rows = sweep.label_rows(pd.concat(effects))
    figure = lines_figure(rows, sweep.axes, list(sweep.panels.values()), sweep.styles)
    return figure, f"{_describe(sweep)}; {BANDS}.{MARKS}"


def _draw_maps(sweep: SweepStudy) -> CaptionedFigure:
    """Maps over the axes of a sweep, which are two."""
    x, y = sweep.axes
    table = sweep.trials.assign(x=sweep.trials[x.column], y=sweep.trials[y.column])
    cells = sweep.label_rows(summarise_sweep(table, ["x", "y", "method"], sweep.quantities))
    panels = list(sweep.panels.values())
    text = f"{_describe(sweep)}. The ends of colour bars stand for all values beyond them."
    truths = [QUANTITIES[panel.quantity].symbol for panel in panels if panel.truth is not None]
    if truths:
        text += f" White is the true value of {', '.join(truths)}."
    return maps_figure(cells, (x, y), panels), text + MARKS


def _describe(sweep: SweepStudy) -> str:
    """What the picture of a sweep shows."""
    others = [axis.heading for axis in sweep.parameters if axis not in sweep.axes]
    text = f"Means over trials against {', '.join(axis.heading for axis in sweep.axes)}"
    if others:
        text += f"; each is over all values of {', '.join(others)}"
    if sweep.difference:
        text += f"; differences (Δ) are {sweep.difference}, trial by trial"
    return text


def describe_design(sweep: SweepStudy) -> str:
    """What was varied: each parameter with its values, and the numbers of points and trials."""
    trials = sweep.trials[sweep.trials["method"].isin(list(sweep.labels))]
    varied = "; ".join(map(_list_values, sweep.parameters)) or "nothing"
    text = (
        f"Varied: {varied}. Points: {trials['point'].nunique():,}; trials at each point: {trials['trial'].nunique()}; "
        f"identifications: {len(trials):,}."
    )
    if sweep.absent:
        absent = [QUANTITIES[name].symbol for name in sweep.absent]
        text += f" No method of this study gives {', '.join(absent)}."
    return text


def _list_values(axis: SweepAxis) -> str:
    """A parameter with its values, or with their limits where there are many."""
    texts = [axis.format(value) for value in axis.values]
    if axis.ordered and len(texts) > 5:
        return f"{axis.heading}: {texts[0]} to {texts[-1]} ({len(texts):,} values)"
    return f"{axis.heading}: {', '.join(texts)}"
