"""The log file of a job, and errors and failures in plain words."""

import logging
import sys
import time
from contextlib import contextmanager

from ankleloop.studies.failures import describe_error

log = logging.getLogger("ankleloop")


@contextmanager
def running(snakemake):
    """Send the log to the log file of the job; an error is one line on the terminal, and its trace is in the log."""
    logging.basicConfig(
        filename=str(snakemake.log), filemode="w", format="%(asctime)s %(message)s", level=logging.INFO, force=True
    )
    try:
        yield
    except Exception as error:
        wildcards = [f"{name} {value}" for name, value in snakemake.wildcards.items()]
        job = ", ".join([f"rule {snakemake.rule}", *wildcards])
        places = getattr(error, "__notes__", [])
        message = f"{'; '.join([job, *places])}: {describe_error(error)}"
        log.error("%s", message, exc_info=error)
        sys.exit(f"{message} (The log has all details: {snakemake.log})")


def progress(items, count, action):
    """Yield items, and log how many have been processed."""
    start = time.perf_counter()
    for number, item in enumerate(items, start=1):
        yield item
        log.info("%s %d of %d after %.1f s", action, number, count, time.perf_counter() - start)


def print_failed_trials(snakemake, failed):
    """Say on the terminal which trials could not be simulated."""
    for point in dict.fromkeys(trial.point for trial in failed):
        trials = [trial for trial in failed if trial.point == point]
        place = f"study {snakemake.wildcards.study}, point {point}"
        text = f"{len(trials)} trials could not be simulated, from trial {trials[0].number} on"
        print(f"{place}: {text}: {trials[0].reason}", file=sys.stderr)


def print_failures(snakemake):
    """Say on the terminal how many identifications of a chunk failed."""
    from ankleloop.paper.results import read_results  # here: other jobs do without pandas
    from ankleloop.paper.trial_counts import describe_failures

    message = describe_failures(read_results([snakemake.output.parameters]))
    if message:
        print(f"{snakemake.wildcards.study}, chunk {snakemake.wildcards.chunk}: {message}", file=sys.stderr)
