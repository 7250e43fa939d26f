"""The log file of a job, and errors in plain words."""

import logging
import sys
import time
import traceback
from contextlib import contextmanager

log = logging.getLogger("ankleloop")


@contextmanager
def running(snakemake):
    """Send the log to the log file of the job; on an error print one line on the terminal, too."""
    logging.basicConfig(
        filename=str(snakemake.log), filemode="w", format="%(asctime)s %(message)s", level=logging.INFO, force=True
    )
    try:
        yield
    except Exception as error:
        log.error("%s", traceback.format_exc())
        chunk = ", ".join(f"{name} {value}" for name, value in snakemake.wildcards.items()) or snakemake.rule
        sys.exit(f"{type(error).__name__} in {chunk}: {error}\nThe log has all details: {snakemake.log}.")


def progress(items, action):
    """Yield items, and log how many have been processed."""
    start = time.perf_counter()
    for number, item in enumerate(items, start=1):
        yield item
        log.info("%s %d of %d after %.1f s", action, number, len(items), time.perf_counter() - start)
