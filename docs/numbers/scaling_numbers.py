"""Numbers of docs/scaling.md and docs/clusters.md: costs, jobs, cores, and what a million trials take."""

import json
import subprocess
import sys
import time
from functools import cache
from statistics import median

from blocks import ROOT, Unavailable, block
from runs import RESULTS, markdown_table
from scaling import CONDITIONS, DURATION, METHODS, POINTS, SNAKEMAKE, make_sweep, run_sweep, scale_cores

from ankleloop import METHODS as ALL_METHODS
from ankleloop.studies.job_resources import describe_chunk
from ankleloop.studies.resources import START_SECONDS, identification_seconds, simulation_seconds
from ankleloop.studies.study import read_studies

MODEL = ("ankleloop.studies.resources", "src/ankleloop/studies/resources.json")
DURATIONS = (10.0, 50.0)
RATE = 1000.0
TRIALS = 2000
CLUSTER = RESULTS / "scaling" / "cluster.json"  # written by tests/cluster
MILLION = 1_000_000
LARGE_POINTS = {
    "reflex_gain": {"start": 5, "stop": 23, "count": 10},
    "voluntary": {"start": 0.1, "stop": 1.6, "count": 10, "scale": "logarithmic"},
    "pr-moesp.block_rows": [12, 18],
}
LARGE_CONDITIONS = 100
NODES, CORES = 100, 32
JOB_MINUTES = 30.0


@block("scaling-costs", MODEL)
def write_costs():
    none = [identification_seconds(duration * RATE, {}) for duration in DURATIONS]
    rows = [
        ["simulate a trial", *(f"{1e3 * simulation_seconds(duration * RATE):.1f}" for duration in DURATIONS)],
        ["read and prepare it", *(f"{1e3 * value:.1f}" for value in none)],
    ]
    for name in ALL_METHODS:
        times = [
            identification_seconds(duration * RATE, {name: {"method": name, "options": {}}}) - other
            for duration, other in zip(DURATIONS, none, strict=True)
        ]
        rows.append([f"identify and score it: `{name}`", *(f"{1e3 * value:.1f}" for value in times)])
    rows.append(["start of a job", *(f"{1e3 * START_SECONDS:,.0f}" for _ in DURATIONS)])
    return markdown_table(["", *(f"{duration:g} s [ms]" for duration in DURATIONS)], rows)


@block("scaling-requests", ("ankleloop.studies.job_resources", *MODEL))
def write_requests():
    rows = []
    for trials, duration, methods in ((20, 50.0, 5), (500, 50.0, 5), (1000, 10.0, 2)):
        names = list(ALL_METHODS)[:methods]
        study = {
            "kind": "simulation",
            "notebook": None,
            "trials": trials,
            "seed": 1,
            "points_per_chunk": 1,
            "simulation": {"duration": duration},
            "points": {"reflex_gain": [13.0]},
            "methods": {name: {"method": name} for name in names},
        }
        for keep, rules in (("everything", ("simulate", "identify")), ("scores", ("sweep",))):
            _, studies = read_studies({"run": ["study"], "studies": {"study": {**study, "keep": keep}}})
            for rule in rules:
                job = describe_chunk(studies["study"], rule, 0)
                rows.append(
                    [f"{trials:,} × {duration:g} s", methods, f"`{rule}`", f"{job.mem_mb(1):,}", job.runtime(1)]
                )
    return markdown_table(["trials of a chunk", "methods", "rule", "memory [MB]", "time [min]"], rows)


@cache
def _scale():
    return scale_cores(TRIALS)


@block("scaling-cores", ("benchmarks/scaling.py", "workflow/rules/sweep.smk", "ankleloop.studies.sweep_job"))
def write_cores():
    baseline = _scale()[0]
    rows = []
    for kind, run in zip(("", "strong", "weak"), _scale(), strict=True):
        speed = (run["trials"] / run["seconds"]) / (baseline["trials"] / baseline["seconds"])
        rows.append(
            [
                kind,
                run["cores"],
                f"{run['trials']:,}",
                run["jobs"],
                f"{run['seconds']:.0f}",
                f"{run['processor']:.0f}",
                f"{speed / run['cores']:.2f}",
            ]
        )
    header = ["scaling", "cores", "trials", "jobs", "time [s]", "of the processor [s]", "efficiency"]
    text = f"{len(METHODS)} methods, trials of {DURATION:g} s, {_count_points()} points of {CONDITIONS} conditions."
    return f"{text}\n\n{markdown_table(header, rows)}"


