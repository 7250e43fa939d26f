"""Numbers of a variable from its samples as stored: scale, offset and missing samples, by one rule for all files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ankleloop.errors import DataError

# Attributes by the conventions of NetCDF and CF, which HDF5 files of laboratories follow, too.
MISSING = ("_FillValue", "missing_value")
UNWRITTEN = 9.969209968386869e36  # what NetCDF libraries put where no sample was written


def decode(values: np.ndarray, attributes: Mapping[str, Any], *, source: str, name: str) -> np.ndarray:
    """Apply scale, offset and missing values that the attributes of a variable state.

    A sample is `stored · scale_factor + add_offset`; one that equals `_FillValue` or `missing_value` as stored, or was
    never written to a NetCDF file, becomes nan. `_Unsigned` turns integers into those without a sign.
    """
    if values.dtype.kind not in "iuf":
        return values
    missing = _find_missing(values, attributes)
    if as_text(attributes.get("_Unsigned", "")).lower() == "true" and values.dtype.kind == "i":
        values = values.view(values.dtype.str.replace("i", "u"))  # the markers have the signed type as stored
    factor = _read_number(attributes, "scale_factor", 1.0, source, name)
    offset = _read_number(attributes, "add_offset", 0.0, source, name)
    if factor == 0.0:
        raise DataError(f"{source}: scale_factor of {name} is 0, so that all samples are alike: correct the file.")
    if missing is None and (factor, offset) == (1.0, 0.0):
        return values
    with np.errstate(over="ignore"):  # an infinite sample is refused by its number later on
        numbers = values.astype(float) * factor + offset
    if missing is not None:
        numbers[missing] = np.nan
    return numbers


def _find_missing(values: np.ndarray, attributes: Mapping[str, Any]) -> np.ndarray | None:
    """Mask of the samples that are missing; None if there are none."""
    markers = [marker for key in MISSING for marker in _as_numbers(attributes.get(key, ()))]
    if values.dtype.kind == "f":
        markers.append(UNWRITTEN)
    with np.errstate(over="ignore", invalid="ignore"):
        # A marker has the type of the samples; another one is rounded to it, as libraries round it when they write.
        stored = [values.dtype.type(marker) for marker in markers if _fits(marker, values.dtype)]
    mask = np.isin(values, np.array(stored, dtype=values.dtype)) if stored else np.zeros(values.shape, dtype=bool)
    return mask if mask.any() else None


def _fits(marker: float, dtype: np.dtype[Any]) -> bool:
    if dtype.kind == "f":
        return True
    limits = np.iinfo(dtype)
    if not (np.isfinite(marker) and marker == int(marker)):
        return False
    return int(limits.min) <= int(marker) <= int(limits.max)


def _as_numbers(value: Any) -> list[Any]:
    array = np.ravel(np.asarray(value))
    return array.tolist() if array.dtype.kind in "iuf" else []


def _read_number(attributes: Mapping[str, Any], key: str, default: float, source: str, name: str) -> float:
    if key not in attributes:
        return default
    array = np.ravel(np.asarray(attributes[key]))
    if array.size != 1 or array.dtype.kind not in "iuf" or not np.isfinite(array[0]):
        raise DataError(f"{source}: {key} of {name} is no finite number ({shorten(array)}): correct the file.")
    return float(array[0])


def shorten(value: Any) -> str:
    """Text of a value, of 60 characters at most."""
    text = str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def as_text(value: Any) -> str:
    """Text of an attribute, which libraries give as text, bytes or an array of one of them; "" for what is no text."""
    array = np.asarray(value)
    if array.size != 1 or array.dtype.kind not in "OSU":
        return ""
    item = array.item()
    text = item.decode(errors="replace") if isinstance(item, bytes) else item
    return text.strip("\x00 \t\r\n") if isinstance(text, str) else ""
