"""A study on a Slurm of one node, and what a node that fails costs."""

from slurm import CORES
from workflow_runs import CHUNKS, list_differences, read_results

SECONDS = 1500  # each job of a cluster starts Snakemake twice, and then its script


def test_results_of_a_cluster_are_those_of_one_machine(start_cluster, undisturbed, tmp_path):
    folder = tmp_path / "work"
    run = start_cluster(folder)
    assert run.wait(SECONDS) == 0, run.text
    assert run.text.count("has been submitted with SLURM jobid") > 2 * CHUNKS
    assert not list_differences(undisturbed[0], read_results(folder))


def test_after_a_node_has_failed_only_the_jobs_that_it_ran_are_repeated(
    start_cluster, slurm, undisturbed, tmp_path
):
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
    assert not list_differences(undisturbed[0], read_results(folder))
