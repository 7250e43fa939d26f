"""Values of MATLAB as mat-io gives them: structs, cells, tables, times, and objects, `nldat` among them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from matio import load_from_mat
from matio.utils.matclass import MatlabOpaque

from ankleloop.signals.sampling import rate_of_interval
from ankleloop.trials.contents import Tree, Variable, as_text
from ankleloop.trials.units import TIME_UNITS, find_unit_in_name

# Names of columns are texts of Arrow, whose usual allocator takes more address space than a file may.
pa.set_memory_pool(pa.system_memory_pool())
UNSTATED_UNIT = "default units"  # what nldat writes where nobody has stated one


def load_value(path: Path, name: str) -> Tree:
    """A variable of a MATLAB file with all that is in it."""
    values = load_from_mat(path, variable_names=[name], add_table_attrs=True, spmatrix=False)
    return as_tree(values[name])


def as_tree(value: Any) -> Tree:
    """A value with what is in it by name and number; an object has its properties."""
    if isinstance(value, MatlabOpaque):
        return as_tree(value.properties)
    if isinstance(value, pd.DataFrame):
        return _list_columns(value)
    if isinstance(value, Mapping):
        fields = {str(name): as_tree(field) for name, field in value.items()}
        return _list_channels(fields) if {"dataSet", "chanNames"} <= fields.keys() else fields
    array = np.asarray(value)
    if array.dtype.names:
        names = array.dtype.names
        structs = [{name: element[name] for name in names} for element in array.flat]
        if len(structs) == 1:
            return as_tree(structs[0])
        return _as_elements(structs, array.shape)
    is_cell = isinstance(value, np.ndarray) and array.dtype.kind == "O"
    if not is_cell:
        return _as_variable(array)
    if array.size > 1 and all(np.size(cell) == 1 and np.ndim(cell) for cell in array.flat):
        numbers = [np.asarray(cell).item() for cell in array.flat]  # a cell for each sample
        return _as_variable(np.array(numbers, dtype=object))
    return _as_elements(list(array.flat), array.shape)


def _as_elements(values: list[Any], shape: tuple[int, ...]) -> np.ndarray:
    """An array of trees, without the axes of length one."""
    elements = np.empty(len(values), dtype=object)
    for place, value in enumerate(values):
        elements[place] = as_tree(value)
    longer = [size for size in shape if size != 1]
    return elements.reshape(longer or [1])


def _as_variable(array: np.ndarray, unit: str = "") -> Variable:
    """A variable; times are in s, and dates count from the first one."""
    if array.dtype.kind == "M" and array.size:
        array = array - array.flat[0]
    if array.dtype.kind == "m":
        array = array / np.timedelta64(1, "s")
        unit = "s"
    return Variable("", array.shape, partial(np.asarray, array), {"units": unit})


def _list_columns(table: pd.DataFrame) -> dict[str, Tree]:
    """Columns of a table with their units, and the times of a timetable."""
    units = table.attrs.get("VariableUnits") or table.attrs.get("varUnits") or []
    columns: dict[str, Tree] = {}
    if isinstance(table.index, pd.DatetimeIndex | pd.TimedeltaIndex):
        columns["time"] = _as_variable(table.index.to_numpy())
    for place, name in enumerate(table.columns):
        unit = units[place] if len(units) == len(table.columns) else ""
        columns[str(name)] = _as_variable(table[name].to_numpy(), unit)
    return columns


def _list_channels(fields: dict[str, Tree]) -> dict[str, Tree]:
    """Channels of an object of the class nldat with their units, its samples in one matrix, and its rate or times."""
    samples = fields["dataSet"]
    names = _list_texts(fields["chanNames"])
    units = _list_texts(fields.get("chanUnits"))
    units = ["" if unit.lower() == UNSTATED_UNIT else unit for unit in units]
    if len(units) != len(names):
        units = [" and ".join(units)] * len(names)
    channels: dict[str, Tree] = {"dataSet": samples}
    assert isinstance(samples, Variable)
    if len(samples.shape) > 1 and samples.shape[1] == len(names):
        for number, name in enumerate(names):
            if name and names.count(name) == 1:
                channel = samples.part((slice(None), number))
                channels[name] = Variable("", channel.shape, channel.read, {"units": units[number]})
    return {**_find_times(fields, samples.shape[0]), **channels}


def _find_times(fields: dict[str, Tree], size: int) -> dict[str, Tree]:
    """The times of an object of the class nldat, or its sampling rate; neither where its domain is no time."""
    domain = _list_texts(fields.get("domainName"))
    unit = find_unit_in_name(domain[0]) if domain else ""
    if unit and unit not in TIME_UNITS:
        return {}
    times = fields.get("domainValues")
    if isinstance(times, Variable) and np.prod(times.shape) == size > 1:
        return {"time": Variable("", times.shape, times.read, {"units": unit or "s"})}
    interval = fields.get("domainIncr")
    step = float(interval.read().item()) if isinstance(interval, Variable) else 0.0
    if not step > 0.0:
        return {}
    rate = rate_of_interval(step * TIME_UNITS.get(unit, 1.0))
    return {"sampling_rate": _as_variable(np.array([rate]))}


def _list_texts(tree: Tree | None) -> list[str]:
    """Texts of a cell array, or of one variable."""
    if isinstance(tree, Variable):
        return [as_text(text) for text in np.ravel(tree.read())]
    if isinstance(tree, np.ndarray):
        return ["".join(_list_texts(text)) for text in tree.flat]
    return []
