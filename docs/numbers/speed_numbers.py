"""Numbers of docs/speed.md: other programs, long records, jobs of the workflow, imports."""

import importlib.util
import json
import resource
import shutil
import subprocess
import sys
import time
from functools import cache
from statistics import median

import pandas as pd
import yaml
from blocks import ROOT, Unavailable, block
from report import describe_ratios, describe_torques, format_table
from runs import RESULTS, markdown_table

from ankleloop import simulate
from ankleloop.replication.trial_tables import read_trial_table
from ankleloop.studies.results import run_studies
from ankleloop.studies.study import read_studies

PEERS = ROOT / ".venv" / "peers"
BENCHMARKS = ("peers", "programs", "datasets", "kernels", "report")
SOURCES = ("ankleloop.subspace.moesp", "ankleloop.methods.moesp", *(f"benchmarks/{name}.py" for name in BENCHMARKS))
LONG_SAMPLES = (360_000, 3_600_000)
HEAVY = ("scipy.signal", "scipy.optimize", "matplotlib.pyplot", "control")


@cache
def run_benchmark():
    """Table of the programs, from a new run of the benchmark; its picture goes to docs/speed.png."""
    if not PEERS.is_dir() or importlib.util.find_spec("ctrlsys") is None:
        raise Unavailable("the programs to compare with are not installed: `make benchmark` does that.")
    subprocess.run([sys.executable, ROOT / "benchmarks" / "peers.py"], check=True, stdout=subprocess.DEVNULL)
    shutil.copyfile(RESULTS / "benchmarks" / "peers.png", ROOT / "docs" / "speed.png")
    return pd.read_csv(RESULTS / "benchmarks" / "peers.csv")


@block("speed-ratios", SOURCES)
def write_ratios():
    return describe_ratios(run_benchmark())


@block("speed-torques", SOURCES)
def write_torques():
    return describe_torques(run_benchmark())


@block("speed-programs", SOURCES)
def write_programs():
    return format_table(run_benchmark())


@block("speed-long-records", ("ankleloop.methods.long_records", "benchmarks/long_record.py"))
def write_long_records():
    rows = []
    for samples in LONG_SAMPLES:
        command = [sys.executable, ROOT / "benchmarks" / "long_record.py", "--samples", str(samples)]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        result = json.loads(output.splitlines()[-1])
        rows.append(
            [
                f"{samples:,} ({result['hours']:g} h at 100 Hz)",
                f"{result['seconds']:.1f} s",
                f"{1e6 * result['seconds'] / samples:.1f} µs",
                f"{result['mib']:.0f} MiB",
                f"{result['mib_before']:.0f} MiB",
            ]
        )
    return markdown_table(["samples", "time", "a sample", "peak memory", "of it before the identification"], rows)


@block("speed-data-checks", ("ankleloop.joint.data_checks", "benchmarks/data_checks.py"))
def write_data_checks():
    command = [sys.executable, ROOT / "benchmarks" / "data_checks.py"]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    rows = json.loads(output.splitlines()[-1])
    columns = list(dict.fromkeys((row["duration"], row["data"]) for row in rows))
    cells = {(row["method"], row["duration"], row["data"]): row for row in rows}
    header = ["method", *(f"{duration:g} s, {data}" for duration, data in columns)]
    table = [
        [f"`{method}`", *(_describe_share(cells[method, *column]) for column in columns)]
        for method in dict.fromkeys(row["method"] for row in rows)
    ]
    return markdown_table(header, table)


def _describe_share(row):
    """Part of the time of an identification that the checks add, with its quartiles, and the time."""
    return f"{row['share']:.1f} % ({row['low']:.1f} … {row['high']:.1f}) of {row['ms']:.1f} ms"


@block("speed-make", ("workflow/rules/simulate.smk", "workflow/rules/identify.smk", "config/config.yaml"))
def write_jobs():
    config, studies = read_studies(yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8")))
    rows = []
    for study in run_studies(config, studies):
        table = RESULTS / "tables" / f"{study.name}-trials.parquet"
        if not table.exists():
            raise Unavailable("there are no results: run `make` first.")
        simulated = _sum_seconds("simulate", study.name, len(study.trial_chunks))
        identified = _sum_seconds("identify", study.name, len(study.chunks))
        estimates = len(read_trial_table(table, ["trial"]))
        rows.append([f"`{study.name}`", f"{estimates:,}", f"{simulated:.0f}", f"{identified:.0f}"])
    return markdown_table(["study", "estimates", "simulate [s]", "identify and score [s]"], rows)


def _sum_seconds(rule, study, chunks):
    """Seconds of the jobs of a rule for the chunks of a study, from what Snakemake measured of them."""
    paths = (ROOT / "logs" / rule / study / f"{chunk}.tsv" for chunk in range(chunks))
    return sum(pd.read_csv(path, sep="\t")["s"].sum() for path in paths)


@block("speed-imports", ("ankleloop.simulation.simulate",))
def write_imports():
    texts = [f"`{name}` {_time_import(name) - _time_import('numpy'):.1f} s" for name in HEAVY]
    simulate(seed=1)
    start = time.process_time()
    for seed in range(10):
        simulate(seed=seed)
    trial = (time.process_time() - start) / 10
    return (
        f"Time of the processor for an import, beyond numpy: {', '.join(texts)}. Simulating a trial of 50 s takes "
        f"{1e3 * trial:.0f} ms of it."
    )


@cache
def _time_import(name):
    """Median processor time of a new process that imports a package [s]."""
    times = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-c", f"import numpy, {name}"], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return median(times)
