"""The log file of a job, and errors and failures in plain words."""

import logging
import sys
from contextlib import contextmanager

from ankleloop.errors import describe_error

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
