"""Points of a study: combinations of settings of the simulation and options of methods, from grids, designs, tables.

A point whose settings another one has as well shares its trials: the settings alone are its condition.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Self, Union, get_args, get_origin

from pydantic import Field, model_validator

from ankleloop.methods.registry import METHODS
from ankleloop.options import Options, as_plain, option, show_value, suggest_name
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.checking import ConfigError, check, expand_path
from ankleloop.studies.tables import FLAGS, cast_number, read_points

if TYPE_CHECKING:
    from ankleloop.studies.method_settings import MethodSettings

SETTINGS = tuple(SimulationSettings.model_fields)
MAX_POINTS = 100_000  # of a study
DIGITS = 12  # of the values of a range, so that 3 · 0.1 is 0.3; those of a design have half of them

Place = tuple[str, ...]
Combination = tuple[str, dict[str, Any]]  # where it stands, if in a table, and values by column


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

    def interpolate(self, share: float, digits: int = DIGITS) -> float:
        """Value at a share of the way from start to stop, rounded."""
        value = self.start + (self.stop - self.start) * share
        if self.scale == "logarithmic":
            value = self.start * (self.stop / self.start) ** share
        if share in (0.0, 1.0):
            value = self.stop if share else self.start
        return float(f"{value:.{digits}g}") + 0.0


class ValueRange(_Limits):
    """Values between two limits, both of which belong to them."""

    step: float | None = option(None, "difference between neighbours", gt=0)
    count: int | None = option(None, "number of values, in place of a step", ge=2, le=MAX_POINTS)

    @model_validator(mode="after")
    def _check_step(self) -> Self:
        if (self.step is None) == (self.count is None):
            raise ValueError("has start, stop, and either step or count")
        if self.step is not None and self.scale == "logarithmic":
            raise ValueError("a logarithmic range has a count in place of a step")
        if self.step is not None and (self.stop - self.start) / self.step >= MAX_POINTS:
            raise ValueError(f"has more than {MAX_POINTS:,} values: use a larger step")
        return self

    @property
    def values(self) -> list[float]:
        """The values, rounded to 12 significant digits."""
        if self.step is None:
            last = (self.count or 2) - 1
            return [self.interpolate(number / last) for number in range(last + 1)]
        count = math.floor((self.stop - self.start) / self.step * (1 + 1e-12) + 1e-9) + 1
        values = [self.start + number * self.step for number in range(count)]
        # A difference such as 0.3 - 0.1 · 3 is 0, not 5e-17.
        return [0.0 if abs(v) < 1e-12 * self.step else float(f"{v:.{DIGITS}g}") for v in values]


class Interval(_Limits):
    """Limits between which a design draws a parameter."""

    @model_validator(mode="after")
    def _check_width(self) -> Self:
        if self.start == self.stop:
            raise ValueError(f"stop must be above start, got {self.stop:g}")
        return self


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
            larger = f" or {2 * power}" if 2 * power <= MAX_POINTS else ""
            raise ValueError(
                f"the count of a Sobol design is a power of two, which fills space evenly: {power}{larger}, "
                f"got {self.count}; latin-hypercube takes any count"
            )
        return self


class PointTable(Options):
    """A table of points."""

    table: str = option(
        description="CSV or Parquet file (.parquet) with a row for each point and a column for each parameter",
        min_length=1,
    )


class Parameter(NamedTuple):
    """What a name in `points` stands for, which is also the name of its column in tables."""

    column: str
    field: str  # name of the setting or option
    owner: type[Options]  # model that has it
    methods: tuple[str, ...]  # methods of the study whose option it is; none of a setting of the simulation
    kind: Literal["number", "count", "flag", "text"]  # of its values
    allows_none: bool

    def normalise(self, value: Any) -> Any:
        """A value as the model has it, so that 13 and 13.0, 0.0 and -0.0 make one point with one name and one seed."""
        value = as_plain(value)
        if isinstance(value, (list, tuple, Mapping)):
            raise ValueError(f"{self.column}: each value must be a single one, got {show_value(value)}")
        if type(value) in (int, float) and self.kind == "number":
            with suppress(OverflowError):  # of a whole number beyond all floats, which the model refuses
                return float(value) + 0.0
        if type(value) is float and self.kind == "count" and value.is_integer():
            return int(value)
        return value


class Point(NamedTuple):
    """A point of a study."""

    name: str  # its name in tables
    condition: str  # name of its settings alone, by which trials and their seeds are keyed
    values: dict[str, Any]  # by column; a parameter that only other points name has the value of the study
    options: dict[str, dict[str, Any]]  # of methods that make it, by the name of the method in the study


class Points(NamedTuple):
    """Points of a study, all settings of each condition by its name, and what varies by column."""

    points: list[Point]
    conditions: dict[str, dict[str, Any]]
    parameters: dict[str, Parameter]


def point_name(values: Mapping[str, Any]) -> str:
    """Name of a point in tables, from the values that make it, in any order."""
    return ",".join(f"{name}={value}" for name, value in sorted(values.items())) or "only"


def list_points(study: str, entry: Any, shared: SimulationSettings, methods: Mapping[str, MethodSettings]) -> Points:
    """Points of a study, checked: names, types and bounds of every value, and what values may not go together.

    Equal settings, and equal options of a method, are checked once.
    """
    place = ("studies", study, "points")
    parameters, combinations = _list_combinations(place, entry, methods)
    points: dict[str, tuple[str, Point]] = {}
    conditions: dict[str, dict[str, Any]] = {}
    checked: dict[Any, str] = {}  # settings of conditions, and options of methods, in full
    contents: dict[Any, str] = {}
    for row, combination in combinations:
        if len(points) == MAX_POINTS:
            message = f"there are more than {MAX_POINTS:,} points: divide them among several studies"
            raise _error(place, message)
        try:
            values = {name: parameters[name].normalise(value) for name, value in combination.items()}
        except ValueError as error:
            raise _error(place, f"{row}: {error}" if row else f"{error}") from None
        name = point_name(values)
        where = (row,) if row else ("config", *place, name)
        settings = {column: value for column, value in values.items() if not parameters[column].methods}
        options = _list_options(values, parameters)
        condition = point_name(settings)
        if condition not in conditions:
            conditions[condition] = {**dict(shared), **settings}
            _check(SimulationSettings, conditions[condition], where, place)
            checked[condition] = repr(conditions[condition])
        for method, entry in methods.items():
            key = (method, repr(options.get(method)))
            if key not in checked:
                chosen = {field: getattr(entry.options, field) for field in entry.options.model_fields_set}
                end = () if len(methods) == 1 else (method,)
                checked[key] = repr(
                    _check(type(entry.options), chosen | options.get(method, {}), (*where, *end), place)
                )
        if name in points:
            first = points[name][0]
            twice = f"{row}: the point {name} is in {first} already" if row else f"the point {name} is listed twice"
            raise _error(place, twice)
        content = (checked[condition], *(checked[method, repr(options.get(method))] for method in methods))
        other = contents.setdefault(content, name)
        if other != name:
            message = f"study {study}: the points {other} and {name} have the same settings."
            raise ConfigError(f"{row}: {message}" if row else message, place)
        points[name] = (row, Point(name, condition, values, options))
    listed = [point for _, point in points.values()]
    if any(len(point.values) < len(parameters) for point in listed):
        complete = {name: _shared_value(parameter, shared, methods) for name, parameter in parameters.items()}
        listed = [point._replace(values={**complete, **point.values}) for point in listed]
    return Points(listed, conditions, dict(parameters))


def _list_options(values: Mapping[str, Any], parameters: Mapping[str, Parameter]) -> dict[str, dict[str, Any]]:
    """Options of each method among the values of a point."""
    options: dict[str, dict[str, Any]] = {}
    for column, value in values.items():
        for method in parameters[column].methods:
            options.setdefault(method, {})[parameters[column].field] = value
    return options


def _check(model: type[Options], values: Mapping[str, Any], where: Place, place: Place) -> Any:
    try:
        return check(model, values, *where)
    except ConfigError as error:  # keys of a row of a table are no keys of the configuration
        raise error if where[0] == "config" else ConfigError(f"{error}", place) from None


def _shared_value(parameter: Parameter, shared: SimulationSettings, methods: Mapping[str, MethodSettings]) -> Any:
    """Value of a parameter at points that do not name it; None where methods differ in it."""
    owners = [methods[method].options for method in parameter.methods] or [shared]
    values = [getattr(owner, parameter.field) for owner in owners]
    return values[0] if all(value == values[0] for value in values) else None


def _list_combinations(
    place: Place, entry: Any, methods: Mapping[str, MethodSettings]
) -> tuple[Mapping[str, Parameter], Iterable[Combination]]:
    """What varies, and its values at each point, from any form of the key `points`."""
    form = next((key for key in ("table", "design") if isinstance(entry, Mapping) and key in entry), None)
    other = next((name for name in entry if name in SETTINGS), None) if form else None
    if other:
        raise _error(
            place,
            f"{other} stands beside {form}: points have one form. Keys of several configuration files are put "
            "together: for points of another form, define a study of another name",
        )
    if form == "table":
        return _read_table(place, check(PointTable, entry, "config", *place).table, methods)
    if form == "design":
        design: Design = check(Design, entry, "config", *place)
        parameters = find_parameters(list(design.parameters), methods, place)
        return parameters, draw_points(design, parameters, place)
    if isinstance(entry, Mapping):
        parameters = find_parameters(list(entry), methods, place)
        lists = [list_values(parameters[name], values, place) for name, values in entry.items()]
        count = math.prod(map(len, lists))
        if count > MAX_POINTS:
            raise _error(place, f"{count:,} points are more than {MAX_POINTS:,}: divide them among several studies")
        return parameters, (("", dict(zip(entry, row, strict=True))) for row in itertools.product(*lists))
    if not isinstance(entry, list) or not entry or not all(isinstance(point, Mapping) for point in entry):
        raise _error(place, "must be lists of values by setting, or a list of points with their settings")
    names = list(dict.fromkeys(name for point in entry for name in point))
    return find_parameters(names, methods, place), (("", dict(point)) for point in entry)


def _read_table(
    place: Place, table: str, methods: Mapping[str, MethodSettings]
) -> tuple[Mapping[str, Parameter], Iterator[Combination]]:
    path = expand_path(table, f"study {place[1]}: the table of its points")
    try:
        rows = read_points(path)
        first = next(rows)
        try:
            parameters = find_parameters(list(first[1]), methods, place)
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}") from None
    except ConfigError as error:
        raise ConfigError(f"{error}", place) from None

    def cast_rows() -> Iterator[Combination]:
        try:
            for row, cells in itertools.chain([first], rows):
                yield row, {name: _cast(parameters[name], value, row) for name, value in cells.items()}
        except ConfigError as error:
            raise ConfigError(f"{error}", place) from None

    return parameters, cast_rows()


def _cast(parameter: Parameter, value: Any, row: str) -> Any:
    """A cell as the type of its column; text that is none stays text, which the model refuses."""
    if value == "":
        raise ConfigError(
            f"{row}: the cell of the column {parameter.column!r} is empty: every point has a value of each parameter; "
            "write null for the value null."
        )
    if value is None and not parameter.allows_none:
        raise ConfigError(f"{row}, column {parameter.column}: there is no value, and it may not be null.")
    if not isinstance(value, str):
        return value
    if value == "null" and parameter.allows_none:
        return None
    if parameter.kind == "flag":
        return FLAGS.get(value.lower(), value)
    return value if parameter.kind == "text" else cast_number(value)


def list_values(parameter: Parameter, values: Any, place: Place) -> list[Any]:
    """Values of a parameter of a grid."""
    if isinstance(values, Mapping):
        _check_number(parameter, place)
        value_range: ValueRange = check(ValueRange, values, "config", *place, parameter.column)
        # A count need not hit whole numbers; a step that does not is a mistake, which the model of the option refuses.
        if parameter.kind == "count" and value_range.count:
            return [round(value) for value in value_range.values]
        return value_range.values
    if not isinstance(values, list) or not values:
        raise ConfigError(
            f"{' → '.join(('config', *place))}: each setting must have a list of values, or a range (start, stop, step "
            f"or count), got {parameter.column}: {show_value(values)}.",
            place,
        )
    return values


def draw_points(design: Design, parameters: Mapping[str, Parameter], place: Place) -> list[Combination]:
    """Points of a random design."""
    import numpy as np
    from scipy.stats import qmc

    columns = {name: _scale(parameters[name], values, place) for name, values in design.parameters.items()}
    rng = np.random.default_rng(design.seed)
    sampler: Any = (
        qmc.Sobol(len(columns), rng=rng) if design.design == "sobol" else qmc.LatinHypercube(len(columns), rng=rng)
    )
    rows = sampler.random(design.count).tolist()
    return [("", {name: columns[name](u) for name, u in zip(columns, row, strict=True)}) for row in rows]


def _scale(parameter: Parameter, values: Any, place: Place) -> Callable[[float], Any]:
    """Function from the unit interval to the values of a parameter."""
    if isinstance(values, list) and values:
        return lambda u: values[min(int(u * len(values)), len(values) - 1)]
    if not isinstance(values, Mapping):
        raise ConfigError(
            f"{' → '.join(('config', *place, 'parameters'))}: each parameter must have limits (start, stop) or a list "
            f"of values, got {parameter.column}: {show_value(values)}.",
            place,
        )
    place = (*place, "parameters")
    _check_number(parameter, place)
    interval: Interval = check(Interval, values, "config", *place, parameter.column)
    if parameter.kind == "count" and interval.scale == "linear":  # each whole number has the same share
        low, high = math.ceil(interval.start), math.floor(interval.stop)
        return lambda u: min(low + int(u * (high - low + 1)), high)
    if parameter.kind == "count":
        return lambda u: round(interval.interpolate(u))
    return lambda u: interval.interpolate(u, DIGITS // 2)


def _check_number(parameter: Parameter, place: Place) -> None:
    if parameter.kind not in ("number", "count"):
        raise _error((*place, parameter.column), "is no number and has no range: list its values")


def find_parameters(names: list[str], methods: Mapping[str, MethodSettings], place: Place) -> dict[str, Parameter]:
    """What the names in `points` stand for.

    A name is that of a setting, or else that of an option, of every method that has it; `METHOD.option` is that of one.
    """
    parameters = {name: _find_parameter(name, methods, place) for name in names}
    owners: dict[tuple[str, str], str] = {}
    for name, parameter in parameters.items():
        field = parameter.field
        for method in parameter.methods:
            settings = methods[method]
            for key, chosen in (("options", settings.options.model_fields_set), ("select", settings.select)):
                if field in chosen:
                    names_one = "" if "." in name else f", or name methods: METHOD.{field}"
                    raise _error(
                        place,
                        f"{name}: the method {method} has {field} under {key} as well: leave it out of one of "
                        f"them{names_one}",
                    )
            other = owners.setdefault((method, field), name)
            if other != name:
                raise _error(place, f"{other} and {name} are the same option of the method {method}: leave one out")
    return parameters


def _find_parameter(name: str, methods: Mapping[str, MethodSettings], place: Place) -> Parameter:
    owners = {key: type(settings.options) for key, settings in methods.items()}
    method, dot, field = str(name).rpartition(".")
    members: tuple[str, ...] = tuple(key for key, owner in owners.items() if field in owner.model_fields)
    owner: type[Options] = SimulationSettings
    if name in SETTINGS:
        members = ()
    elif dot:
        if method not in methods:
            close = suggest_name(method, methods)
            known = ", ".join(methods)
            raise _error(
                place, f"{name!r}: the study has no method {method!r}{close}; its methods: {known}; add one to methods"
            )
        owner, members = owners[method], (method,)
        if field not in owner.model_fields:
            close = suggest_name(field, owner.model_fields)
            known = ", ".join(owner.model_fields)
            raise _error(place, f"{name!r}: the method {method} has no option {field!r}{close}; known: {known}")
    elif members:
        owner = owners[members[0]]
    else:
        options = list(dict.fromkeys(field for owner in owners.values() for field in owner.model_fields))
        others = [key for key, entry in METHODS.items() if name in entry.options.model_fields]
        if others:
            raise _error(place, f"{name!r} is an option of {', '.join(others)}: the study has no such method; add one")
        raise _error(
            place,
            f"{name!r} is not a setting of the simulation{suggest_name(name, [*SETTINGS, *options])}; known: "
            f"{', '.join(SETTINGS)}; nor an option of a method of the study; known: {', '.join(options)}",
        )
    types = set(_list_types(owner.model_fields[field].annotation))
    kind: Any = "flag" if bool in types else "number" if float in types else "text"
    if int in types or any(type(value) is int for value in types):
        kind = "count"
    return Parameter(name, field, owner, members, kind, bool({None, NoneType} & types))


def _error(place: Place, message: str) -> ConfigError:
    return ConfigError(f"{' → '.join(('config', *place))}: {message}.", place)


def _list_types(annotation: Any) -> tuple[Any, ...]:
    """Members of a union, and the values of a Literal, in one list."""
    origin = get_origin(annotation)
    if origin in (Union, UnionType):
        return tuple(kind for member in get_args(annotation) for kind in _list_types(member))
    return get_args(annotation) if origin is Literal else (annotation,)
