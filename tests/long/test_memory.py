"""Jobs hold no trial longer than they need it: their memory does not grow with the trials of a chunk."""

import os
import subprocess
import sys

import pytest

COUNTS = (1000, 2500)  # buffers of the libraries are filled by then
GROWTH = 20e3  # bytes for each trial, whose signals are 224 kB
MOST = 500e6  # bytes of a job of 10,000 trials

SIMULATE = """
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.simulation import simulate_chunk
settings = SimulationSettings(duration=4.0).model_dump()
simulate_chunk(f"{folder}/trials.nc", "s", 1, {"p": {"settings": settings, "first": 0, "stop": count}})
"""
IDENTIFY = """
from ankleloop.studies.identification import identify_chunk
files = {"estimates": f"{folder}/e.nc", "scores": f"{folder}/s.csv", "parameters": f"{folder}/p.csv"}
methods = {
    "pr": {"method": "pr-moesp", "options": {"block_rows": 10}},
    "cascade": {"method": "parallel-cascade", "options": {"max_passes": 1}},
}
points = {"p": {"p": {"values": {}, "options": {}}}}
identify_chunk(f"{folder}/trials.nc", files, "s", points, methods)
"""
SWEEP = """
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.sweep_job import sweep_chunk
files = {"scores": f"{folder}/0-s.csv", "parameters": f"{folder}/0-p.csv"}
methods = {
    "pr": {"method": "pr-moesp", "options": {"block_rows": 10}},
    "cascade": {"method": "parallel-cascade", "options": {"max_passes": 1}},
}
settings = SimulationSettings(duration=4.0).model_dump()
conditions = {"p": {"settings": settings, "first": 0, "stop": count}}
sweep_chunk(files, "s", 1, conditions, {"p": {"p": {"values": {}, "options": {}}}}, methods)
"""
TABLE = """
from ankleloop.replication.trial_tables import write_trial_table
write_trial_table(f"{folder}/t.parquet", [f"{folder}/0-p.csv"] * count, [f"{folder}/0-s.csv"] * count)
"""
PEAK = """
import resource, sys
folder, count = sys.argv[1], int(sys.argv[2])
{job}
print(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def measure_peak(job, folder, count):
    """Peak of the memory of a job [bytes]."""
    program = [sys.executable, "-c", PEAK.replace("{job}", job), str(folder), str(count)]
    process = subprocess.run(program, env={**os.environ, "OMP_NUM_THREADS": "1"}, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    return float(process.stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="the unit of the peak is that of Linux")
def test_memory_does_not_grow_with_the_trials_of_a_chunk(tmp_path):
    peaks = {"simulate": [], "identify": [], "sweep": []}
    for count in COUNTS:
        for name, job in (("simulate", SIMULATE), ("identify", IDENTIFY), ("sweep", SWEEP)):
            peaks[name].append(measure_peak(job, tmp_path, count))
    for name, (few, many) in peaks.items():
        growth = (many - few) / (COUNTS[1] - COUNTS[0])
        assert growth < GROWTH, (name, peaks)
        assert many + growth * (10_000 - COUNTS[1]) < MOST, (name, peaks)


@pytest.mark.skipif(sys.platform != "linux", reason="the unit of the peak is that of Linux")
def test_memory_does_not_grow_with_the_table_of_a_study(tmp_path):
    measure_peak(SWEEP, tmp_path, COUNTS[0])
    chunks = (20, 200)  # of 2000 rows each
    few, many = (measure_peak(TABLE, tmp_path, count) for count in chunks)
    rows = 2 * COUNTS[0] * (chunks[1] - chunks[0])
    assert many - few < 50 * rows, (few, many)  # a row has more than 30 numbers of 8 bytes
