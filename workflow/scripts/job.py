"""What every script shares: a log file, progress in it, and errors in plain words."""

import logging
import sys
import time
import traceback
from contextlib import contextmanager

log = logging.getLogger("ankleloop")
# Where this package is, jsonschema compiles a grammar of IRIs for two seconds; what jobs read has none.
sys.modules.setdefault("rfc3987_syntax", None)


@contextmanager
def running(snakemake):
    """Send the log to the job's log file; on an error say it on the terminal in one line, too."""
    logging.basicConfig(
        filename=str(snakemake.log), filemode="w", format="%(asctime)s %(message)s", level=logging.INFO, force=True
    )
    try:
        yield
    except Exception as error:
        log.error("%s", traceback.format_exc())
        what = ", ".join(f"{name} {value}" for name, value in snakemake.wildcards.items())
        sys.exit(f"{type(error).__name__} in {what}: {error}\nThe whole story is in {snakemake.log}.")


def progress(items, done, total=None):
    """Hand on items, and log how far the job has come; a generator does not know how many there are in total."""
    total = f" of {len(items) if total is None else total}" if total is not None or hasattr(items, "__len__") else ""
    start = time.perf_counter()
    for number, item in enumerate(items, start=1):
        yield item
        log.info("%s trial %d%s after %.1f s", done, number, total, time.perf_counter() - start)
