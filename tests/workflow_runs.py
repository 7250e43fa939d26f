"""Runs of the workflow that a test can kill, and comparisons of what they leave."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

PROGRAM = Path(sys.executable).with_name("snakemake")
# One study of two points in four chunks, two methods, and its notebook: every kind of job that a study has.
STUDY = {
    "run": ["study"],
    "studies": {
        "study": {
            "kind": "simulation",
            "notebook": "table1",
            "trials": 2,
            "seed": 1,
            "trials_per_chunk": 1,
            "simulation": {"duration": 12.0},
            "points": {"reflex_gain": [13.0, 2.0]},
            "methods": {"pr-moesp": {"method": "pr-moesp"}, "riv": {"method": "riv"}},
        }
    },
}
CHUNKS = 4
SETTINGS = STUDY["studies"]["study"] | {
    "trials": 2,
    "trials_per_chunk": 1,
    "points": {"reflex_gain": [13.0]},
}
TINY = {"run": ["tiny"], "studies": {"tiny": SETTINGS}}
MODULE = """
module ankleloop:
    snakefile: "{repository}/workflow/Snakefile"

use rule * from ankleloop{alias}

rule everything_of_the_module:
    default_target: True
    input: rules.{all}.input
"""
# Files that hold times of the run.
DATED = {".snakemake_timestamp", "index.html", "ro-crate-metadata.json"}


def environment(repository, **variables):
    """Variables of Snakemake with the library of a copy of the repository."""
    inherited = {
        name: value for name, value in os.environ.items() if name != "ANKLELOOP_RECORDINGS"
    }
    modules = os.pathsep.join(filter(None, [str(repository / "src"), inherited.get("PYTHONPATH")]))
    path = f"{PROGRAM.parent}{os.pathsep}{inherited['PATH']}"
    return {**inherited, "PYTHONPATH": modules, "PATH": path, **variables}


class Run:
    """Snakemake in a folder, in a process group of its own.

    Its output goes to a file outside of the folder, which may be full or read-only.
    """

    def __init__(self, repository, folder, log, *arguments, **variables):
        self.log = Path(log)
        cores = [] if "--workflow-profile" in arguments else ["--cores", "2"]
        with self.log.open("w") as file:
            self.process = subprocess.Popen(
                [str(PROGRAM), *cores, "--snakefile", str(repository / "Snakefile"), *arguments],
                cwd=folder,
                env=environment(repository, **variables),
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def wait(self, timeout=600):
        """Return code; the text of the output stands in `text`."""
        return self.process.wait(timeout)

    @property
    def text(self):
        """Output so far."""
        return self.log.read_text(encoding="utf-8", errors="replace")

    def kill(self, *, jobs):
        """End Snakemake by SIGKILL, with all of its jobs or without them, which then go on as orphans."""
        children = (
            psutil.Process(self.process.pid).children(recursive=True)
            if self.process.poll() is None
            else []
        )
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        for child in children if jobs else []:
            with contextlib.suppress(psutil.NoSuchProcess):
                child.kill()
        if jobs:
            psutil.wait_procs(children, timeout=20)
        return children

    def wait_for(self, condition, timeout=300):
        """Wait until a condition holds while the run goes on."""
        end = time.monotonic() + timeout
        while not condition():
            assert self.process.poll() is None, (
                f"the run ended before the condition held:\n{self.text}"
            )
            assert time.monotonic() < end, (
                f"the condition did not hold within {timeout} s:\n{self.text}"
            )
            time.sleep(0.02)


def read_results(folder):
    """Content of every file below `results` by its path, but for those that say when they were made."""
    root = Path(folder) / "results"
    files = [path for path in sorted(root.rglob("*")) if path.is_file() and path.name not in DATED]
    return {str(path.relative_to(root)): path.read_bytes() for path in files}


def list_differences(expected, results):
    """Files that are missing, that are new, or whose bytes differ."""
    names = sorted(set(expected) | set(results))
    return [name for name in names if expected.get(name) != results.get(name)]


@contextlib.contextmanager
def mount(*arguments, folder):
    """Mount a file system on a folder; skip where that is not allowed."""
    process = subprocess.run(["mount", *arguments, str(folder)], capture_output=True, text=True)
    if process.returncode:
        pytest.skip(f"this user may not mount a file system: {process.stderr.strip()}")
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def count_jobs(text):
    """Number of jobs by rule in the statistics of a dry run."""
    table = text.split("Job stats:")[-1].split("total")[0]
    jobs = {
        rule: int(number) for rule, number in re.findall(r"^(\w+) +(\d+)$", table, re.MULTILINE)
    }
    return {
        rule: number
        for rule, number in jobs.items()
        if rule not in ("all", "everything", "paper_all")
    }
