"""A study on a Slurm of one node, and what a node that fails costs."""

import json
import time
from pathlib import Path

from slurm import CORES
from workflow_runs import CHUNKS, list_differences, read_results

SECONDS = 1500  # each job of a cluster starts Snakemake twice, and then its script
# For docs/scaling.md.
SUMMARY = Path(__file__).parents[2] / "results" / "scaling" / "cluster.json"


def test_results_of_a_cluster_are_those_of_one_machine(start, start_cluster, local, tmp_path):
    folder = tmp_path / "work"
    begin = time.monotonic()
    run = start_cluster(folder)
    assert run.wait(SECONDS) == 0, run.text
    seconds = time.monotonic() - begin
    jobs = run.text.count("has been submitted with SLURM jobid")
    assert jobs > 2 * CHUNKS
    assert not list_differences(local, read_results(folder))
    begin = time.monotonic()
    again = start(tmp_path / "local")
    assert again.wait() == 0, again.text
    measured = {"jobs": jobs, "seconds": seconds, "local": time.monotonic() - begin, "cores": CORES}
    SUMMARY.parent.mkdir(parents=True, exist_ok=True)
    SUMMARY.write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")


def test_after_a_node_has_failed_only_the_jobs_that_it_ran_are_repeated(start_cluster, slurm, local, tmp_path):
    folder = tmp_path / "work"
    run = start_cluster(folder)

    def trial_files():
        return sorted(folder.glob("results/trials/study/*.nc"))

    def log_of(path):
        """Log of the job that wrote a trial file: Snakemake renews the time of the file, but not that of the log."""
        return folder / "logs" / "simulate" / "study" / f"{path.stem}.log"

    run.wait_for(lambda: len(trial_files()) > CORES and slurm.running_jobs(), SECONDS)
    interrupted = {line.split(maxsplit=1)[0] for line in slurm.running_jobs()}
    slurm.fail_node()
    before = {log: log.stat().st_mtime_ns for log in map(log_of, trial_files())}
    slurm.start_node()
    assert run.wait(SECONDS) == 0, run.text
    assert interrupted
    logs = [log for log, time in before.items() if log.stat().st_mtime_ns == time]
    assert len(logs) >= len(before) - len(interrupted) > 0
    assert not list_differences(local, read_results(folder))