def _count_points():
    count = 1
    for values in POINTS.values():
        count *= len(values)
    return count


@block("scaling-disk", ("benchmarks/scaling.py", "ankleloop.studies.sweep_job", "ankleloop.replication.trial_tables"))
def write_disk():
    rows = []
    for keep in ("everything", "estimates", "scores"):
        run = run_sweep(TRIALS // 10, 2, keep)
        rows.append([f"`{keep}`", f"{run['bytes'] / run['trials'] / 1e3:.1f}"])
    return markdown_table(
        ["keep", f"disk for a trial of {DURATION:g} s at {_count_points() // CONDITIONS} points [kB]"], rows
    )


@block("scaling-start", ("workflow/Snakefile", "workflow/rules/common.smk"))
def write_start():
    times = {}
    for name, command in (
        ("python", [sys.executable, "-c", "pass"]),
        ("snakemake", [SNAKEMAKE, "--version"]),
        ("workflow", [SNAKEMAKE, "--dry-run", "--quiet", "all", "--cores", "1", "results/tables/table1.csv"]),
    ):
        times[name] = median(_time(command) for _ in range(3))
    cluster = ""
    if CLUSTER.exists():
        measured = json.loads(CLUSTER.read_text(encoding="utf-8"))
        cluster = (
            f" On a Slurm of one node ({measured['cores']} cores) a run of {measured['jobs']} jobs took "
            f"{measured['seconds']:.0f} s, {measured['local']:.0f} s without Slurm."
        )
    return (
        f"Start of Python {times['python']:.2f} s, of Snakemake {times['snakemake']:.1f} s, of Snakemake with this "
        f"workflow and a study {times['workflow']:.1f} s; start of a job (imports, compiled kernels) "
        f"{START_SECONDS:.1f} s.{cluster}"
    )


def _time(command):
    start = time.perf_counter()
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return time.perf_counter() - start


@block("scaling-dag", ("benchmarks/dag.py", "workflow/rules/common.smk", "ankleloop.studies.study"))
def write_dag():
    program = ROOT / "benchmarks" / "dag.py"
    if not program.exists():
        raise Unavailable("there is no benchmarks/dag.py.")
    process = subprocess.run([sys.executable, program, "--json"], check=True, capture_output=True, text=True)
    return json.loads(process.stdout)["markdown"]


@block("scaling-million", ("benchmarks/scaling.py", *MODEL))
def write_million():
    config = make_sweep(TRIALS, job_minutes=JOB_MINUTES)
    config["studies"]["sweep"] |= {"points": LARGE_POINTS, "trials": MILLION // LARGE_CONDITIONS}
    _, studies = read_studies(config)
    study = studies["sweep"]
    jobs = [describe_chunk(study, "sweep", chunk) for chunk in range(len(study.chunks))]
    hours = sum(job.seconds for job in jobs) / 3600
    sample = run_sweep(TRIALS // 10, 2)
    disk = sample["bytes"] / sample["trials"] * MILLION / 1e9
    rounds = -(-len(jobs) // (NODES * CORES))
    longest = max(job.seconds for job in jobs) / 60
    memory = max(job.mem_mb(1) for job in jobs)
    return (
        f"{MILLION:,} trials of {DURATION:g} s, {len(study.point_list)} points of {LARGE_CONDITIONS} "
        f"conditions, {len(METHODS)} "
        f"methods, tables alone: {hours:.0f} core hours in {len(jobs):,} jobs of at most {longest:.0f} min, with "
        f"{memory:,} MB of memory each; {disk:.1f} GB in about {2 * len(jobs) + 2:,} files. On {NODES} nodes "
        f"of {CORES} cores these are {rounds} round(s) of jobs: {rounds * longest:.0f} minutes and the waiting in "
        "the queue."
    )
