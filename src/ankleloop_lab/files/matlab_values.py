"""Values of MATLAB as mat-io gives them: structs, cells, tables, times, and objects, `nldat` among them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matio import load_from_mat
from matio.utils.matclass import MatlabOpaque

from ankleloop.options import as_text
from ankleloop.signals.sampling import rate_of_interval
from ankleloop_lab.files.contents import Variable
from ankleloop_lab.files.units import seconds_of, split_time


def load_parts(path: Path, name: str) -> list[Variable]:
    """The variables in a value of a MATLAB file, by their full names; none where mat-io cannot read it."""
    with suppress(Exception):
        values = load_from_mat(path, variable_names=[name], add_table_attrs=True, spmatrix=False)
        return list(_list_parts(values[name], name))
    return []


def _list_parts(value: Any, name: str) -> Iterator[Variable]:
    """Variables in a value; elements of struct and cell arrays are numbered, an object has its properties."""
    if isinstance(value, MatlabOpaque):
        value = value.properties
    if isinstance(value, pd.DataFrame):
        value = _list_columns(value)
    if isinstance(value, Mapping) and {"dataSet", "chanNames", "chanUnits"} <= value.keys():
        value = _list_channels(value)
    if isinstance(value, Mapping):
        for field, part in value.items():
            yield from _list_parts(part, f"{name}.{field}")
        return
    if isinstance(value, Variable):
        yield replace(value, name=name)
        return
    array = np.asarray(value)
    elements = list(array.ravel("F"))
    if array.dtype.names:
        elements = [{field: struct[field] for field in array.dtype.names} for struct in elements]
    elif not isinstance(value, np.ndarray) or array.dtype != object or _has_numbers(elements):
        yield _as_variable(array, name=name)
        return
    for number, element in enumerate(elements):
        yield from _list_parts(element, f"{name}[{number}]" if len(elements) > 1 else name)


def _has_numbers(cells: Sequence[Any]) -> bool:
    """Whether cells have one number or text each, as samples have."""
    return all(np.size(cell) == 1 and np.asarray(cell).dtype.kind in "biufcSTU" for cell in cells)


def _as_variable(array: np.ndarray, unit: str = "", name: str = "") -> Variable:
    """A variable; times are in s, and dates count from the first one."""
    if array.dtype == object and array.ndim:
        array = np.array([np.asarray(cell).item() for cell in array.flat], dtype=object)
    if array.dtype.kind == "M" and array.size:
        array = array - array.flat[0]
    if array.dtype.kind == "m":
        array = array / np.timedelta64(1, "s")
        unit = "s"
    return Variable(name, array.shape, partial(np.asarray, array), {"units": unit})


def _list_columns(table: pd.DataFrame) -> dict[str, Variable]:
    """Columns of a table with their units, and the times of a timetable."""
    units = table.attrs.get("VariableUnits") or table.attrs.get("varUnits") or []
    columns = {}
    if isinstance(table.index, pd.DatetimeIndex | pd.TimedeltaIndex):
        columns["time"] = _as_variable(table.index.to_numpy())
    if len(units) != len(table.columns):  # a matrix has become several columns
        units = [""] * len(table.columns)
    for (name, column), unit in zip(table.items(), units, strict=True):
        columns[str(name)] = _as_variable(column.to_numpy(), unit)
    return columns


def _list_channels(properties: Mapping[str, Any]) -> dict[str, Variable]:
    """Channels of an object of the class nldat with their units, and its rate or times.

    Where not each has a name of its own, there are its samples in one matrix as well.
    """
    samples = _as_variable(np.asarray(properties["dataSet"]))
    names = [as_text(name) for name in np.ravel(properties["chanNames"])]
    units = [as_text(unit) for unit in np.ravel(properties["chanUnits"])]
    if len(units) != len(names):
        units = [" and ".join(dict.fromkeys(units))] * len(names)
    channels = {}
    if samples.shape[1:2] == (len(names),):
        for number, name in enumerate(names):
            if name and names.count(name) == 1:
                channel = samples.part(f":, {number}")
                channels[name] = replace(channel, attributes={"units": units[number]})
    if len(channels) < len(names):
        channels["dataSet"] = samples
    return {**_find_times(properties), **channels}


def _find_times(properties: Mapping[str, Any]) -> dict[str, Variable]:
    """The times of an object of the class nldat, or else its sampling rate."""
    unit = split_time(as_text(properties.get("domainName", "")))[1] or "s"
    times = np.ravel(properties.get("domainValues", 0.0))
    if times.size > 1:
        return {"time": _as_variable(times, unit)}
    interval = float(np.ravel(properties["domainIncr"])[0]) * (seconds_of(unit) or math.nan)
    if not interval > 0.0:
        return {}
    return {"sampling_rate": _as_variable(np.array([rate_of_interval(interval)]))}
