"""Memory of jobs does not grow with the trials of a chunk, nor that of an identification with a record from a file."""

import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from ankleloop import simulate

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the memory of a process is read from /proc")
TESTS = Path(__file__).parents[1]
MOST = 500e6  # bytes of a job of 10,000 trials
GROWTH = 4e3  # bytes for each trial: its attributes, and its places in temporary files; no signals
# Duration of trials [s], how many fill the buffers of the job and of the libraries, and how many there are.
STEP = 5e6  # bytes by which a peak varies; one channel of each trial that is kept would be 80 MB in the default job
JOBS = {"short": (4.0, 1000, 10_000), "default": (50.0, 100, 300)}

LARGEST_MEMORY = """
import json, logging, sys
from ankleloop import LongRecord, identify_file
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.identification import identify_trials, read_trials
from ankleloop.studies.simulation import simulate_trials
from study_jobs import write_trials

def largest_memory():
    with open("/proc/self/status") as file:
        (line,) = [line for line in file if line.startswith("VmHWM")]
    return 1024 * int(line.split()[1])
"""
# The program prints its largest memory after some trials, after all of them, and at its end.
PROGRAM = """
folder, duration, filled, count = sys.argv[1], float(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])

class Peaks(logging.Handler):
    trials, memory = 0, []
    def emit(self, record):
        if record.msg == "%s: {done} trial %d":
            self.trials += 1
            if self.trials in (filled, count):
                self.memory.append(largest_memory())

peaks = Peaks()
logging.basicConfig(handlers=[peaks], level=logging.INFO)
conditions = {"p": {"settings": SimulationSettings(duration=duration).model_dump(), "first": 0, "stop": count}}
points = {"p": {**conditions["p"], "points": {"p": {"values": {}, "options": {}}}}}
methods = {
    "pr": {"method": "pr-moesp", "options": {"block_rows": 10}},
    "cascade": {"method": "parallel-cascade", "options": {"max_passes": 1}},
}
files = {"scores": f"{folder}/scores.parquet"}
{job}
print(json.dumps([*peaks.memory, largest_memory()]))
"""
STEPS = {
    "simulate": 'write_trials(f"{folder}/trials.nc", "s", 1, conditions)',
    "identify": """
files["estimates"] = f"{folder}/estimates.parquet"
identify_trials(read_trials(f"{folder}/trials.nc", points), files, "s", points, methods, {})
""",
    "sweep": 'identify_trials(simulate_trials("s", 1, conditions), files, "s", points, methods, {})',
}
RECORD = """
identify_file(LongRecord(sys.argv[1]), sys.argv[2]).torque.close()
print(json.dumps(largest_memory()))
"""
# Samples of a record from a file: the basis of the nonlinearity is fitted to as many velocities in both.
SAMPLES = (1_200_000, 4_800_000)
CHANNEL = 8 * (SAMPLES[1] - SAMPLES[0])  # bytes by which a single channel is larger
# As in jobs of the workflow (workflow/rules/common.smk), which keep the memory that they have freed.
ALLOCATION = {"MALLOC_MMAP_THRESHOLD_": str(2**30), "MALLOC_TRIM_THRESHOLD_": str(2**31)}


def run(program, *arguments, **environment):
    """What a program prints, as JSON."""
    path = os.pathsep.join(filter(None, [str(TESTS), os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, **environment, "OMP_NUM_THREADS": "1", "PYTHONPATH": path}
    command = [sys.executable, "-c", LARGEST_MEMORY + program, *arguments]
    process = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)


@pytest.mark.parametrize("length", JOBS)
def test_memory_does_not_grow_with_the_trials_of_a_chunk(tmp_path, length):
    duration, filled, count = JOBS[length]
    megabytes = {}
    for name, step in STEPS.items():
        done = "simulated" if name == "simulate" else "identified"
        program = PROGRAM.replace("{job}", step).replace("{done}", done)
        few, many, end = run(program, str(tmp_path), str(duration), str(filled), str(count), **ALLOCATION)
        megabytes[name] = [round(peak / 1e6) for peak in (few, many, end)]
        assert many - few < STEP + GROWTH * (count - filled), (name, megabytes)
        assert end < MOST, (name, megabytes)


def test_memory_does_not_grow_with_the_length_of_a_record(tmp_path):
    """Trials end to end, at 100 Hz."""
    trial = simulate(
        seed=1, duration=1000.0, recording_rate=100.0, integration_rate=1000.0, antialias_cutoff=40.0, noise_rate=100.0
    )
    peaks = []
    for samples in SAMPLES:
        path = tmp_path / f"{samples}.h5"
        with h5py.File(path, "w") as file:
            file.attrs["sampling_rate"] = 100.0
            for name in ("position", "torque", "reference"):
                variable = file.create_dataset(name, (samples,), float)
                for start in range(0, samples, trial.sizes["time"]):
                    variable[start : start + trial.sizes["time"]] = trial[name].values
        peaks.append(run(RECORD, str(path), str(tmp_path / f"{samples}.nc")))
    assert peaks[1] - peaks[0] < CHANNEL, peaks
