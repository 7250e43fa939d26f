"""Time and memory of a job, from what its chunk holds and from what was measured (`benchmarks/resources.py`)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

Methods = Mapping[str, Mapping[str, Any]]

MEASURED = Path(__file__).with_name("resources.json")
READ_TRIALS = 25  # trials of a file that are in memory at a time
BLOCK_ROWS = 15  # those of the measured methods
SPARE_MEMORY = 1.5  # a job that takes more than it asked for is ended by the scheduler
SNAKEMAKES = 2  # in each job of Slurm, beside the script
SPARE_TIME = 4.0  # for slower processors, and for cores that are shared
SPARE_MINUTES = 10  # for a file system that is slow, and for compiling the kernels on a new machine


_MEASURED: dict[str, dict[str, float]] = json.loads(MEASURED.read_text(encoding="utf-8"))
# Time of the processor in which a job imports its modules and loads its compiled code [s].
START_SECONDS = _MEASURED["seconds"]["start"]
_STEPS = {name.removesuffix(" trial") for name in _MEASURED["seconds"] if name.endswith(" trial")}
MEASURED_METHODS = sorted(_STEPS - {"simulated", "prepared"})


def simulation_seconds(samples: float) -> float:
    """Time of the processor for the simulation of a trial, and for writing it [s]."""
    seconds = _MEASURED["seconds"]
    return seconds["simulated trial"] + seconds["simulated sample"] * samples


def identification_seconds(samples: float, methods: Methods, recording_rate: float = 1000.0) -> float:
    """Time of the processor for the identification of a trial by some methods, and for its scores [s]."""
    seconds = _MEASURED["seconds"]
    time = seconds["prepared trial"] + seconds["prepared sample"] * samples
    return time + sum(_method_seconds(samples / recording_rate, **method) for method in methods.values())


def _method_seconds(duration: float, method: str, options: Mapping[str, Any] = {}) -> float:
    seconds = _MEASURED["seconds"]
    # Without its delay riv searches one.
    name = "riv-delay" if method == "riv" and options.get("delay", 0.0) is None else method
    factor = 1.0
    if name.endswith("moesp"):
        factor = (options.get("block_rows", BLOCK_ROWS) / BLOCK_ROWS) ** seconds["block rows"]
    if name not in MEASURED_METHODS:  # benchmarks/resources.py has not measured it yet: it counts as the slowest one
        name = max(MEASURED_METHODS, key=lambda measured: seconds[f"{measured} sample"])
    samples = duration * options.get("identification_rate", 100.0)
    return factor * (seconds[f"{name} trial"] + seconds[f"{name} sample"] * samples)


def simulation_memory(samples: float) -> float:
    """Memory of a job that simulates, however many trials it simulates [MB]."""
    memory = _MEASURED["memory"]
    return memory["simulate"] + memory["simulated sample"] * samples


def identification_memory(samples: float, trials: int, methods: float) -> float:
    """Memory of a job that identifies [MB]."""
    memory = _MEASURED["memory"]
    read = memory["identified sample"] * samples * min(trials, READ_TRIALS)
    return memory["identify"] + read + memory["sample of an estimate"] * samples * trials * methods


def recording_seconds(recordings: int) -> float:
    """Time for the analysis and the pages of some recordings of a laboratory [s]."""
    return START_SECONDS + _MEASURED["seconds"]["recording"] * recordings


def recording_memory(largest: int) -> float:
    """Memory of a job that analyses recordings, one after the other [MB]."""
    memory = _MEASURED["memory"]
    return memory["recordings"] + memory["byte of a recording"] * largest


def report_memory(estimates: int) -> float:
    """Memory of a job that reads the tables of a study: its notebook, the ledger, the article [MB]."""
    memory = _MEASURED["memory"]
    return memory["report"] + memory["row of a table"] * estimates


def report_seconds(estimates: int) -> float:
    """Time of a job that reads the tables of a study [s]."""
    seconds = _MEASURED["seconds"]
    return seconds["report"] + seconds["row of a table"] * estimates


def requested_mb(memory: float, attempt: int) -> int:
    """Memory that a job asks a scheduler for, with that of Snakemake, and twice as much at each new attempt [MB]."""
    total = SPARE_MEMORY * memory + SNAKEMAKES * _MEASURED["memory"]["snakemake"]
    return 100 * math.ceil(total / 100) * 2 ** (attempt - 1)


def requested_minutes(seconds: float, attempt: int) -> int:
    """Time that a job asks a scheduler for, and twice as much at each new attempt [min]."""
    return math.ceil(SPARE_MINUTES + SPARE_TIME * seconds / 60) * 2 ** (attempt - 1)
