"""`make setup` that ends at random moments, and what the next one makes of what it leaves."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil

ROOT = Path(__file__).parents[2]
KILLS = 3
SEED = 2008


def make(folder, log, *targets):
    """Start make in a process group of its own, with the Python that this environment was made of."""
    variables = {
        name: value
        for name, value in os.environ.items()
        if name not in ("VIRTUAL_ENV", "PYTHONPATH")
    }
    python = Path(sys.base_prefix, "bin", f"python{sys.version_info[0]}.{sys.version_info[1]}")
    command = ["make", f"PYTHON={python}", *targets]
    return subprocess.Popen(
        command,
        cwd=folder,
        env=variables,
        stdout=log,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )


def test_a_set_up_that_was_killed_is_finished_by_the_next(tmp_path):
    folder = tmp_path / "repository"
    for name in ("src", "notebooks"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    for name in ("Makefile", "environment.lock", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy2(ROOT / name, folder / name)
    generator = random.Random(SEED)
    with open(tmp_path / "make.log", "w") as log:
        for _ in range(KILLS):
            process = make(folder, log, "setup")
            time.sleep(generator.uniform(2.0, 60.0))
            if process.poll() is None:  # a quick machine has finished
                children = psutil.Process(process.pid).children(recursive=True)
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                psutil.wait_procs(children, timeout=20)
        assert make(folder, log, "setup").wait() == 0, (tmp_path / "make.log").read_text()
        assert make(folder, log, "--question", "setup").wait() == 0  # nothing is left to do
    python = folder / ".venv" / "bin" / "python"
    subprocess.run([python, "-m", "pip", "check"], check=True)
    code = "import ankleloop; print(ankleloop.__file__, ankleloop.identify(ankleloop.simulate(seed=1, duration=12.0)))"
    answer = subprocess.run([python, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert answer.stdout.startswith(str(folder)), answer.stderr
