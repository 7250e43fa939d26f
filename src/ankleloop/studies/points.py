"""Points of a study: combinations of settings of the simulation and options of methods, from grids, designs, tables.

A point whose settings another one has as well shares its trials: the settings alone are its condition.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, NamedTuple, Self, Union, get_args, get_origin

import numpy as np
from pydantic import Field, model_validator

from ankleloop.options import Options, option, show_value, suggest_name
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.checking import ConfigError, check, expand_path, key_error
from ankleloop.studies.recording_tables import cast_number, read_points

SETTINGS = tuple(SimulationSettings.model_fields)
SIMULATION = ""  # owner of the settings, beside the methods, which own their options
MAX_POINTS = 100_000  # of a study
DIGITS = 12  # of the values of a range, so that 3 · 0.1 is 0.3; those of a design have half of them

Place = tuple[str, ...]
Methods = Mapping[str, Any]  # `studies.config.MethodSettings` by the names of methods in the study
Combination = tuple[str, Mapping[str, Any]]  # where it stands, if in a table, and values by column
Points = tuple[list["Point"], dict[str, dict[str, Any]], dict[str, "Parameter"]]  # and all settings of each condition


class _Limits(Options):
    """Two limits of values."""

    start: float = option(description="first value, or lower limit")
    stop: float = option(description="last value, or upper limit")
    scale: Literal["linear", "logarithmic"] = option("linear", "equal differences, or equal ratios, of neighbours")

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        start, stop = self.start, self.stop
        if stop < start:
            raise ValueError(f"stop must be at least start ({start:g}), got {stop:g}: values are in ascending order")
        if self.scale == "logarithmic" and start <= 0:
            raise ValueError(f"a logarithmic scale begins above 0, got start: {start:g}; a linear one may hold 0")
        return self

    def interpolate(self, share: float, digits: int) -> float:
        """Value at a share of the way from start to stop, rounded."""
        value = self.start + (self.stop - self.start) * share
        if self.scale == "logarithmic":
            value = self.start * (self.stop / self.start) ** share
        return float(f"{value:.{digits}g}")


class ValueRange(_Limits):
    """Values between two limits, both of which belong to them."""

    step: float | None = option(None, "difference between neighbours", gt=0)
    count: int | None = option(None, "number of values, in place of a step", ge=2, le=MAX_POINTS)

    @model_validator(mode="after")
    def _check_step(self) -> Self:
        if (self.step is None) == (self.count is None):
            raise ValueError("has start, stop, and either step or count")
        if self.step and self.scale == "logarithmic":
            raise ValueError("a logarithmic range has a count in place of a step")
        if self.step and (self.stop - self.start) / self.step >= MAX_POINTS:
            raise ValueError(f"has more than {MAX_POINTS:,} values: use a larger step")
        return self

    @property
    def values(self) -> list[float]:
        """The values, rounded to 12 significant digits; a step is counted as it is written, in decimals."""
        if self.count:
            return [self.interpolate(share, DIGITS) for share in np.linspace(0.0, 1.0, self.count).tolist()]
        start, stop, step = (Decimal(repr(value)) for value in (self.start, self.stop, self.step))
        return [float(start + number * step) for number in range(int((stop - start) / step) + 1)]


class Design(Options):
    """A random design: points that fill the space of several parameters evenly."""

    design: Literal["latin-hypercube", "sobol"] = option(description="kind of the design")
    count: int = option(description="number of points; a power of two for sobol", ge=1, le=MAX_POINTS)
    seed: int = option(description="seed of the design", ge=0)
    parameters: dict[str, Any] = Field(
        description="limits (start, stop, scale) of each parameter, or the list of its values", min_length=1
    )

    @model_validator(mode="after")
    def _check_count(self) -> Self:
        power = 1 << self.count.bit_length() - 1
        if self.design == "sobol" and self.count != power:
            raise ValueError(
                "the count of a Sobol design is a power of two, which fills space evenly: "
                f"{power} or {2 * power}, got {self.count}; latin-hypercube takes any count"
            )
        return self


class PointTable(Options):
    """A table of points."""

    table: str = option(description="CSV or Parquet file with a row for each point and a column for each parameter")


class Parameter(NamedTuple):
    """What a name in `points` stands for, which is also the name of its column in tables."""

    column: str
    field: str  # name of the setting or option
    owners: tuple[str, ...]  # the simulation, or methods of the study whose option it is
    kind: Literal["number", "count", "flag", "text"]  # of its values
    allows_none: bool


class Point(NamedTuple):
    """A point of a study."""

    name: str  # its name in tables
    condition: str  # name of its settings alone, by which trials and their seeds are keyed
    values: dict[str, Any]  # by column; a parameter that only other points name has the value of the study
    options: dict[str, dict[str, Any]]  # of methods that make it, by the name of the method in the study


def point_name(values: Mapping[str, Any]) -> str:
    """Name of a point in tables, from the values that make it, in any order."""
    return ",".join(f"{name}={value}" for name, value in sorted(values.items())) or "only"


def list_points(study: str, entry: Any, shared: SimulationSettings, methods: Methods) -> Points:
    """Points of a study, checked: names, types and bounds of every value, and what values may not go together."""
    place = ("studies", study, "points")
    try:
        parameters, combinations = _list_combinations(place, entry, methods)
        owners = {SIMULATION: shared, **{name: method.options for name, method in methods.items()}}
        return _make_points(place, parameters, combinations, owners)
    except ConfigError as error:  # rows and columns of a table are no keys of the configuration
        raise ConfigError(str(error), error.keys if error.keys[:1] == place[:1] else place) from None
    except ValueError as error:
        raise key_error(place, f"{error}.") from None


def _make_points(
    place: Place, parameters: dict[str, Parameter], combinations: Iterable[Combination], owners: Mapping[str, Options]
) -> Points:
    """Points of all combinations; equal settings, and equal options of a method, are checked once."""
    points: dict[tuple[Any, ...], tuple[str, Point]] = {}
    conditions: dict[str, dict[str, Any]] = {}
    checked: dict[tuple[str, str], Options] = {}
    for row, given in combinations:
        if len(points) == MAX_POINTS:
            raise ValueError(f"there are more than {MAX_POINTS:,} points: divide them among several studies")
        where = (row,) if row else ("config", *place, point_name(given))
        divided, models = _divide_values(parameters, given), {}
        for owner, base in owners.items():
            values = divided.get(owner, {})
            key = (owner, repr(values))
            if key not in checked:
                chosen = {name: getattr(base, name) for name in base.model_fields_set}
                end = (owner,) if owner != SIMULATION and len(owners) > 2 else ()
                checked[key] = check(type(base), chosen | values, *where, *end)
            models[owner] = checked[key]
        complete = {name: _find_value(parameter, models, given) for name, parameter in parameters.items()}
        made = {name: complete[name] for name in given}
        options = _divide_values(parameters, made)
        settings = options.pop(SIMULATION, {})
        point = Point(point_name(made), point_name(settings), complete, options)
        first, other = points.setdefault(tuple(complete.values()), (row, point))
        if other is not point:
            message = f"the points {other.name} and {point.name} have the same settings"
            if other.name == point.name:
                message = f"the point {point.name} is {f'in {first} already' if row else 'listed twice'}"
            raise ConfigError(f"{row}: {message}.") if row else ValueError(message)
        conditions.setdefault(point.condition, {**dict(owners[SIMULATION]), **settings})
    return [point for _, point in points.values()], conditions, parameters


def _divide_values(parameters: Mapping[str, Parameter], values: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Values of a point by their owners and by their names there."""
    divided: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        if isinstance(value, (list, Mapping)):
            raise ValueError(f"{name}: each value must be a single one, got {show_value(value)}")
        for owner in parameters[name].owners:
            divided.setdefault(owner, {})[parameters[name].field] = value
    return divided


