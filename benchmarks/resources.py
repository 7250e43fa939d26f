"""Time and memory of jobs: runs small studies through the workflow and fits their benchmark files.

The result, src/ankleloop/studies/resources.json, is what `ankleloop.studies.resources` computes the resources of every
rule from. Snakemake measures each job (`benchmark:` of the rules): time of the processor, and largest memory. The
studies differ in method, number of trials and length, so that a non-negative least-squares fit separates the start of
a job, a trial and a sample.

Run by: python benchmarks/resources.py
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from scipy.optimize import nnls
from tools import ROOT, SNAKEMAKE, workflow_environment

from ankleloop import METHODS, simulate
from ankleloop.studies.resources import BLOCK_ROWS, MEASURED
from ankleloop.trials.trial_files import CHUNK  # trials that are in memory at a time

RATE = 1000.0  # recorded samples of a second
IDENTIFICATION_RATE = 100.0
# Trials and duration [s] of the chunks. Snakemake looks twice a second at a job that takes less than 15 s.
SIZES = ((4, 20.0), (400, 20.0), (200, 60.0))
MANY = ((4, 20.0), (100, 20.0), (60, 60.0))  # by all methods
SWEEPS = (2, 100)  # points of sweeps, whose tables are read by notebooks
SWEPT = 100  # trials of each point
RECORDED = (20.0, 60.0, 180.0)  # duration of recordings [s]
RECORDINGS = 3  # of each duration
VARIANTS = {
    **{name: {"method": name, "options": {}} for name in METHODS},
    "riv-delay": {"method": "riv", "options": {"delay": None}},
}
WIDE = {"method": "pr-moesp", "options": {"block_rows": 2 * BLOCK_ROWS}}
DECIMALS = 4  # significant digits of the file


def make_studies():
    """Studies by name: each method alone, wide Hankel matrices, and all methods together."""
    groups = {name: {name: method} for name, method in VARIANTS.items()}
    groups |= {"wide": {"wide": WIDE}, "all": VARIANTS}
    studies = {}
    for name, methods in groups.items():
        for trials, duration in MANY if name == "all" else SIZES:
            key = f"{name}-{trials}-{duration:g}"
            studies[key] = {
                "kind": "simulation",
                "notebook": "table1" if name == "all" else None,
                "trials": trials,
                "seed": 1,
                "points_per_chunk": 1,
                "simulation": {"duration": duration},
                "points": {"reflex_gain": [13.0]},
                "methods": methods,
            }
    return studies | make_sweeps()


def make_sweeps():
    """Sweeps of few and of many points, for the memory and the time that a row of a table takes."""
    return {
        f"sweep-{points}": {
            "kind": "simulation",
            "notebook": "sweep",
            "trials": SWEPT,
            "seed": 1,
            "keep": "scores",
            "simulation": {"duration": 10.0},
            "points": {"reflex_gain": {"start": 5, "stop": 20, "count": points}},
            "methods": {name: {"method": name} for name in ("moesp", "parallel-cascade")},
        }
        for points in SWEEPS
    }


def make_recordings(folder):
    """Studies of recordings, whose files are simulated trials."""
    studies = {}
    for duration in RECORDED:
        files = {}
        for number in range(RECORDINGS):
            trial = simulate(seed=number, duration=duration)
            columns = {name: trial[name].values for name in ("position", "torque", "reference")}
            name = f"recording-{duration:g}-{number}"
            pd.DataFrame(columns).to_csv(folder / f"{name}.csv", index=False)
            files[name] = {"file": f"{name}.csv"}
        studies[f"recordings-{duration:g}"] = {
            "kind": "recordings",
            "notebook": None,
            "folder": str(folder),
            "recordings_per_chunk": RECORDINGS,
            "defaults": {"sampling_rate": RATE, "reference": "reference"},
            "files": files,
            "methods": {name: {"method": name} for name in ("pr-moesp", "riv")},
        }
    return studies


def run_studies(studies, folder):
    """Run the workflow in a folder, one job at a time."""
    file = folder / "studies.yaml"
    file.write_text(yaml.safe_dump({"run": list(studies), "studies": studies}), encoding="utf-8")
    command = [SNAKEMAKE, "--snakefile", ROOT / "Snakefile", "--cores", "1", "--configfile", file, "--quiet", "all"]
    subprocess.run(command, cwd=folder, env=workflow_environment(), check=True)


def measure_snakemake(folder):
    """Largest memory of Snakemake itself, from a dry run of the studies [MB]."""
    code = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL); "
    code += "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    command = [SNAKEMAKE, "--snakefile", ROOT / "Snakefile", "--dry-run", "--quiet", "all"]
    command += ["--configfile", folder / "studies.yaml"]
    run = subprocess.run([sys.executable, "-c", code, *command], cwd=folder, check=True, capture_output=True, text=True)
    return int(run.stdout) * 1024 / 1e6


def read_benchmarks(studies, folder):
    """One row for each job, with what its chunk holds."""
    rows = []
    for name, study in studies.items():
        if study["kind"] == "recordings":
            sizes = [(folder / part["file"]).stat().st_size for part in study["files"].values()]
            contents = {"recordings": len(sizes), "bytes": max(sizes)}
            rows.append({"rule": "recordings", **contents, **_read_job(folder / "logs/recordings" / name / "0.tsv")})
            continue
        contents = {
            "methods": study["methods"],
            "trials": study["trials"],
            "samples": study["simulation"]["duration"] * RATE,
        }
        if study["notebook"]:
            points = study["points"]["reflex_gain"]["count"] if study["notebook"] == "sweep" else 1
            table = {"notebook": study["notebook"], "rows": points * study["trials"] * len(study["methods"])}
            rows.append({"rule": "report", **table, **_read_job(folder / "logs/report" / f"{name}.tsv")})
        if study["notebook"] != "sweep":
            for rule in ("simulate", "identify"):
                rows.append({"rule": rule, **contents, **_read_job(folder / "logs" / rule / name / "0.tsv")})
    return rows


def _read_job(path):
    measured = pd.read_csv(path, sep="\t").iloc[0]
    return {"seconds": measured["cpu_time"], "memory": measured["max_rss"]}


def fit(rows, describe, quantity):
    """Coefficients, none of them negative, of the linear model that describes a quantity of the jobs.

    Each job counts by its relative error: short jobs have as much to say as long ones.
    """
    models = [describe(row) for row in rows]
    names = list(dict.fromkeys(name for model in models for name in model))
    matrix = np.array([[model.get(name, 0.0) for name in names] for model in models])
    values = np.array([row[quantity] for row in rows])
    scales = np.abs(matrix).max(axis=0)
    solution, _ = nnls(matrix / scales / values[:, None], np.ones(len(values)))
    return dict(zip(names, (solution / scales).tolist(), strict=True))


def describe_time(row):
    """What the time of a job is made of."""
    if row["rule"] == "recordings":
        return {"start": 1.0, "recording": row["recordings"]}
    if row["rule"] == "report":
        return _describe_report(row)
    trials, samples = row["trials"], row["trials"] * row["samples"]
    if row["rule"] == "simulate":
        return {"start": 1.0, "simulated trial": trials, "simulated sample": samples}
    parts = {"start": 1.0, "prepared trial": trials, "prepared sample": samples}
    for name in row["methods"]:
        parts |= {f"{name} trial": trials, f"{name} sample": samples * IDENTIFICATION_RATE / RATE}
    return parts


def _describe_report(row):
    """Notebooks differ in what they draw, but a row of their table costs the same: the largest tables tell that."""
    name = "report of a sweep" if row["notebook"] == "sweep" else "report"
    return {name: 1.0, "row of a table": row["rows"]}


def describe_memory(row):
    """What the memory of a job is made of."""
    if row["rule"] == "recordings":
        return {"recordings": 1.0, "byte of a recording": row["bytes"]}
    if row["rule"] == "report":
        return _describe_report(row)
    if row["rule"] == "simulate":
        return {"simulate": 1.0, "simulated sample": row["samples"]}
    read = row["samples"] * min(row["trials"], CHUNK)
    return {
        "identify": 1.0,
        "identified sample": read,
        "sample of an estimate": row["samples"] * row["trials"] * len(row["methods"]),
    }


def fit_all(rows):
    """Content of the file."""
    seconds = fit(rows, describe_time, "seconds")
    wide, narrow = (
        [seconds.pop(f"{name} {part}") if name == "wide" else seconds[f"{name} {part}"] for part in ("trial", "sample")]
        for name in ("wide", WIDE["method"])
    )
    samples = 50.0 * IDENTIFICATION_RATE
    times = [trial + sample * samples for trial, sample in (wide, narrow)]
    if min(times) <= 0:
        sys.exit("The jobs were too short to tell a method from the start of a job: repeat it on an idle machine.")
    seconds["block rows"] = max(0.0, math.log2(times[0] / times[1]))
    return {"seconds": seconds, "memory": fit(rows, describe_memory, "memory")}


def show_errors(rows, result):
    """How far the model is from the jobs, as text."""
    lines = []
    for row in rows:
        if "wide" in row.get("methods", ()):
            continue
        for quantity, describe, key in (("seconds", describe_time, "seconds"), ("memory", describe_memory, "memory")):
            model = sum(result[key][name] * value for name, value in describe(row).items())
            lines.append((row["rule"], quantity, model / row[quantity]))
    table = pd.DataFrame(lines, columns=["rule", "quantity", "ratio"])
    return table.groupby(["rule", "quantity"])["ratio"].describe()[["min", "50%", "max"]].to_string(float_format="%.2f")


def main():
    """Measure, fit and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, help="keep the run in this folder; one that is finished is read again")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        studies = make_studies() | make_recordings(folder)
        run_studies(studies, folder)
        rows = read_benchmarks(studies, folder)
        result = fit_all(rows)
        result["memory"]["snakemake"] = measure_snakemake(folder)
    print(show_errors(rows, result))
    rounded = {
        key: {name: float(f"{value:.{DECIMALS}g}") for name, value in part.items()} for key, part in result.items()
    }
    MEASURED.write_text(json.dumps(rounded, indent=1) + "\n", encoding="utf-8")
    print(f"wrote {MEASURED.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
