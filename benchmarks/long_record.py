"""Identify a record that does not fit into memory: time and peak memory against its length."""

import tempfile
import time
from pathlib import Path

import h5py
from tools import peak_memory, run_alone

from ankleloop import simulate
from ankleloop.methods.long_records import identify_file
from ankleloop.trials.readers import LongRecord

RATE = 100.0  # Hz
PART = 1000.0  # s: the record consists of simulated trials of this length, end to end


def write_record(path, samples):
    """Write a record of a number of samples, one simulated trial at a time."""
    rates = {
        "recording_rate": RATE,
        "integration_rate": 1000.0,
        "antialias_cutoff": 40.0,
        "noise_rate": RATE,
    }
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate"] = RATE
        for seed, start in enumerate(range(0, samples, round(PART * RATE))):
            trial = simulate(seed=seed, duration=PART, reflex_gain=13.0, **rates).isel(
                time=slice(samples - start)
            )
            for name in ("position", "torque", "reference"):
                variable = file.require_dataset(name, (samples,), float, chunks=(100_000,))
                variable[start : start + trial.sizes["time"]] = trial[name].values


def identify_record(path):
    """Time [s] and peak memory [MiB] of an identification from a file; for a process of its own."""
    start = time.perf_counter()
    options = {"method": "pr-moesp", "basis": "chebyshev"}
    identify_file(LongRecord(path), path.with_name("torques.nc"), **options).torque.close()
    return time.perf_counter() - start, peak_memory()


def measure_record(samples):
    """Row of the table for a record of a number of samples."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "record.h5")
        write_record(path, samples)
        seconds, memory = run_alone(identify_record, path)
    row = {"hours": f"{samples / RATE / 3600:.0f}", "samples": f"{samples:,}"}
    return row | {"seconds": f"{seconds:.1f}", "peak memory [MiB]": f"{memory:.0f}"}
