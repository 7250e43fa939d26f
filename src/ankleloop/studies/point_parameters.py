"""Parameters of a sweep: settings of the simulation and options of methods by name, and their values."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Union, get_args, get_origin

from ankleloop.methods.registry import METHODS
from ankleloop.options import Options, as_plain, show_value, suggest_name
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.checking import ConfigError

if TYPE_CHECKING:
    from ankleloop.studies.method_settings import MethodSettings

SETTINGS = tuple(SimulationSettings.model_fields)


class Parameter(NamedTuple):
    """What a name in `points` stands for.

    Parameters
    ----------
    column : str
        The name, which is also that of its column in tables.
    field : str
        Name of the setting or option.
    owner : type of Options
        Model that has it.
    methods : tuple of str
        Methods of the study whose option it is; none of a setting of the simulation.
    """

    column: str
    field: str
    owner: type[Options]
    methods: tuple[str, ...] = ()

    @property
    def types(self) -> tuple[Any, ...]:
        """Types, and literal values, that it takes."""
        return _list_types(self.owner.model_fields[self.field].annotation)

    @property
    def is_integer(self) -> bool:
        """Whether its numbers are whole ones."""
        return int in self.types or any(type(kind) is int for kind in self.types)

    @property
    def is_number(self) -> bool:
        """Whether it takes numbers."""
        return float in self.types or self.is_integer

    @property
    def allows_none(self) -> bool:
        """Whether null is one of its values."""
        return NoneType in self.types or None in self.types

    def normalise(self, value: Any) -> Any:
        """A value as the model has it, so that 13 and 13.0, 0.0 and -0.0 make one point with one name and one seed."""
        value = as_plain(value)
        if isinstance(value, (list, tuple, Mapping)):
            raise ValueError(f"{self.column}: each value must be a single one, got {show_value(value)}")
        if type(value) in (int, float):
            if float in self.types:
                with suppress(OverflowError):  # of a whole number beyond all floats, which the model refuses
                    return float(value) + 0.0
            elif self.is_integer and type(value) is float and value.is_integer():
                return int(value)
        return value


def find_parameters(
    names: list[str], methods: Mapping[str, MethodSettings], place: tuple[str, ...]
) -> dict[str, Parameter]:
    """What the names in `points` stand for.

    A name is that of a setting, or else that of an option, of every method that has it; `METHOD.option` is that of one.
    """
    parameters = {name: _find_parameter(name, methods, place) for name in names}
    owners: dict[tuple[str, str], str] = {}
    for name, parameter in parameters.items():
        for method in parameter.methods:
            _check_free(parameter, method, methods[method], place)
            other = owners.setdefault((method, parameter.field), name)
            if other != name:
                raise _error(place, f"{other} and {name} are the same option of the method {method}: leave one out")
    return parameters


def _find_parameter(name: str, methods: Mapping[str, MethodSettings], place: tuple[str, ...]) -> Parameter:
    if name in SETTINGS:
        return Parameter(name, name, SimulationSettings)
    method, dot, option = str(name).rpartition(".")
    if dot:
        if method not in methods:
            close = suggest_name(method, methods)
            known = ", ".join(methods)
            raise _error(
                place, f"{name!r}: the study has no method {method!r}{close}; its methods: {known}; add one to methods"
            )
        owner = type(methods[method].options)
        if option not in owner.model_fields:
            close = suggest_name(option, owner.model_fields)
            known = ", ".join(owner.model_fields)
            raise _error(place, f"{name!r}: the method {method} has no option {option!r}{close}; known: {known}")
        return Parameter(name, option, owner, (method,))
    owners = {key: type(settings.options) for key, settings in methods.items()}
    members = tuple(key for key, owner in owners.items() if name in owner.model_fields)
    if not members:
        options = list(dict.fromkeys(field for owner in owners.values() for field in owner.model_fields))
        others = [key for key, method in METHODS.items() if name in method.options.model_fields]
        if others:
            raise _error(place, f"{name!r} is an option of {', '.join(others)}: the study has no such method; add one")
        raise _error(
            place,
            f"{name!r} is not a setting of the simulation{suggest_name(name, [*SETTINGS, *options])}; known: "
            f"{', '.join(SETTINGS)}; nor an option of a method of the study; known: {', '.join(options)}",
        )
    return Parameter(name, name, owners[members[0]], members)


def _check_free(parameter: Parameter, method: str, settings: MethodSettings, place: tuple[str, ...]) -> None:
    """Refuse an option that has a value, or candidates, in the settings of its method as well."""
    for key, names in (("options", settings.options.model_fields_set), ("select", settings.select)):
        if parameter.field in names:
            raise _error(
                place,
                f"{parameter.column}: the method {method} has {parameter.field} under {key} as well: leave it out of "
                f"one of them{'' if '.' in parameter.column else f', or name methods: METHOD.{parameter.field}'}",
            )


def _error(place: tuple[str, ...], message: str) -> ConfigError:
    return ConfigError(f"{' → '.join(('config', *place))}: {message}.", place)


def _list_types(annotation: Any) -> tuple[Any, ...]:
    """Members of a union, and the values of a Literal, in one list."""
    origin = get_origin(annotation)
    if origin in (Union, UnionType):
        return tuple(kind for member in get_args(annotation) for kind in _list_types(member))
    return get_args(annotation) if origin is Literal else (annotation,)
