"""What the benchmarks share: where things are, runs of the workflow, memory, and tables."""

import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pandas as pd
import yaml

ROOT = Path(__file__).resolve().parents[1]


def run_workflow(folder, studies, *arguments):
    """Run the studies in a folder, with this version of the library: time of the processor [s], memory [MB], output."""
    config = folder / "config.yaml"
    config.write_text(
        yaml.safe_dump({"run": list(studies), "article": [], "studies": studies}), encoding="utf-8"
    )
    path = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    command = [
        Path(sys.executable).with_name("snakemake"),
        "--snakefile",
        ROOT / "Snakefile",
        "--configfile",
        config,
    ]
    with open(folder / "output.txt", "w+", encoding="utf-8") as file:
        process = subprocess.Popen(
            [*command, *arguments],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": path},
            stdout=file,
            stderr=file,
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        file.seek(0)
        output = file.read()
    if process.returncode:
        raise RuntimeError(f"Snakemake failed:\n{output[-2000:]}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, output


def run_alone(function, *arguments):
    """Result of a function in a process of its own, whose memory is that of the function."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def peak_memory():
    """Most memory that the program has had [MiB], on Linux; `ru_maxrss` can be that of the process which began it."""
    lines = Path("/proc/self/status").read_text(encoding="ascii", errors="ignore").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def format_table(rows):
    """Rows, dictionaries or a table, as Markdown."""
    return pd.DataFrame(rows).fillna("").to_markdown(index=False, disable_numparse=True)
