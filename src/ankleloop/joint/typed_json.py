"""Diagnostics as text that keeps their types: JSON in which arrays and complex numbers are marked."""

from __future__ import annotations

import json
from base64 import b64decode, b64encode
from collections.abc import Mapping
from typing import Any

import numpy as np

from ankleloop.errors import DataError

__all__ = ["dump_values", "extract_arrays", "load_values"]

ARRAY, BYTES, COMPLEX = "$array", "$bytes", "$complex"  # keys that mark them
LONG = 12  # numbers of an array from which on its bytes take less time and space than its text


def dump_values(values: Any) -> str:
    """Values as JSON; tuples become lists, and the numbers of long arrays their bytes (base 64, little-endian)."""
    return _ENCODER.encode(values)


def load_values(text: str, arrays: Mapping[str, Any] | None = None) -> Any:
    """Values that `dump_values` wrote."""
    try:
        return json.loads(text, object_hook=lambda values: _restore(values, arrays or {}))
    except (KeyError, RecursionError, TypeError, ValueError) as cause:
        raise DataError(f"the values cannot be read ({cause}): the file that holds them is damaged.") from cause


def extract_arrays(values: Any, name: str, arrays: dict[str, np.ndarray]) -> Any:
    """Values in which each array is replaced by its name, its shape and its type."""
    if isinstance(values, np.ndarray):
        _check(values.dtype)
        key = "".join(character if character.isalnum() and character.isascii() else "_" for character in name)[:50]
        while key in arrays or not key:
            key += "_"
        arrays[key] = values
        return {ARRAY: key, "dtype": str(values.dtype), "shape": list(values.shape)}
    prefix = f"{name}_" if name else ""
    if isinstance(values, dict):
        return {key: extract_arrays(value, f"{prefix}{key}", arrays) for key, value in values.items()}
    if isinstance(values, list | tuple):
        return [extract_arrays(value, f"{prefix}{number}", arrays) for number, value in enumerate(values)]
    return values


def _check(dtype: np.dtype) -> None:
    if dtype.kind not in "biufc":
        raise TypeError(f"an array of type {dtype} cannot be kept in diagnostics")


def _mark(value: Any) -> Any:
    """What takes the place of a value that JSON does not have."""
    if isinstance(value, np.ndarray):
        _check(value.dtype)
        flat = value.ravel()
        if flat.size >= LONG:
            little = flat.astype(flat.dtype.newbyteorder("<"), copy=False)
            marks: dict[str, Any] = {BYTES: b64encode(little.tobytes()).decode("ascii")}
        else:
            marks = {ARRAY: (flat.astype(complex).view(float) if flat.dtype.kind == "c" else flat).tolist()}
        if flat.dtype != float:
            marks["dtype"] = str(flat.dtype)
        if value.ndim != 1:
            marks["shape"] = list(value.shape)
        return marks
    if isinstance(value, np.generic):
        return value.item() if value.dtype.kind != "c" else _mark(complex(value))
    if isinstance(value, complex):
        return {COMPLEX: [value.real, value.imag]}
    raise TypeError(f"{type(value).__name__} cannot be kept in diagnostics")


_ENCODER = json.JSONEncoder(default=_mark)


def _restore(values: dict[str, Any], arrays: Mapping[str, Any]) -> Any:
    if COMPLEX in values:
        return complex(*values[COMPLEX])
    if ARRAY not in values and BYTES not in values:
        return values
    numbers, dtype = values.get(ARRAY), np.dtype(values.get("dtype", "float64"))
    _check(dtype)
    if BYTES in values:
        content = b64decode(values[BYTES], validate=True)
        array = np.frombuffer(content, dtype.newbyteorder("<")).astype(dtype)
    elif isinstance(numbers, str):
        array = np.array(arrays[numbers])
        if dtype.kind == "c" and array.dtype.kind != "c":  # pairs of real and imaginary parts
            array = array[..., 0] + 1j * array[..., 1]
        array = array.astype(dtype)
    elif dtype.kind == "c":
        array = np.array(numbers, dtype=float).view(complex).astype(dtype)
    else:
        array = np.array(numbers, dtype=dtype)
    return array.reshape(values.get("shape", -1))
