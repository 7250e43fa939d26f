"""What a dry run of a large study costs, and what Snakemake alone takes for as many jobs.

A dry run reads and checks the configuration, divides trials among jobs and lists the jobs. Beside it runs a plain
Snakefile with as many jobs, of which each second one needs the file of another, as identification needs trials.

Run by: python benchmarks/dag.py [--points 1000 4000 10000] [--json]
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml

from ankleloop.studies.run_config import read_run

ROOT = Path(__file__).resolve().parents[1]
SNAKEMAKE = Path(sys.executable).with_name("snakemake")
TRIALS = 100  # of each point
METHODS = {"pr-moesp": {"method": "pr-moesp"}, "eiv-moesp": {"method": "eiv-moesp"}}
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
        "trials": TRIALS,
        "seed": 1,
        "keep": keep,
        "simulation": {"duration": duration},
        "points": grid,
        "methods": METHODS,
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
    """Time [s] of the clock and of the processor, memory [MB] and number of jobs of a dry run."""
    command = [SNAKEMAKE, "--dry-run", "--quiet", "all", "--cores", "2", "--directory", folder, *arguments]
    start = time.perf_counter()
    with open(folder / "output.txt", "w+", encoding="utf-8") as file:
        process = subprocess.Popen([str(part) for part in command], stdout=file, stderr=subprocess.STDOUT)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        elapsed = time.perf_counter() - start
        file.seek(0)
        text = file.read()
    jobs = re.findall(r"^total\s+(\d+)", text, re.MULTILINE)
    if process.returncode or not jobs:
        raise RuntimeError(f"{' '.join(map(str, command))} failed:\n{text[-2000:]}")
    processor = usage.ru_utime + usage.ru_stime
    return {"clock": elapsed, "processor": processor, "memory": usage.ru_maxrss / 1024, "jobs": int(jobs[-1])}


def measure(name, make_study):
    """A row of the table: the dry run of a study, our part of it, and a plain Snakefile with as many jobs."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        config = {"run": ["big"], "article": [], "studies": {"big": make_study(folder)}}
        path = folder / "config.yaml"
        path.write_text(yaml.safe_dump(config), encoding="utf-8")
        workflow = dry_run(folder, "--snakefile", ROOT / "Snakefile", "--configfile", path)
        plain = folder / "plain"
        plain.mkdir()
        (plain / "Snakefile").write_text(PLAIN.format(pairs=workflow["jobs"] // 2), encoding="utf-8")
        alone = dry_run(plain, "--snakefile", plain / "Snakefile")
        start = time.process_time()
        _, studies = read_run(config, [path])
        checks = time.process_time() - start
    points = len(studies["big"].points)
    return {
        "study": name,
        "points": points,
        "trials": points * TRIALS if "recordings" not in name else points,
        "jobs": workflow["jobs"],
        "clock [s]": round(workflow["clock"], 1),
        "processor [s]": round(workflow["processor"], 1),
        "configuration [s]": round(checks, 2),
        "memory [MB]": round(workflow["memory"]),
        "Snakemake alone, clock [s]": round(alone["clock"], 1),
        "Snakemake alone, processor [s]": round(alone["processor"], 1),
        "Snakemake alone, memory [MB]": round(alone["memory"]),
    }


def measure_all(sizes):
    """Rows of the table."""
    for points in sizes:
        for name, keep, duration in (
            ("trials of 50 s, everything is kept", "everything", 50.0),
            ("trials of 10 s, scores are kept", "scores", 10.0),
        ):
            yield measure(name, lambda _, p=points, k=keep, d=duration: sweep_study(p, k, d))
        yield measure("recordings", lambda folder, p=points: recorded_study(folder, p))


def format_table(rows):
    """The rows as Markdown, with times in seconds and memory in MB."""
    columns = {
        "study": "study",
        "points": "points",
        "trials": "trials",
        "jobs": "jobs",
        "processor [s]": "dry run [s]",
        "Snakemake alone, processor [s]": "of it Snakemake alone [s]",
        "configuration [s]": "of it configuration [s]",
        "memory [MB]": "memory [MB]",
    }
    lines = ["| " + " | ".join(columns.values()) + " |", "|---" * len(columns) + "|"]
    for row in rows:
        cells = (f"{value:,}" if isinstance(value, int) else str(value) for value in (row[name] for name in columns))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main():
    """Print the rows, or all of them as JSON with their table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, nargs="+", default=[1000, 4000, 10000], help="points of the studies")
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()
    rows = []
    for row in measure_all(arguments.points):
        rows.append(row)
        if not arguments.json:
            print(", ".join(f"{name}: {value}" for name, value in row.items()), flush=True)
    if arguments.json:
        print(json.dumps({"rows": rows, "markdown": format_table(rows)}))


if __name__ == "__main__":
    main()