def _find_value(parameter: Parameter, models: Mapping[str, Options], given: Mapping[str, Any]) -> Any:
    """Value of a parameter at a point, so that 13 and 13.0, 0.0 and -0.0 are one; None where methods differ in it."""
    value = given.get(parameter.column)
    if isinstance(value, str):  # as it is written, also where it stands for a table of numbers
        return value
    first, *others = (getattr(models[owner], parameter.field) for owner in parameter.owners)
    value = first if all(other == first for other in others) else None
    return value + 0.0 if isinstance(value, float) else value


def _list_combinations(
    place: Place, entry: Any, methods: Methods
) -> tuple[dict[str, Parameter], Iterable[Combination]]:
    """What varies, and its values at each point, from any form of the key `points`."""
    if isinstance(entry, Mapping) and "table" in entry:
        table = check(PointTable, entry, "config", *place).table
        return _read_table(expand_path(table, f"study {place[1]}: the table of its points"), methods)
    if isinstance(entry, Mapping) and "design" in entry:
        design: Design = check(Design, entry, "config", *place)
        parameters = find_parameters(design.parameters, methods)
        return parameters, _draw_points(design, parameters, (*place, "parameters"))
    if isinstance(entry, Mapping):
        parameters = find_parameters(entry, methods)
        lists = [_list_values(parameters[name], values, place) for name, values in entry.items()]
        count = math.prod(map(len, lists))
        if count > MAX_POINTS:
            raise ValueError(f"{count:,} points are more than {MAX_POINTS:,}: divide them among several studies")
        return parameters, (("", dict(zip(entry, row, strict=True))) for row in itertools.product(*lists))
    if not isinstance(entry, list) or not entry or not all(isinstance(point, Mapping) for point in entry):
        raise ValueError("must be lists of values by setting, or a list of points with their settings")
    names = dict.fromkeys(name for point in entry for name in point)
    return find_parameters(names, methods), (("", point) for point in entry)


def _read_table(path: Path, methods: Methods) -> tuple[dict[str, Parameter], Iterable[Combination]]:
    rows = list(read_points(path))
    if not rows:
        raise ConfigError(f"the table {path} has no rows.")
    try:
        parameters = find_parameters(rows[0][1], methods)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}.") from None
    return parameters, (
        (row, {name: _cast(parameters[name], cells[name], row) for name in cells}) for row, cells in rows
    )


