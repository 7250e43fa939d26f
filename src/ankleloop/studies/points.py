"""Points of a study: combinations of settings of the simulation and options of methods, from grids, designs, tables.

A point whose settings another one has as well shares its trials: the settings alone are its condition.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ankleloop.options import Options
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.checking import ConfigError, check, expand_path
from ankleloop.studies.point_designs import MAX_POINTS, Design, draw_points, list_values
from ankleloop.studies.point_parameters import SETTINGS, Parameter, find_parameters
from ankleloop.studies.point_tables import PointTable, read_points

if TYPE_CHECKING:
    from ankleloop.studies.method_settings import MethodSettings

Combination = tuple[str, dict[str, Any]]  # where it stands, if in a table, and values by column


class Point(NamedTuple):
    """A point of a study.

    Parameters
    ----------
    name : str
        Its name in tables.
    condition : str
        Name of its settings alone, by which trials and their seeds are keyed.
    values : dict of str to object
        Values by column; a parameter that only other points name has the value of the study.
    settings : dict of str to object
        Settings of the simulation that make it.
    options : dict of str to dict
        Options of methods that make it, by the name of the method in the study.
    """

    name: str
    condition: str
    values: dict[str, Any]
    settings: dict[str, Any]
    options: dict[str, dict[str, Any]]


class Points(NamedTuple):
    """Points of a study, with all settings of each condition.

    Parameters
    ----------
    points : list of Point
        Points in their order.
    conditions : dict of str to dict
        All settings of each condition by name.
    parameters : dict of str to Parameter
        What varies, by column.
    """

    points: list[Point]
    conditions: dict[str, dict[str, Any]]
    parameters: dict[str, Parameter]


def point_name(values: Mapping[str, Any]) -> str:
    """Name of a point in tables, from the values that make it, in any order."""
    return ",".join(f"{name}={value}" for name, value in sorted(values.items())) or "only"


def list_points(study: str, entry: Any, shared: SimulationSettings, methods: Mapping[str, MethodSettings]) -> Points:
    """Points of a study, checked: names, types and bounds of every value, and what values may not go together."""
    return _PointList(("studies", study, "points"), shared, methods).read(entry)


class _PointList:
    """Points as they are read, and what has been checked of them: equal settings and options are checked once."""

    def __init__(
        self, place: tuple[str, ...], shared: SimulationSettings, methods: Mapping[str, MethodSettings]
    ) -> None:
        self._place, self._methods = place, methods
        self._shared = dict(shared)
        self._parameters: dict[str, Parameter] = {}
        self._conditions: dict[str, dict[str, Any]] = {}
        self._checked: dict[Any, Any] = {}  # by method and varied options: all options
        self._numbers: dict[Any, int] = {}  # of distinct settings, and of distinct options
        self._names: dict[str, str] = {}
        self._contents: dict[tuple[int, ...], str] = {}

    def read(self, entry: Any) -> Points:
        """Read the key `points`."""
        points = [self._make_point(*combination) for combination in self._list_combinations(entry)]
        shared = {name: self._shared_value(parameter) for name, parameter in self._parameters.items()}
        if any(len(point.values) < len(shared) for point in points):
            points = [point._replace(values={**shared, **point.values}) for point in points]
        return Points(points, self._conditions, self._parameters)

    def _list_combinations(self, entry: Any) -> Iterable[Combination]:
        self._check_form(entry)
        if isinstance(entry, Mapping) and "table" in entry:
            table: PointTable = check(PointTable, entry, "config", *self._place)
            path = expand_path(table.table, f"study {self._place[1]}: the table of its points")
            return self._check_count(self._read_table(path))
        if isinstance(entry, Mapping) and "design" in entry:
            design: Design = check(Design, entry, "config", *self._place)
            parameters = self._find(list(design.parameters))
            return [("", point) for point in draw_points(design, parameters, self._place)]
        if isinstance(entry, Mapping):
            return self._list_grid(entry)
        if not isinstance(entry, list) or not entry or not all(isinstance(point, Mapping) for point in entry):
            raise self._error("must be lists of values by setting, or a list of points with their settings")
        self._find(list(dict.fromkeys(name for point in entry for name in point)))
        return self._check_count(("", dict(point)) for point in entry)

    def _check_form(self, entry: Any) -> None:
        """Refuse values of settings beside a table or a design, as where a second file changes the form of points."""
        form = next((key for key in ("table", "design") if isinstance(entry, Mapping) and key in entry), None)
        other = next((name for name in entry if name in SETTINGS), None) if form else None
        if other:
            raise self._error(
                f"{other} stands beside {form}: points have one form. Keys of several configuration files are put "
                "together: for points of another form, define a study of another name"
            )

    def _read_table(self, path: Path) -> Iterator[Combination]:
        try:
            yield from read_points(path, self._find)
        except ConfigError as error:
            raise ConfigError(f"{error}", self._place) from None

    def _list_grid(self, lists: Mapping[str, Any]) -> Iterator[Combination]:
        parameters = self._find(list(lists))
        values = {name: list_values(parameters[name], lists[name], self._place) for name in lists}
        count = math.prod(map(len, values.values()))
        if count > MAX_POINTS:
            raise self._error(f"{count:,} points are more than {MAX_POINTS:,}: divide them among several studies")
        names = list(values)
        return (("", dict(zip(names, row, strict=True))) for row in itertools.product(*values.values()))

    def _check_count(self, combinations: Iterable[Combination]) -> Iterator[Combination]:
        for number, combination in enumerate(combinations):
            if number == MAX_POINTS:
                raise self._error(f"there are more than {MAX_POINTS:,} points: divide them among several studies")
            yield combination

    def _find(self, names: list[str]) -> Mapping[str, Parameter]:
        self._parameters = find_parameters(names, self._methods, self._place)
        return self._parameters

    def _make_point(self, row: str, parameters: dict[str, Any]) -> Point:
        try:
            values = {name: self._parameters[name].normalise(value) for name, value in parameters.items()}
        except ValueError as error:
            raise self._error(f"{row}: {error}" if row else f"{error}") from None
        name = point_name(values)
        where = (row,) if row else ("config", *self._place, name)
        settings, options = self._divide(values)
        condition = point_name(settings) if options else name
        contents = [self._check_settings(condition, settings, where)]
        contents += [self._check_options(method, options.get(method, {}), where) for method in self._methods]
        if name in self._names:
            other = self._names[name]
            raise self._error(
                f"{row}: the point {name} is in {other} already" if row else f"the point {name} is listed twice"
            )
        self._names[name] = row
        other = self._contents.setdefault(tuple(contents), name)
        if other != name:
            raise ConfigError(
                f"{row + ': ' if row else ''}study {self._place[1]}: the points {other} and {name} have the same "
                "settings.",
                self._place,
            )
        return Point(name, condition, values, settings, options)

    def _divide(self, values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Settings of the simulation, and options of each method."""
        settings: dict[str, Any] = {}
        options: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            parameter = self._parameters[name]
            if not parameter.methods:
                settings[name] = value
            for method in parameter.methods:
                options.setdefault(method, {})[parameter.field] = value
        return settings, options

    def _check_settings(self, condition: str, settings: Mapping[str, Any], where: tuple[str, ...]) -> int:
        """Check the settings of a condition; a number for each distinct set of them."""
        if condition not in self._conditions:
            self._check(SimulationSettings, {**self._shared, **settings}, where)
            self._conditions[condition] = {**self._shared, **settings}
            contents = tuple(self._conditions[condition].values())
            self._numbers[condition] = self._numbers.setdefault(contents, len(self._numbers))
        return self._numbers[condition]

    def _check_options(self, method: str, options: Mapping[str, Any], where: tuple[str, ...]) -> int:
        """Check options of a method; a number for each distinct set of them."""
        key = (method, *options.items())
        try:
            known = key in self._checked
        except TypeError:  # a value that is no plain one, which the model refuses
            known = False
        if not known:
            fixed = self._methods[method].options
            chosen = {name: getattr(fixed, name) for name in fixed.model_fields_set}
            place = where if len(self._methods) == 1 else (*where, method)
            checked = self._check(type(fixed), {**chosen, **options}, place)
            contents = (method, *map(repr, dict(checked).values()))
            self._checked[key] = self._numbers.setdefault(contents, len(self._numbers))
        return self._checked[key]

    def _check(self, model: type[Options], values: Mapping[str, Any], where: tuple[str, ...]) -> Options:
        try:
            checked: Options = check(model, values, *where)
        except ConfigError as error:  # keys of a row of a table are no keys of the configuration
            raise error if where[0] == "config" else ConfigError(f"{error}", self._place) from None
        return checked

    def _shared_value(self, parameter: Parameter) -> Any:
        """Value of a parameter at points that do not name it; None where methods differ in it."""
        if not parameter.methods:
            return self._shared[parameter.field]
        values = [getattr(self._methods[method].options, parameter.field) for method in parameter.methods]
        return values[0] if all(value == values[0] for value in values) else None

    def _error(self, message: str) -> ConfigError:
        return ConfigError(f"{' → '.join(('config', *self._place))}: {message}.", self._place)
