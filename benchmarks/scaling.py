"""How large studies scale: what a dry run costs, and a sweep through the whole workflow on one and two cores.

A dry run reads and checks the configuration, divides trials among jobs and lists the jobs. Beside it runs a plain
Snakefile with as many jobs, of which each second one needs the file of another, as identification needs trials.
"""

import os
import re
import subprocess
import tempfile
import time
from pathlib import Path

import yaml
from tools import ROOT, SNAKEMAKE, workflow_environment

from ankleloop.studies.run_config import read_run

DRY_TRIALS = 100  # of each point
DRY_METHODS = {"pr-moesp": {"method": "pr-moesp"}, "eiv-moesp": {"method": "eiv-moesp"}}
METHODS = {"pr-moesp": {"method": "pr-moesp"}, "riv": {"method": "riv"}}
POINTS = {"reflex_gain": [8.0, 16.0], "voluntary": [0.05, 0.3], "pr-moesp.block_rows": [12, 18]}
CONDITIONS = 4  # the option simulates nothing again
JOB_MINUTES = 0.5  # so that even a short run has several jobs
PLAIN = """
rule all:
    input: expand("b/{{n}}", n=range({pairs}))
rule a:
    output: "a/{{n}}"
    params: n=lambda wildcards: wildcards.n
    shell: "touch {{output}}"
rule b:
    input: "a/{{n}}"
    output: "b/{{n}}"
    params: n=lambda wildcards: wildcards.n
    shell: "touch {{output}}"
"""


def sweep_study(points, keep, duration):
    """A study with a grid of two settings."""
    side = round(points**0.5)
    grid = {
        "reflex_gain": {"start": 2, "stop": 30, "count": side},
        "stiffness": {"start": 50, "stop": 500, "count": -(-points // side), "scale": "logarithmic"},
    }
    return {
        "kind": "simulation",
        "notebook": None,
        "trials": DRY_TRIALS,
        "seed": 1,
        "keep": keep,
        "simulation": {"duration": duration},
        "points": grid,
        "methods": DRY_METHODS,
    }


def recorded_study(folder, count):
    """A study with a table of recordings, whose files are empty: a dry run does not open them."""
    rows = ["name,file,torque_sign"]
    for number in range(count):
        path = folder / "recordings" / f"{number // 100}" / f"{number}.mat"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        rows.append(f"r{number},{path.relative_to(folder)},-1")
    (folder / "list.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    methods = {"pi-moesp": {"method": "pi-moesp"}}
    return {"kind": "recordings", "folder": str(folder), "table": str(folder / "list.csv"), "methods": methods}


def dry_run(folder, *arguments):
    """Time of the processor [s], memory [MB] and number of jobs of a dry run."""
    command = [SNAKEMAKE, "--dry-run", "--quiet", "all", "--cores", "2", "--directory", folder, *arguments]
    with open(folder / "output.txt", "w+", encoding="utf-8") as file:
        process = subprocess.Popen([str(part) for part in command], stdout=file, stderr=subprocess.STDOUT)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        file.seek(0)
        text = file.read()
    jobs = re.findall(r"^total\s+(\d+)", text, re.MULTILINE)
    if process.returncode or not jobs:
        raise RuntimeError(f"{' '.join(map(str, command))} failed:\n{text[-2000:]}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, int(jobs[-1])


def measure_dry_run(name, make_study):
    """A row of the table: the dry run of a study, our part of it, and a plain Snakefile with as many jobs."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        config = {"run": ["big"], "article": [], "studies": {"big": make_study(folder)}}
        path = folder / "config.yaml"
        path.write_text(yaml.safe_dump(config), encoding="utf-8")
        seconds, memory, jobs = dry_run(folder, "--snakefile", ROOT / "Snakefile", "--configfile", path)
        plain = folder / "plain"
        plain.mkdir()
        (plain / "Snakefile").write_text(PLAIN.format(pairs=jobs // 2), encoding="utf-8")
        alone, _, _ = dry_run(plain, "--snakefile", plain / "Snakefile")
        start = time.process_time()
        _, studies = read_run(config, [path])
        checks = time.process_time() - start
    points = len(studies["big"].points)
    return {
        "study": name,
        "points": f"{points:,}",
        "trials": f"{points * DRY_TRIALS if name != 'recordings' else points:,}",
        "jobs": f"{jobs:,}",
        "dry run [s]": f"{seconds:.1f}",
        "of it Snakemake alone [s]": f"{alone:.1f}",
        "of it configuration [s]": f"{checks:.2f}",
        "memory [MB]": f"{memory:.0f}",
    }


def measure_dry_runs(points):
    """Rows of the table for studies of some points."""
    return [
        measure_dry_run("trials of 50 s, everything is kept", lambda _: sweep_study(points, "everything", 50.0)),
        measure_dry_run("trials of 10 s, scores are kept", lambda _: sweep_study(points, "scores", 10.0)),
        measure_dry_run("recordings", lambda folder: recorded_study(folder, points)),
    ]


def run_sweep(trials, cores):
    """Run a sweep over two settings and an option of a method, by two methods, in a new folder; a row of the table."""
    study = {
        "kind": "simulation",
        "notebook": None,
        "trials": trials // CONDITIONS,
        "seed": 1,
        "keep": "scores",
        "job_minutes": JOB_MINUTES,
        "simulation": {"duration": 10.0},
        "points": POINTS,
        "methods": METHODS,
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "sweep.yaml"
        file.write_text(yaml.safe_dump({"run": ["sweep"], "studies": {"sweep": study}}), encoding="utf-8")
        command = [SNAKEMAKE, "--snakefile", ROOT / "Snakefile", "--cores", str(cores), "--configfile", file]
        start = time.perf_counter()
        subprocess.run(command, cwd=folder, env=workflow_environment(), check=True, stderr=subprocess.DEVNULL)
        seconds = time.perf_counter() - start
        rules = {"sweep", "sweep_estimates", "simulate", "identify"}
        jobs = sum(len(list((folder / "logs" / rule).rglob("*.tsv"))) for rule in rules)
    return {
        "trials": f"{trials:,}",
        "cores": cores,
        "jobs": jobs,
        "seconds": f"{seconds:.0f}",
        "trials per second and core": f"{trials / seconds / cores:.1f}",
    }


def scale_cores(trials):
    """Runs that show strong scaling (the same trials) and weak scaling (twice the trials) on one and on two cores."""
    return [run_sweep(trials, 1), run_sweep(trials, 2), run_sweep(2 * trials, 2)]