def _cast(parameter: Parameter, value: Any, row: str) -> Any:
    """A cell as the type of its column; text that is none stays text, which the model refuses."""
    if value == "":
        raise ConfigError(
            f"{row}: the cell of the column {parameter.column!r} is empty: every point has a value of each parameter; "
            "write null for the value null."
        )
    if value == "null" and parameter.allows_none:
        return None
    if not isinstance(value, str) or parameter.kind == "text":
        return value
    return {"true": True, "false": False}.get(value.lower(), value) if parameter.kind == "flag" else cast_number(value)


def _list_values(parameter: Parameter, values: Any, place: Place) -> list[Any]:
    """Values of a parameter of a grid."""
    if isinstance(values, list) and values:
        return values
    limits = _check_limits(ValueRange, parameter, values, place, "each setting", "a range (start, stop, step or count)")
    # A count need not hit whole numbers; a step that does not is a mistake, which the model of the option refuses.
    return [round(value) if parameter.kind == "count" and limits.count else value for value in limits.values]


def _draw_points(design: Design, parameters: Mapping[str, Parameter], place: Place) -> Iterable[Combination]:
    """Points of a random design."""
    from scipy.stats import qmc

    scales = {name: _scale(parameters[name], values, place) for name, values in design.parameters.items()}
    sampler = qmc.Sobol if design.design == "sobol" else qmc.LatinHypercube
    rows = sampler(len(scales), rng=np.random.default_rng(design.seed)).random(design.count).tolist()
    return [("", {name: scale(u) for (name, scale), u in zip(scales.items(), row, strict=True)}) for row in rows]


def _scale(parameter: Parameter, values: Any, place: Place) -> Callable[[float], Any]:
    """Function from the unit interval to the values of a parameter."""
    if isinstance(values, list) and values:
        return lambda u: values[int(u * len(values))]
    limits = _check_limits(_Limits, parameter, values, place, "each parameter", "limits (start, stop)")
    if parameter.kind == "count" and limits.scale == "linear":  # each whole number has the same share
        low, high = math.ceil(limits.start), math.floor(limits.stop)
        return lambda u: low + int(u * (high - low + 1))
    if parameter.kind == "count":
        return lambda u: round(limits.interpolate(u, DIGITS))
    return lambda u: limits.interpolate(u, DIGITS // 2)


def _check_limits(model: type[_Limits], parameter: Parameter, values: Any, place: Place, each: str, form: str) -> Any:
    if not isinstance(values, Mapping):
        got = f"{parameter.column}: {show_value(values)}"
        raise key_error(place, f"{each} must have a list of values, or {form}, got {got}.")
    if parameter.kind not in ("number", "count"):
        raise key_error((*place, parameter.column), "is no number and has no range: list its values.")
    return check(model, values, "config", *place, parameter.column)


def find_parameters(names: Iterable[str], methods: Methods) -> dict[str, Parameter]:
    """What the names in `points` stand for.

    A name is that of a setting, or else that of an option, of every method that has it; `METHOD.option` is that of one.
    """
    models: dict[str, type[Options]] = {SIMULATION: SimulationSettings}
    models |= {name: type(method.options) for name, method in methods.items()}
    options: dict[str, list[str]] = {}  # methods by the names of their options
    for method in methods:
        for field in models[method].model_fields:
            options.setdefault(field, []).append(method)
    known = {f"{method}.{field}": [method] for field, having in options.items() for method in having}
    known = {**known, **options, **{name: [SIMULATION] for name in SETTINGS}}
    parameters: dict[str, Parameter] = {}
    names_of: dict[tuple[str, str], str] = {}
    for name in names:
        if name not in known:
            raise ValueError(
                f"{name!r} is not a setting of the simulation{suggest_name(name, known)}; known: "
                f"{', '.join(SETTINGS)}; nor an option of a method of the study; known: {', '.join(options)}"
            )
        field = name.rpartition(".")[2]
        for owner in known[name]:
            other = names_of.setdefault((owner, field), name)
            if other != name:
                raise ValueError(f"{other} and {name} are the same option of the method {owner}: leave one out")
        for method in filter(None, known[name]):
            keys = {"options": methods[method].options.model_fields_set, "select": methods[method].select}
            for key in (key for key, chosen in keys.items() if field in chosen):
                others = "" if "." in name else f", or name methods: METHOD.{field}"
                where = f"{name}: the method {method} has {field} under {key} as well"
                raise ValueError(f"{where}: leave it out of one of them{others}")
        types = set(_list_types(models[known[name][0]].model_fields[field].annotation))
        is_count = int in types or any(type(value) is int for value in types)
        kind: Any = "count" if is_count else "flag" if bool in types else "number" if float in types else "text"
        parameters[name] = Parameter(name, field, tuple(known[name]), kind, bool({None, NoneType} & types))
    return parameters


def _list_types(annotation: Any) -> tuple[Any, ...]:
    """Members of a union, and the values of a Literal, in one list."""
    origin = get_origin(annotation)
    if origin in (Union, UnionType):
        return tuple(kind for member in get_args(annotation) for kind in _list_types(member))
    return get_args(annotation) if origin is Literal else (annotation,)
