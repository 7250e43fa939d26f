"""A sweep that keeps no trials: killed jobs, a sweep that was stopped in the middle, and a full disk."""

import os
import re
import subprocess

import psutil
import pytest
import yaml
from workflow_runs import Run, list_differences, mount, read_results

TRIALS = 4  # of two points, each a job
CONFIG = {
    "run": ["sweep"],
    "studies": {
        "sweep": {
            "kind": "simulation",
            "notebook": None,
            "keep": "scores",
            "trials": TRIALS,
            "seed": 1,
            "trials_per_chunk": 1,
            "simulation": {"duration": 10.0},
            "points": {"reflex_gain": [8.0, 12.0], "pr-moesp.block_rows": [12, 15]},
            "methods": {"pr-moesp": {"method": "pr-moesp"}, "cascade": {"method": "parallel-cascade"}},
        }
    },
}
PAGE = os.sysconf("SC_PAGE_SIZE")  # the least that a file takes [bytes]
JOBS = 2 * TRIALS  # the points that differ in block rows share their trials


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    path = tmp_path_factory.mktemp("config") / "sweep.yaml"
    path.write_text(yaml.safe_dump(CONFIG), encoding="utf-8")
    return path


def run_to_end(start, folder, config):
    run = start(folder, "--configfile", str(config), "--rerun-incomplete")
    assert run.wait() == 0, run.text
    return run.text


def count_jobs(text):
    return text.count("\nrule sweep:") + text.count("localrule sweep:")


def finished(folder):
    """Tables of finished jobs, with the time of their writing."""
    files = sorted((folder / "results" / "parameters").rglob("*.csv"))
    return {path.name: path.stat().st_mtime_ns for path in files}


@pytest.fixture(scope="module")
def expected(repository, config, tmp_path_factory):
    """Results of a sweep that nothing disturbs."""
    folder = tmp_path_factory.mktemp("sweep")
    run = Run(repository, folder, folder.with_suffix(".log"), "--configfile", str(config))
    assert run.wait() == 0, run.text
    assert count_jobs(run.text) == JOBS
    results = read_results(folder)
    assert {"tables/sweep-trials.parquet", "tables/sweep-trials.csv"} <= set(results)
    assert not [name for name in results if name.endswith(".nc")]
    return results


def test_a_sweep_goes_on_after_its_jobs_and_itself_were_killed(start, config, expected, tmp_path):
    folder = tmp_path / "work"
    folder.mkdir()
    run = start(folder, "--configfile", str(config), "--keep-going")
    run.wait_for(lambda: jobs_of(run))
    victim = jobs_of(run)[0]
    victim.kill()  # one job: all others go on
    assert run.wait() != 0
    before = finished(folder)
    assert len(before) == JOBS - 1
    assert count_jobs(run_to_end(start, folder, config)) == 1
    assert before.items() <= finished(folder).items()
    assert not list_differences(expected, read_results(folder))

    stopped = tmp_path / "stopped"
    stopped.mkdir()
    run = start(stopped, "--configfile", str(config))
    run.wait_for(lambda: len(finished(stopped)) >= JOBS // 2)
    run.kill(jobs=True)  # Snakemake and its jobs, in the middle
    count = len(finished(stopped))
    unlock = start(stopped, "--configfile", str(config), "--unlock")
    assert unlock.wait() == 0, unlock.text
    repeated = count_jobs(run_to_end(start, stopped, config))
    assert JOBS - count <= repeated <= JOBS - count + 2  # those that ran on two cores are repeated
    assert not list_differences(expected, read_results(stopped))


def test_a_killed_job_is_tried_again_with_twice_the_memory_and_time(start, config, expected, tmp_path):
    run = start(tmp_path, "--configfile", str(config), "--retries", "1")
    run.wait_for(lambda: jobs_of(run))
    jobs_of(run)[0].kill()
    assert run.wait() == 0, run.text
    requests = {}
    pattern = r"^(?:local)?rule sweep:\n.*?output: (\S+),.*?mem_mb=(\d+),.*?runtime=(\d+)"
    for path, memory, minutes in re.findall(pattern, run.text, re.DOTALL | re.MULTILINE):
        requests.setdefault(path, []).append((int(memory), int(minutes)))
    assert len(requests) == JOBS
    (repeated,) = [attempts for attempts in requests.values() if len(attempts) > 1]
    (memory, minutes), again = repeated
    assert again == (2 * memory, 2 * minutes)
    assert not list_differences(expected, read_results(tmp_path))


def test_a_full_disk_is_named_by_jobs_and_table_and_loses_nothing(start, config, expected, tmp_path):
    arguments = ("--configfile", str(config), "--rerun-incomplete", "--keep-going")
    results = tmp_path / "results"
    results.mkdir()

    def resize(size):
        subprocess.run(["mount", "-o", f"remount,size={size}", str(results)], check=True)

    def check_message(run, rule):
        assert re.search(rf"^rule {rule}, study sweep.*No space left on device", run.text, re.MULTILINE), run.text
        assert not list(results.rglob("*.part"))

    with mount("-t", "tmpfs", "-o", f"size={4 * PAGE}", "tmpfs", folder=results):
        run = start(tmp_path, *arguments)
        assert run.wait() != 0
        check_message(run, "sweep")
        before = finished(tmp_path)
        assert len(before) < JOBS
        resize("1M")
        run = start(tmp_path, *arguments, "--until", "sweep")
        assert run.wait() == 0, run.text
        assert before.items() <= finished(tmp_path).items()
        before = finished(tmp_path)
        disk = os.statvfs(results)
        resize((disk.f_blocks - disk.f_bfree) * disk.f_frsize)
        run = start(tmp_path, *arguments)
        assert run.wait() != 0
        check_message(run, "small_table")
        resize("8M")
        assert count_jobs(run_to_end(start, tmp_path, config)) == 0
        assert finished(tmp_path) == before
        assert not list_differences(expected, read_results(tmp_path))


def jobs_of(run):
    """Processes of the jobs that sweep."""
    jobs = []
    for process in psutil.Process(run.process.pid).children(recursive=True):
        try:
            command = process.cmdline()
        except psutil.Error:
            continue
        if command and "python" in command[0] and any(part.endswith(".sweep.py") for part in command):
            jobs.append(process)
    return jobs
