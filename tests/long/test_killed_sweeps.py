"""A sweep that keeps no trials: a killed job is repeated alone, and a sweep that was stopped in the middle goes on."""

import psutil
import pytest
import yaml
from runs import list_differences, read_results

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


def test_a_sweep_goes_on_after_its_jobs_and_itself_were_killed(start, config, tmp_path, record):
    undisturbed, folder = tmp_path / "undisturbed", tmp_path / "work"
    undisturbed.mkdir()
    folder.mkdir()
    assert count_jobs(run_to_end(start, undisturbed, config)) == JOBS
    expected = read_results(undisturbed)
    assert {"tables/sweep-trials.parquet", "tables/sweep-trials.csv"} <= set(expected)
    assert not [name for name in expected if name.endswith(".nc")]

    run = start(folder, "--configfile", str(config), "--keep-going")
    run.wait_for(lambda: jobs_of(run))
    victim = jobs_of(run)[0]
    victim.kill()  # one job: all others go on
    assert run.wait() != 0
    kept = finished(folder)
    assert len(kept) == JOBS - 1
    assert count_jobs(run_to_end(start, folder, config)) == 1
    assert kept.items() <= finished(folder).items()
    assert not list_differences(expected, read_results(folder))

    stopped = tmp_path / "stopped"
    stopped.mkdir()
    run = start(stopped, "--configfile", str(config))
    run.wait_for(lambda: len(finished(stopped)) >= JOBS // 2)
    run.kill(jobs=True)  # Snakemake and its jobs, in the middle
    kept = len(finished(stopped))
    unlock = start(stopped, "--configfile", str(config), "--unlock")
    assert unlock.wait() == 0, unlock.text
    repeated = count_jobs(run_to_end(start, stopped, config))
    record({"jobs": JOBS, "finished_when_stopped": kept, "jobs_afterwards": repeated})
    assert JOBS - kept <= repeated <= JOBS - kept + 2  # those that ran on two cores are repeated
    assert not list_differences(expected, read_results(stopped))


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
