"""Diagnostics as text that keeps their types: JSON in which arrays and complex numbers are marked."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ankleloop.errors import DataError

ARRAY, COMPLEX = "$array", "$complex"  # keys that mark them


def dump_values(values: Any) -> str:
    """Values as JSON; tuples become lists, complex numbers pairs."""
    return json.dumps(values, default=_mark)


def load_values(text: str, source: str) -> Any:
    """Values that `dump_values` wrote."""
    try:
        return json.loads(text, object_hook=_restore)
    except (KeyError, RecursionError, TypeError, ValueError) as cause:
        raise DataError(f"{source}: the values cannot be read ({cause}): the file is damaged.") from cause


def _mark(value: Any) -> Any:
    """What takes the place of a value that JSON does not have."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biufc":
            raise TypeError(f"an array of type {value.dtype} cannot be kept in diagnostics")
        numbers = value.ravel().astype(complex).view(float) if value.dtype.kind == "c" else value.ravel()
        return {ARRAY: numbers.tolist(), "dtype": str(value.dtype), "shape": list(value.shape)}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, complex):
        return {COMPLEX: [value.real, value.imag]}
    raise TypeError(f"{type(value).__name__} cannot be kept in diagnostics")


def _restore(values: dict[str, Any]) -> Any:
    if COMPLEX in values:
        return complex(*values[COMPLEX])
    if ARRAY not in values:
        return values
    dtype = np.dtype(values["dtype"])
    if dtype.kind not in "biufc":
        raise TypeError(f"an array of type {dtype}")
    array = np.array(values[ARRAY], dtype=float if dtype.kind == "c" else dtype)
    return (array.view(complex).astype(dtype) if dtype.kind == "c" else array).reshape(values["shape"])
