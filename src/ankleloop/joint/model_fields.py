"""Models as fields of a file: dataclasses that declare names, dimensions and units are written and read by these."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from types import NoneType
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import xarray as xr

from ankleloop.trials.group_files import Fields

Part = TypeVar("Part")


class Stored(NamedTuple):
    """How a file holds a field of a dataclass."""

    dimension: str | tuple[()] = ()  # of an array; none for a number or a text
    unit: str = ""
    name: str = ""  # in the file, where it is another one


def as_variable(value: Any, dimensions: str | Sequence[str] = (), unit: str = "") -> xr.Variable:
    """A value of a file with its dimensions and its unit."""
    return xr.Variable(dimensions, value, {"units": unit} if unit else {})


def _list_fields(kind: type) -> Iterator[tuple[str, Any, Stored | None]]:
    """Name, type and declaration, None for a dataclass, of each field that is stored."""
    for field, declared in get_type_hints(kind, include_extras=True).items():
        if get_origin(declared) is Annotated:
            yield field, *get_args(declared)
        elif dataclasses.is_dataclass(declared):
            yield field, declared, None


def dump_fields(part: Any) -> dict[str, str | xr.Variable]:
    """Texts and variables of a dataclass and of those in it, by name; without those that are None."""
    values: dict[str, str | xr.Variable] = {}
    for field, _, stored in _list_fields(type(part)):
        value = getattr(part, field)
        if stored is None:
            values |= dump_fields(value)
        elif isinstance(value, str):
            values[stored.name or field] = value
        elif value is not None:
            values[stored.name or field] = as_variable(value, stored.dimension, stored.unit)
    return values


def read_fields(kind: type[Part], fields: Fields, **values: Any) -> Part:
    """The dataclass whose fields a file holds, with values that are known already."""
    for field, expected, stored in _list_fields(kind):
        if stored is not None:
            values[field] = _read_field(stored.name or field, expected, stored, fields)
        elif field not in values:
            values[field] = read_fields(expected, fields)
    return kind(**values)


def _read_field(name: str, expected: Any, stored: Stored, fields: Fields) -> Any:
    """A field of the type that is expected."""
    if name not in fields.values and NoneType in get_args(expected):
        return None
    if stored.dimension:
        return fields.array(name)
    if expected is int:
        return int(fields.number(name))
    if expected in (float, float | None):
        return fields.number(name)
    return fields.text(name)
