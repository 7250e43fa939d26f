"""Points of a study: combinations of settings of the simulation and options of methods, from grids, lists, designs.

A point whose settings another one has as well shares its trials: the settings alone are its condition.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from ankleloop.options import Options, option, show_value, suggest_name
from ankleloop.simulation.settings import LOAD, LOAD_SETTINGS, SimulationSettings
from ankleloop_lab.checking import Values, check, find_kind
from ankleloop_workflow.config.files import key_error

SETTING_NAMES = tuple(SimulationSettings.model_fields)
SIMULATION = ""  # owner of the settings, beside the methods, which own their options
MAX_POINTS = 100_000  # of a grid
DIGITS = 12  # of the values of a range, so that 3 · 0.1 is 0.3; those of a design have half of them

Place = tuple[str, ...]
Methods = Mapping[str, Any]  # `config.settings.MethodSettings` by the names of methods in the study
Parameters = dict[str, "Parameter"]
Conditions = dict[str, Values]  # all settings of each
Points = tuple[list["Point"], Conditions, Parameters]
Combination = Mapping[str, Any]  # values by column


class _Limits(Options):
    """Two limits of values."""

    start: float = option(description="first value, or lower limit")
    stop: float = option(description="last value, or upper limit")
    scale: Literal["linear", "logarithmic"] = option(
        "linear", "equal differences, or equal ratios, of neighbours"
    )

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        if self.stop < self.start:
            raise ValueError(
                f"stop must be at least start ({self.start:g}), got {self.stop:g}: values are in ascending order"
            )
        if self.scale == "logarithmic" and self.start <= 0:
            raise ValueError(
                f"a logarithmic scale begins above 0, got start: {self.start:g}; a linear one may hold 0"
            )
        return self

    def interpolate(self, shares: Iterable[float], digits: int) -> list[float]:
        """Values at shares of the way from start to stop, rounded."""
        if self.scale == "linear":
            values = [self.start + (self.stop - self.start) * share for share in shares]
        else:
            values = [self.start * (self.stop / self.start) ** share for share in shares]
        return [float(f"{value:.{digits}g}") for value in values]


class ValueRange(_Limits):
    """Values between two limits, both of which belong to them."""

    count: int = option(description="number of values", ge=2, le=MAX_POINTS)

    @property
    def values(self) -> list[float]:
        """The values, rounded to 12 significant digits."""
        return self.interpolate(np.linspace(0.0, 1.0, self.count).tolist(), DIGITS)


class Design(Options):
    """A random design: points that fill the space of several parameters evenly."""

    design: Literal["latin-hypercube"] = option(description="kind of the design")
    count: int = option(description="number of points", ge=1, le=MAX_POINTS)
    seed: int = option(description="seed of the design", ge=0)
    parameters: Values = Field(
        description="limits (start, stop, scale) of each parameter, or the list of its values",
        min_length=1,
    )


class Parameter(NamedTuple):
    """What a name in `points` stands for, which is also the name of its column in tables."""

    field: str  # name of the setting or option
    owners: list[str]  # the simulation, or methods of the study whose option it is
    kind: str  # of its values: number, count, flag or text


class Point(NamedTuple):
    """A point of a study."""

    name: str  # its name in tables
    condition: str  # name of its settings alone, by which trials and their seeds are keyed
    # By column; a parameter that only other points name has the value of the study.
    values: Values
    # Of methods that make it, by the name of the method in the study.
    options: dict[str, Values]


def point_name(values: Mapping[str, Any]) -> str:
    """Name of a point in tables, from the values that make it, in any order."""
    return ",".join(f"{name}={value}" for name, value in sorted(values.items())) or "only"


def list_points(study: str, entry: Any, shared: SimulationSettings, methods: Methods) -> Points:
    """Points of a study, checked: names, types and bounds of every value, and what values may not go together."""
    place = ("studies", study, "points")
    parameters, combinations = _list_combinations(place, entry, methods)
    owners = {SIMULATION: shared, **{name: method.options for name, method in methods.items()}}
    points: dict[tuple[Any, ...], Point] = {}
    conditions: Conditions = {}
    for given in combinations:
        models = {}
        for owner, base in owners.items():
            values = _values_of(owner, parameters, given)
            complete = base.model_dump(exclude_unset=True) | values
            owner_place = [owner] if owner else []
            models[owner] = check(
                type(base), complete, "config", *place, point_name(given), *owner_place
            )
        values = {
            name: _find_value(parameter, models, given.get(name))
            for name, parameter in parameters.items()
        }
        made = {name: values[name] for name in given}
        options = {name: _values_of(name, parameters, made) for name in owners}
        settings = options.pop(SIMULATION)
        point = Point(
            name=point_name(made),
            condition=point_name(settings),
            values=values,
            options={name: own for name, own in options.items() if own},
        )
        if points.setdefault(tuple(values.values()), point) is not point:
            raise key_error(place, f"the point {point.name} is listed twice.")
        conditions.setdefault(point.condition, dict(shared) | settings)
    return list(points.values()), conditions, parameters


def _values_of(owner: str, parameters: Parameters, values: Mapping[str, Any]) -> Values:
    """Values of a point that belong to an owner, by their names there."""
    return {
        parameters[name].field: value
        for name, value in values.items()
        if owner in parameters[name].owners
    }


def _find_value(parameter: Parameter, models: Mapping[str, Options], given: Any) -> Any:
    """Value of a parameter at a point, so that 13 and 13.0 are one; None where methods differ in it."""
    if isinstance(given, str):  # as it is written, also where it stands for a table of numbers
        return given
    first, *others = (getattr(models[owner], parameter.field) for owner in parameter.owners)
    return first if all(other == first for other in others) else None


def _list_combinations(
    place: Place, entry: Any, methods: Methods
) -> tuple[Parameters, Iterable[Combination]]:
    """What varies, and its values at each point, from any form of the key `points`."""
    is_mapping = isinstance(entry, Mapping)
    if is_mapping and "design" in entry:
        design: Design = check(Design, entry, "config", *place)
        parameters = find_parameters(place, design.parameters, methods)
        return parameters, _draw_points(design, parameters, (*place, "parameters"))
    grids = [entry] if is_mapping else entry
    is_list = isinstance(grids, list) and all(isinstance(grid, Mapping) for grid in grids)
    if not is_list or not grids:
        raise key_error(
            place, "must be lists of values by setting, or a list of points with their settings."
        )
    names: dict[str, None] = {}
    for name in itertools.chain(*grids):
        names |= dict.fromkeys(LOAD_SETTINGS if name == LOAD else [name])
    parameters = find_parameters(place, names, methods)
    lists = [
        [
            _list_choices(name, values, parameters, place, is_mapping)
            for name, values in grid.items()
        ]
        for grid in grids
    ]
    count = sum(math.prod(map(len, choices)) for choices in lists)
    if count > MAX_POINTS:
        raise key_error(
            place,
            f"{count:,} points are more than {MAX_POINTS:,}: divide them among several studies.",
        )
    chosen = itertools.chain(*(itertools.product(*choices) for choices in lists))
    return parameters, (
        {name: value for part in parts for name, value in part.items()} for parts in chosen
    )


def _list_choices(
    name: str, values: Any, parameters: Parameters, place: Place, is_grid: bool
) -> list[Values]:
    """Choices of a parameter, each with its value, or with the three values of a load.

    In a list of points a single value is a choice, too.
    """
    if name == LOAD:
        has_lists = isinstance(values, list) and any(isinstance(value, list) for value in values)
        loads = values if has_lists else [values]
        if not all(isinstance(load, list) and len(load) == len(LOAD_SETTINGS) for load in loads):
            raise key_error(
                (*place, name),
                f"must be [inertia, viscosity, stiffness], or a list of those, got {show_value(values)}.",
            )
        return [dict(zip(LOAD_SETTINGS, load, strict=True)) for load in loads]
    if not is_grid and not isinstance(values, (list, Mapping)):
        values = [values]
    listed = _list_values(parameters[name], values, (*place, name))
    # Several numbers are one value of an option that is a table: a text with commas.
    return [
        {name: ", ".join(map(str, value)) if isinstance(value, list) else value} for value in listed
    ]


def _draw_points(design: Design, parameters: Parameters, place: Place) -> list[Combination]:
    """Points of a random design."""
    from scipy.stats import qmc

    sampler = qmc.LatinHypercube(len(parameters), rng=design.seed)
    shares = sampler.random(design.count)
    columns = [
        _draw_values(parameters[name], values, (*place, name), column)
        for (name, values), column in zip(design.parameters.items(), shares.T.tolist(), strict=True)
    ]
    return [dict(zip(parameters, row, strict=True)) for row in zip(*columns, strict=True)]


def _list_values(parameter: Parameter, values: Any, place: Place) -> list[Any]:
    """Values of a parameter of a grid."""
    limits = _check_values(parameter, values, place, ValueRange)
    if isinstance(limits, list):
        return limits
    if parameter.kind == "count":
        return [round(value) for value in limits.values]
    return limits.values


def _draw_values(
    parameter: Parameter, values: Any, place: Place, shares: Iterable[float]
) -> list[Any]:
    """Values of a parameter of a design, at shares of the way from the first to the last one."""
    limits = _check_values(parameter, values, place, _Limits)
    is_count = parameter.kind == "count"
    if isinstance(limits, list):
        choices: Sequence[Any] = limits
    elif is_count and limits.scale == "linear":  # each whole number has the same share
        choices = range(math.ceil(limits.start), math.floor(limits.stop) + 1)
        if not choices:
            raise key_error(
                place,
                f"there is no whole number from {limits.start:g} to {limits.stop:g}: widen the limits.",
            )
    else:
        drawn = limits.interpolate(shares, DIGITS // 2)
        return [round(value) for value in drawn] if is_count else drawn
    return [choices[int(share * len(choices))] for share in shares]


def _check_values(parameter: Parameter, values: Any, place: Place, model: type[_Limits]) -> Any:
    """Values of a parameter as they are listed, or their limits."""
    if isinstance(values, list) and values:
        return values
    if not isinstance(values, Mapping) or parameter.kind not in ("number", "count"):
        raise key_error(
            place,
            f"must be a list of values, or of numbers a range (start, stop), got {show_value(values)}.",
        )
    return check(model, values, "config", *place)


def find_parameters(place: Place, names: Iterable[str], methods: Methods) -> Parameters:
    """What the names in `points` stand for.

    A name is that of a setting, or else that of an option, of every method that has it; `METHOD.option` is that of one.
    """
    parameters: Parameters = {}
    fields = {SIMULATION: SimulationSettings.model_fields}
    fields |= {name: type(method.options).model_fields for name, method in methods.items()}
    names_of: dict[tuple[str, str], str] = {}
    for name in names:
        chosen, _, field = name.rpartition(".")
        owners = [
            method for method in methods if chosen in ("", method) and field in fields[method]
        ]
        if name in SETTING_NAMES:
            owners = [SIMULATION]
        if not owners:
            pairs = [(method, option) for method in methods for option in fields[method]]
            options = dict.fromkeys(option for _, option in pairs)
            known = [*SETTING_NAMES, *options, *map(".".join, pairs)]
            raise key_error(
                place,
                f"{name!r} is not a setting of the simulation{suggest_name(name, known)}; "
                f"known: {', '.join(SETTING_NAMES)}; nor an option of a method of the study; "
                f"known: {', '.join(options)}.",
            )
        for owner in owners:
            other = names_of.setdefault((owner, field), name)
            if other != name:
                raise key_error(
                    place,
                    f"{other} and {name} are the same option of the method {owner}: leave one out.",
                )
            if owner == SIMULATION:
                continue
            settings = methods[owner]
            if field in settings.options.model_fields_set | settings.select.keys():
                raise key_error(
                    (*place, name),
                    f"the method {owner} has {field} under options or select as well: leave it out there.",
                )
        kind = find_kind(fields[owners[0]][field].annotation)
        parameters[name] = Parameter(field, owners, kind)
    return parameters
