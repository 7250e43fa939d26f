"""Memory of jobs does not grow with the trials of a chunk."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="the memory of a process is read from /proc"
)
TESTS = Path(__file__).parents[1]
MOST = 500e6  # bytes of a job
STEP = 5e6  # bytes by which a peak varies
GROWTH = 4e3  # bytes for each trial: its attributes, and its places in temporary files; a signal of 4 s has 32,000
# Trials that fill the buffers of the job and of the libraries, and how many there are.
FILLED, COUNT = 1000, 4000


IMPORTS = """
import json, logging, sys
from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.jobs.identification import identify_trials, read_trials
from ankleloop_workflow.jobs.simulation import simulate_trials
from study_jobs import write_trials

def largest_memory():
    with open("/proc/self/status") as file:
        (line,) = [line for line in file if line.startswith("VmHWM")]
    return 1024 * int(line.split()[1])
"""
# The program prints its largest memory after some trials, after all of them, and at its end.
JOB = """
folder, job, filled, count = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
last = 2 * count if job == "sweep" else count  # messages of a simulation and of an identification

class Peaks(logging.Handler):
    trials, memory = 0, []
    def emit(self, record):
        if record.msg.endswith(" trial %d"):
            self.trials += 1
            if self.trials in (filled, last):
                self.memory.append(largest_memory())

peaks = Peaks()
logging.basicConfig(handlers=[peaks], level=logging.INFO)
conditions = {"p": {"settings": SimulationSettings(duration=4.0).model_dump(), "first": 0, "stop": count}}
points = {"p": {**conditions["p"], "points": {"p": {"values": {}, "options": {}}}}}
methods = {
    "pr": {"method": "pr-moesp", "options": {"block_rows": 10}},
    "cascade": {"method": "parallel-cascade", "options": {"max_passes": 1}},
}
files = {"scores": f"{folder}/scores.parquet"}
if job == "simulate":
    write_trials(f"{folder}/trials.nc", "s", 1, conditions)
elif job == "identify":
    files["estimates"] = f"{folder}/estimates.parquet"
    identify_trials(read_trials(f"{folder}/trials.nc", points), files, "s", points, methods, {})
else:
    identify_trials(simulate_trials("s", 1, conditions), files, "s", points, methods, {})
print(json.dumps([*peaks.memory, largest_memory()]))
"""
# As in jobs of the workflow (workflow/rules/common.smk), which keep the memory that they have freed.
ALLOCATION = {"MALLOC_MMAP_THRESHOLD_": str(2**30), "MALLOC_TRIM_THRESHOLD_": str(2**31)}


def run(program, *arguments, **environment):
    """What a program prints, as JSON."""
    path = os.pathsep.join(filter(None, [str(TESTS), os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, **environment, "OMP_NUM_THREADS": "1", "PYTHONPATH": path}
    command = [sys.executable, "-c", IMPORTS + program, *map(str, arguments)]
    process = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)


def test_memory_does_not_grow_with_the_trials_of_a_chunk(tmp_path):
    peaks = {}
    for job, steps in (("simulate", 1), ("identify", 1), ("sweep", 2)):
        few, many, end = peaks[job] = run(JOB, tmp_path, job, steps * FILLED, COUNT, **ALLOCATION)
        assert many - few < STEP + GROWTH * (COUNT - FILLED), peaks
        assert end < MOST, peaks
