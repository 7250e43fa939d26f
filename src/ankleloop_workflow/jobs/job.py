"""The log file of a job; on the terminal one line of what it made, or why it failed."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ankleloop.errors import describe_error

log = logging.getLogger(__name__)


@contextmanager
def running(snakemake: Any) -> Iterator[None]:
    """Send the log to the log file of the job; an error is one line on the terminal, and its trace is in the log.

    Parameters
    ----------
    snakemake : object
        What Snakemake gives to the script of a job: its rule, wildcards and log.
    """
    logging.basicConfig(
        filename=str(snakemake.log),
        filemode="w",
        format="%(asctime)s %(message)s",
        level=logging.INFO,
        force=True,
    )
    start = time.monotonic()
    try:
        yield
        words = [snakemake.rule.replace("_", " "), *snakemake.wildcards]
        print(f"{' '.join(words)}, {time.monotonic() - start:.0f} s", file=sys.stderr)
    except Exception as error:
        wildcards = [f"{name} {value}" for name, value in snakemake.wildcards.items()]
        job = ", ".join([f"rule {snakemake.rule}", *wildcards])
        places = getattr(error, "__notes__", [])
        message = f"{'; '.join([job, *places])}: {describe_error(error)}"
        log.error("%s", message, exc_info=error)
        sys.exit(f"{message} (The log has all details: {snakemake.log})")
