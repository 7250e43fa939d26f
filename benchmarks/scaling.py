"""How a sweep scales: cores, the start of a job, files and disk; the sweep goes through the whole workflow.

Run by: python benchmarks/scaling.py --trials 2000
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
import yaml

ROOT = Path(__file__).resolve().parents[1]
SNAKEMAKE = Path(sys.executable).with_name("snakemake")
DURATION = 10.0  # of a trial [s]
METHODS = {"pr-moesp": {"method": "pr-moesp"}, "riv": {"method": "riv"}}
POINTS = {"reflex_gain": [8.0, 16.0], "voluntary": [0.05, 0.3], "pr-moesp.block_rows": [12, 18]}
CONDITIONS = 4  # the option simulates nothing again
JOB_MINUTES = 0.5  # so that even a short run has several jobs


def make_sweep(trials, keep="scores", job_minutes=JOB_MINUTES):
    """Configuration of a sweep over two settings and an option of a method, with two methods."""
    return {
        "run": ["sweep"],
        "studies": {
            "sweep": {
                "kind": "simulation",
                "notebook": None,
                "trials": trials // CONDITIONS,
                "seed": 1,
                "keep": keep,
                "job_minutes": job_minutes,
                "simulation": {"duration": DURATION},
                "points": POINTS,
                "methods": METHODS,
            }
        },
    }


def run_sweep(trials, cores, keep="scores"):
    """Run a sweep in a new folder; what it took and what it left.

    Returns
    -------
    dict
        Time that passed and that of the processor [s], jobs, files, and their size [bytes].
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "sweep.yaml"
        file.write_text(yaml.safe_dump(make_sweep(trials, keep)), encoding="utf-8")
        path = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
        command = [SNAKEMAKE, "--snakefile", ROOT / "Snakefile", "--cores", str(cores), "--configfile", file]
        before, start = _children_seconds(), time.perf_counter()
        subprocess.run(
            command, cwd=folder, env={**os.environ, "PYTHONPATH": path}, check=True, stderr=subprocess.DEVNULL
        )
        seconds, processor = time.perf_counter() - start, _children_seconds() - before
        rules = {"sweep", "sweep_estimates", "simulate", "identify"}
        jobs = sum(len(list((folder / "logs" / rule).rglob("*.tsv"))) for rule in rules)
        results = [path for path in (folder / "results").rglob("*") if path.is_file()]
        return {
            "trials": trials,
            "cores": cores,
            "seconds": seconds,
            "processor": processor,
            "jobs": jobs,
            "files": len(results),
            "bytes": sum(path.stat().st_size for path in results),
        }


def _children_seconds():
    """Time of the processor of all child processes that have ended [s]."""
    times = psutil.Process().cpu_times()
    return times.children_user + times.children_system


def scale_cores(trials):
    """Runs that show strong scaling (the same trials) and weak scaling (twice the trials) on one and on two cores."""
    return [run_sweep(trials, 1), run_sweep(trials, 2), run_sweep(2 * trials, 2)]


def main():
    """Run the sweeps and print them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=2000)
    arguments = parser.parse_args()
    for row in scale_cores(arguments.trials):
        print(json.dumps(row))


if __name__ == "__main__":
    main()
