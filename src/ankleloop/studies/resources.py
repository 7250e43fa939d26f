"""Time and memory of a job, from what its chunk holds and from what was measured (`benchmarks/resources.py`)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

MEASURED = Path(__file__).with_name("resources.json")
BLOCK_ROWS = 15  # those of the measured methods
MEMORY = 2000  # MB of a job, as much again at each new attempt: no job of usual trials takes more than half of it
SPARE_TIME = 4.0  # for slower processors, and for cores that are shared
SPARE_MINUTES = 10  # for a file system that is slow, and for compiling the kernels on a new machine

_SECONDS: dict[str, float] = json.loads(MEASURED.read_text(encoding="utf-8"))["seconds"]
# Time of the processor in which a job imports its modules and loads its compiled code [s].
START_SECONDS = _SECONDS["start"]
RECORDING_SECONDS = _SECONDS["recording"]  # for the analysis and the page of a recording of a laboratory [s]
MEASURED_METHODS = sorted(
    {name.removesuffix(" trial") for name in _SECONDS if name.endswith(" trial")} - {"simulated", "prepared"}
)


def simulation_seconds(samples: float) -> float:
    """Time of the processor for the simulation of a trial, and for writing it [s]."""
    return _SECONDS["simulated trial"] + _SECONDS["simulated sample"] * samples


def identification_seconds(
    samples: float, methods: Mapping[str, Mapping[str, Any]], recording_rate: float = 1000.0
) -> float:
    """Time of the processor for the identification of a trial by some methods, and for its scores [s]."""
    seconds = _SECONDS["prepared trial"] + _SECONDS["prepared sample"] * samples
    for entry in methods.values():
        name, options = entry["method"], entry.get("options", {})
        if name == "riv" and options.get("delay", 0.0) is None:  # without its delay riv searches one
            name = "riv-delay"
        if name not in MEASURED_METHODS:  # it counts as the slowest one
            name = max(MEASURED_METHODS, key=lambda measured: _SECONDS[f"{measured} sample"])
        identified = samples / recording_rate * options.get("identification_rate", 100.0)
        cost = _SECONDS[f"{name} trial"] + _SECONDS[f"{name} sample"] * identified
        rows = options.get("block_rows", BLOCK_ROWS) / BLOCK_ROWS if name.endswith("moesp") else 1.0
        seconds += cost * rows ** _SECONDS["block rows"]
    return seconds


def requested_minutes(seconds: float, attempt: int) -> int:
    """Time that a job asks a scheduler for, and twice as much at each new attempt [min]."""
    return math.ceil(SPARE_MINUTES + SPARE_TIME * seconds / 60) * 2 ** (attempt - 1)
