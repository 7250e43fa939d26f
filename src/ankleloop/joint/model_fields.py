"""Models as fields of a file: dataclasses that declare names, dimensions and units are written and read by these."""

from __future__ import annotations

import dataclasses
from types import NoneType
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import xarray as xr

from ankleloop.trials.group_files import Fields

Part = TypeVar("Part")


class Stored(NamedTuple):
    """How a file holds a field of a dataclass."""

    dimension: str | None = None  # of an array; None for a number or a text
    unit: str = ""
    name: str = ""  # in the file, where it is another one


def as_variable(value: Any, *dimensions: str, unit: str = "") -> xr.Variable:
    """A value of a file with its dimensions and its unit."""
    return xr.Variable(dimensions, value, {"units": unit} if unit else {})


def _list_fields(kind: type) -> list[tuple[str, Any, Stored | None]]:
    """Name, type and declaration, None for a dataclass, of each field that is stored."""
    types, fields = get_type_hints(kind, include_extras=True), []
    for field in dataclasses.fields(kind):
        expected = types[field.name]
        if get_origin(expected) is Annotated:
            fields.append((field.name, expected.__origin__, expected.__metadata__[0]))
        elif dataclasses.is_dataclass(expected):
            fields.append((field.name, expected, None))
    return fields


def dump_fields(part: Any) -> dict[str, str | xr.Variable]:
    """Texts and variables of a dataclass and of those in it, by name; without those that are None."""
    values: dict[str, str | xr.Variable] = {}
    for name, _, stored in _list_fields(type(part)):
        value = getattr(part, name)
        if stored is None:
            values |= dump_fields(value)
        elif value is not None:
            dimensions = [stored.dimension] if stored.dimension else []
            text = isinstance(value, str)
            values[stored.name or name] = value if text else as_variable(value, *dimensions, unit=stored.unit)
    return values


def read_fields(kind: type[Part], fields: Fields, **values: Any) -> Part:
    """The dataclass whose fields a file holds, with values that are known already."""
    for field, expected, stored in _list_fields(kind):
        name = stored.name or field if stored else field
        if field in values:
            continue
        if stored is None:
            values[field] = read_fields(expected, fields)
        elif NoneType in get_args(expected) and name not in fields.values:
            values[field] = None
        elif stored.dimension:
            values[field] = fields.array(name)
        elif expected in (int, float, float | None):
            values[field] = int(fields.number(name)) if expected is int else fields.number(name)
        else:
            values[field] = fields.text(name)
    return kind(**values)
