"""A sweep as its report shows it: trials, parameters, axes, quantities, methods and a difference of two of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import Any

import pandas as pd

from ankleloop.errors import DataError
from ankleloop.paper.results import CONDITIONS, true_values
from ankleloop.paper.sweep_quantities import (
    FAULT_SHARES,
    SWEEP_QUANTITIES,
    default_quantities,
    desired_value,
    label_difference,
    label_parameter,
)
from ankleloop.paper.sweep_summary import (
    available_quantities,
    pair_methods,
    read_sweep,
    summarise_sweep,
)
from ankleloop.paper.trial_tables import trial_table_columns
from ankleloop.plotting.method_styles import method_styles
from ankleloop.plotting.sweep_axes import SweepAxis
from ankleloop.plotting.sweeps import SweepPanel, SweepSeries

MOST_COLUMNS = 8  # parameters of a matrix of effects


@dataclass(frozen=True)
class SweepStudy:
    """A sweep as its report shows it.

    Parameters
    ----------
    trials : pandas.DataFrame
        A table of `ankleloop.paper.sweep_summary.read_sweep`, of all methods that are shown.
    parameters : tuple of SweepAxis
        Parameters with more than one value.
    axes : tuple of SweepAxis
        Those that pictures are drawn over.
    quantities : list of str
        Quantities that are shown.
    absent : list of str
        Quantities that the configuration names and the table does not have.
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
    methods: dict[str, str]
    settings: dict[str, Any]
    simulation: dict[str, Any]
    algorithms: dict[str, str] = field(default_factory=dict)

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
        """Read the table of trials of a study.

        Parameters
        ----------
        path : path-like
            Parquet table.
        varied : sequence of str
            Columns of its parameters.
        methods : mapping of str to str
            Label of each method.
        settings, simulation, algorithms : mapping
            As of the class.

        Returns
        -------
        SweepStudy

        Raises
        ------
        DataError
            If the table is missing, damaged, or without the methods or quantities that are to be shown.
        """
        columns = trial_table_columns(path)
        wanted = list(settings["quantities"] or default_quantities(columns))
        quantities = available_quantities(wanted, columns)
        read = [
            name for name in methods if name in {*(settings["methods"] or methods), *(settings["difference"] or ())}
        ]
        trials = read_sweep(path, varied, quantities, simulation, read)
        points = trials.drop_duplicates("point")
        axes = {
            name: SweepAxis.of(name, label_parameter(name, methods), points[name], CONDITIONS.get(name))
            for name in varied
        }
        parameters = tuple(axis for axis in axes.values() if len(axis.values) > 1)
        drawn = tuple(axes[name] for name in settings["axes"]) if settings["axes"] else parameters[:MOST_COLUMNS]
        absent = [name for name in wanted if name not in quantities or not trials[name].notna().any()]
        shown = [name for name in quantities if name not in absent]
        if not shown:
            raise DataError(f"{path}: no method has a value of {', '.join(wanted)}: name other quantities under sweep.")
        drawn = drawn or tuple(axes.values())[:1]
        names = dict(methods), dict(settings), dict(simulation), dict(algorithms or {})
        return cls(trials, parameters, drawn, shown, absent, *names)

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
        pairs = pair_methods(self.trials, first, second, paired)
        return pd.concat([shown, pairs], ignore_index=True)

    @cached_property
    def panels(self) -> list[SweepPanel]:
        """Quantities of the methods that are shown and, behind each, of the difference."""
        varied = {axis.name for axis in self.parameters}
        shared = {name: value for name, value in self.simulation.items() if name not in varied and value is not None}
        panels = []
        for name in self.quantities:
            quantity, marked = SWEEP_QUANTITIES[name], name not in FAULT_SHARES
            desired, truth = desired_value(name), _truth(name, shared)
            panels.append(SweepPanel(name, quantity.label, self.series, desired, truth, marked))
            if self.difference and marked:
                panels.append(SweepPanel(name, label_difference(quantity), [self.difference], "zero"))
        return panels

    def summarise(self) -> pd.DataFrame:
        """Means over trials of each point and method, as `ankleloop.paper.sweep_summary.summarise_sweep`."""
        by = ["point", *(axis.name for axis in self.parameters), "method"]
        return summarise_sweep(self.shown_trials, by, self.quantities)


def _truth(quantity: str, shared: Mapping[str, Any]) -> float | None:
    """True value of a parameter that all points share."""
    try:
        return float(true_values(shared, [quantity])[quantity])
    except KeyError:
        return None
