"""How large studies scale: what a dry run costs, and a sweep through the whole workflow on one and two cores.

A dry run reads and checks the configuration, divides trials among jobs and lists the jobs.
"""

import re
import tempfile
import time
from pathlib import Path

import pandas as pd
from tools import run_workflow

from ankleloop_workflow.config.run import read_run

TRIALS = 100  # of each point of a dry run
POINTS = {"reflex_gain": [8.0, 16.0], "voluntary": [0.05, 0.3], "pr-moesp.block_rows": [12, 18]}
CONDITIONS = 4  # the option simulates nothing again


def make_sweep(points, trials, methods, **options):
    """A study of kind simulation without a notebook."""
    study = {"kind": "simulation", "notebook": None, "trials": trials, "seed": 1, "points": points}
    return study | {"methods": {name: {"method": name} for name in methods}} | options


def make_grid(points):
    """Points of two settings, at least as many as asked for."""
    side = round(points**0.5)
    stiffness = {"start": 50, "stop": 500, "count": -(-points // side), "scale": "logarithmic"}
    return {"reflex_gain": {"start": 2, "stop": 30, "count": side}, "stiffness": stiffness}


def make_recordings(folder, count):
    """A study with a table of recordings, whose files are empty: a dry run does not open them."""
    paths = [
        folder / "recordings" / f"{number // 100}" / f"{number}.mat" for number in range(count)
    ]
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    table = pd.DataFrame(
        {"name": [f"r{path.stem}" for path in paths], "file": paths, "torque_sign": -1}
    )
    table.to_csv(folder / "list.csv", index=False)
    methods = {"pi-moesp": {"method": "pi-moesp"}}
    return {
        "kind": "recordings",
        "folder": str(folder),
        "table": str(folder / "list.csv"),
        "methods": methods,
    }


def measure_dry_runs(points):
    """Rows of the table for studies of some points."""
    rows, methods, short = [], ("pr-moesp", "eiv-moesp"), {"duration": 10.0}
    with tempfile.TemporaryDirectory() as folder:
        grid, recordings = make_grid(points), make_recordings(Path(folder), points)
        studies = {
            "trials of 50 s, everything is kept": make_sweep(
                grid, TRIALS, methods, keep="everything"
            ),
            "trials of 10 s, scores are kept": make_sweep(
                grid, TRIALS, methods, keep="scores", simulation=short
            ),
            "recordings": recordings,
        }
        for name, study in studies.items():
            seconds, memory, output = run_workflow(
                Path(folder), {"big": study}, "--dry-run", "--quiet", "all", "--cores", "2"
            )
            start = time.process_time()
            read = read_run({"run": ["big"], "article": [], "studies": {"big": study}}, [])[1][
                "big"
            ]
            checks = time.process_time() - start
            count = len(read.points)
            row = {
                "study": name,
                "points": f"{count:,}",
                "trials": f"{count * study.get('trials', 1):,}",
            }
            jobs = re.findall(r"^total\s+(\d+)", output, re.MULTILINE)
            row["jobs"] = f"{int(jobs[-1]):,}"
            row |= {"dry run [s]": f"{seconds:.1f}", "of it configuration [s]": f"{checks:.2f}"}
            rows.append(row | {"memory [MB]": f"{memory:.0f}"})
    return rows


def scale_cores(trials):
    """Runs that show strong scaling (the same trials) and weak scaling (twice the trials) on one and on two cores."""
    rows = []
    for count, cores in ((trials, 1), (trials, 2), (2 * trials, 2)):
        # Short jobs, so that even a short run has several.
        options = {"keep": "scores", "trials_per_chunk": 50, "simulation": {"duration": 10.0}}
        study = make_sweep(POINTS, count // CONDITIONS, ("pr-moesp", "riv"), **options)
        with tempfile.TemporaryDirectory() as folder:
            start = time.perf_counter()
            run_workflow(Path(folder), {"sweep": study}, "--cores", str(cores))
            seconds = time.perf_counter() - start
            jobs = len(list(Path(folder, "logs", "sweep").rglob("*.tsv")))
        row = {"trials": f"{count:,}", "cores": cores, "jobs": jobs, "seconds": f"{seconds:.0f}"}
        rows.append(row | {"trials per second and core": f"{count / seconds / cores:.1f}"})
    return rows
