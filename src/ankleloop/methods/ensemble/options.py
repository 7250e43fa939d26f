"""Options of `ensemble`."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import field_validator

from ankleloop.methods.method import MethodOptions
from ankleloop.options import as_plain, option


class EnsembleOptions(MethodOptions):
    """Options of an ensemble of windows around perturbations."""

    onsets: tuple[float, ...] | str | None = option(
        None,
        "onset of the perturbation in each window of a record, or the variable that rises there; null for a list of "
        "windows",
        unit="s",
    )
    condition: tuple[str | bool | float, ...] | str | None = option(
        None,
        "what was commanded in each window of a record, or the variable that says so at the onset; null for a list of "
        "windows, whose attributes say it",
    )
    onset: float | None = option(
        None,
        "time of the onset from the start of each window of a list; null: as their attributes say",
        unit="s",
        ge=0,
        le=1000,
    )
    window: tuple[float, float] | None = option(
        None,
        "start and end of what is used of each window, from the onset; null: as it was cut, else -0.1 to 0.25",
        unit="s",
    )
    delay: float | None = option(
        None, "reflex delay; null estimates it", unit="s", ge=0.015, le=0.15
    )
    slope: bool = option(True, "whether K changes within the window, linearly in time")
    moment: float = option(
        0.1, "time from the onset at which K is given if it changes", unit="s", ge=0, le=1
    )
    offsets: bool | None = option(
        None,
        "whether the torque of each condition has an offset of its own; null: where they differ before the onset",
    )

    @field_validator("onsets", "condition", "window", mode="before")
    @classmethod
    def _as_tuple(cls, values: Any) -> Any:
        """Values come as lists from YAML and as arrays from NumPy."""
        if isinstance(values, (list, tuple, np.ndarray)):
            return tuple(map(as_plain, values))
        return values
