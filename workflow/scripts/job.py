"""The log file of a job; on the terminal one line of what it made, or why it failed."""

import logging
import sys
import time
from contextlib import contextmanager

from ankleloop.errors import describe_error

log = logging.getLogger("ankleloop")


@contextmanager
def running(snakemake):
    """Send the log to the log file of the job; an error is one line on the terminal, and its trace is in the log."""
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
        print(f"{describe(snakemake)}, {time.monotonic() - start:.0f} s", file=sys.stderr)
    except Exception as error:
        wildcards = [f"{name} {value}" for name, value in snakemake.wildcards.items()]
        job = ", ".join([f"rule {snakemake.rule}", *wildcards])
        places = getattr(error, "__notes__", [])
        message = f"{'; '.join([job, *places])}: {describe_error(error)}"
        log.error("%s", message, exc_info=error)
        sys.exit(f"{message} (The log has all details: {snakemake.log})")


def describe(snakemake):
    """Rule and wildcards of a job, and how many trials or recordings it takes."""
    arguments, points = (getattr(snakemake.params, name, {}) for name in ("arguments", "points"))
    trials = sum(part["stop"] - part["first"] for part in arguments.get("conditions", {}).values())
    counts = [f"{trials} trials"] * bool(trials) + [f"{len(points)} recordings"] * bool(points)
    return ", ".join([" ".join([snakemake.rule.replace("_", " "), *snakemake.wildcards]), *counts])
