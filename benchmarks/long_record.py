"""Identify a record that does not fit into memory: time and peak memory against its length.

`python benchmarks/long_record.py` takes 36,000,000 samples, 100 hours at 100 Hz; `--samples 3600000` takes a tenth of
the time. The last line that it prints is its result as JSON.
"""

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from pathlib import Path

import h5py
from tools import peak_memory

from ankleloop.methods.long_records import identify_file
from ankleloop.simulation.simulate import simulate
from ankleloop.trials.long_record import LongRecord

RATE = 100.0  # Hz
PART = 1000.0  # s: the record consists of simulated trials of this length, end to end
OPTIONS = {"method": "pr-moesp", "basis": "chebyshev"}
CHANNELS = ("position", "torque", "reference")


def write_record(path, samples):
    """Write a record of a number of samples, one simulated trial at a time."""
    settings = {
        "duration": PART,
        "recording_rate": RATE,
        "integration_rate": 1000.0,
        "antialias_cutoff": 40.0,
        "noise_rate": RATE,
        "reflex_gain": 13.0,
    }
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate"] = RATE
        variables = {name: file.create_dataset(name, (samples,), float, chunks=(100_000,)) for name in CHANNELS}
        start = 0
        for seed in range(-(-samples // round(PART * RATE))):
            trial = simulate(seed=seed, **settings)
            stop = min(start + trial.sizes["time"], samples)
            for name, variable in variables.items():
                variable[start:stop] = trial[name].values[: stop - start]
            start = stop
            print(f"\rsimulated {100 * start / samples:.0f} %", end="", file=sys.stderr)
    print(file=sys.stderr)


def print_progress(name, share):
    """Progress of a pass."""
    print(f"\r{name} {100 * share:.0f} %   ", end="" if share < 1 else "\n", file=sys.stderr)


def main():
    """Write the record, in a process of its own, and identify it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=36_000_000)
    samples = parser.parse_args().samples
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "record.h5")
        # Not in this process, whose memory is measured.
        writer = multiprocessing.get_context("spawn").Process(target=write_record, args=(path, samples))
        writer.start()
        writer.join()
        if writer.exitcode:
            raise SystemExit("the record could not be written.")
        start = time.perf_counter()
        estimate = identify_file(LongRecord(path), Path(folder, "torques.nc"), progress=print_progress, **OPTIONS)
        seconds = time.perf_counter() - start
        estimate.torque.close()
    result = {"samples": samples, "hours": samples / RATE / 3600, "seconds": seconds, "mib": peak_memory()}
    print(json.dumps({**result, "vaf": float(estimate.diagnostics["vaf"]), **estimate.stiffness}))


if __name__ == "__main__":
    main()
