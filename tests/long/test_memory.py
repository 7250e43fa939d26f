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
identify_chunk(f"{folder}/trials.nc", files, "s", {"p": {}}, methods)
"""
PEAK = """
import resource, sys
folder, count = sys.argv[1], int(sys.argv[2])
{job}
print(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the unit of the peak is that of Linux")
def test_memory_does_not_grow_with_the_trials_of_a_chunk(tmp_path):
    peaks = {"simulate": [], "identify": []}
    for count in COUNTS:
        for name, job in (("simulate", SIMULATE), ("identify", IDENTIFY)):
            program = [sys.executable, "-c", PEAK.replace("{job}", job), str(tmp_path), str(count)]
            environment = {**os.environ, "OMP_NUM_THREADS": "1"}
            process = subprocess.run(program, env=environment, capture_output=True, text=True)
            assert process.returncode == 0, process.stderr
            peaks[name].append(float(process.stdout))
    for name, (few, many) in peaks.items():
        growth = (many - few) / (COUNTS[1] - COUNTS[0])
        assert growth < GROWTH, (name, peaks)
        assert many + growth * (10_000 - COUNTS[1]) < MOST, (name, peaks)
