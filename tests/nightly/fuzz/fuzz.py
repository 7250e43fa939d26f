"""Damaged files for every reader: each has to be read or refused, in time, by a message that names it."""

import gzip
import multiprocessing
import resource
import signal
import time
import traceback
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import yaml

from ankleloop import DataError, LongRecord, read_trial
from ankleloop.studies.checking import ConfigError, check_config_file
from ankleloop.studies.study import read_studies
from ankleloop.trials import reading_process
from ankleloop.trials.validation import validate
from fuzz.corpus import READERS, make_corpus
from fuzz.mutation import mutate

LONGEST = 12.0  # s: reading stops after 10 s
MOST_MEMORY = 1 << 30  # bytes
OPTIONS = (
    *[{"sampling_rate": 200.0}] * 6,
    {},
    {"sampling_rate": 200.0, "position": "link"},
    {"sampling_rate": 200.0, "position": "group/angle"},
    {"sampling_rate": 200.0, "position": "rec.ankle.pos"},
    {"torque": "note"},
    {"reference": "time"},
    {"sampling_rate": 200.0, "position_unit": "deg", "torque_sign": -1},
)
CONFIG = Path(__file__).parents[3] / "config" / "config.yaml"


class SlowError(BaseException):
    """A file takes too long; no handler of errors of the program catches it."""


def _stop(*_):
    raise SlowError


def make_file(reader, number, seed, corpus):
    """Suffix and content of a damaged file, and the random generator for what follows."""
    rng = np.random.default_rng([seed, READERS.index(reader), number])
    suffix, content = corpus[rng.integers(len(corpus))]
    others = [other for _, other in corpus]
    if reader != "csv.gz":
        return suffix, mutate(content, others, rng), rng
    if rng.integers(2):  # damaged before it was compressed
        return ".csv.gz", gzip.compress(mutate(content, others, rng), mtime=0), rng
    return ".csv.gz", mutate(gzip.compress(content, mtime=0), others, rng), rng


def read_config(path, base):
    """Read a configuration as the workflow does: alone, or as one that changes `base`."""
    check_config_file(path)
    config = yaml.safe_load(path.read_text(encoding="utf-8"))
    read_studies(config if base is None else _merge(base, config))


def _merge(base, changes):
    """Snakemake's update of a configuration by another one."""
    if not (isinstance(base, dict) and isinstance(changes, dict)):
        return changes
    return {**base, **{key: _merge(base.get(key), value) for key, value in changes.items()}}


def call_reader(reader, path, rng, base=None):
    """Read a damaged file; returns what was read."""
    if reader == "config":
        return read_config(path, base)
    options = OPTIONS[rng.integers(len(OPTIONS))]
    if reader not in ("csv", "csv.gz", "matlab") and rng.integers(4) == 0:
        record = LongRecord(path, **{"reference": None, **options})
        return record.read(0, min(record.samples, 100))
    return validate(read_trial(path, **options))


def try_file(reader, path, rng, base=None):
    """Outcome of a file, and its message: "read", "refused" or "failures"."""
    start = time.monotonic()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            warnings.simplefilter("ignore", UserWarning)
            call_reader(reader, path, rng, base)
        outcome, message = "read", ""
    except (ConfigError, DataError) as error:
        outcome, message = "refused", str(error)
        if isinstance(error, ConfigError) != (reader == "config"):
            outcome, message = "failures", traceback.format_exc()
        if reader != "config" and path.name not in message:
            outcome, message = "failures", f"the message does not name the file: {message}"
    except (Exception, SlowError):
        outcome, message = "failures", traceback.format_exc()
    seconds = time.monotonic() - start
    return ("failures", f"took {seconds:.1f} s: {message}") if seconds > LONGEST else (outcome, message)


def fuzz(reader, minutes, seed, folder):
    """Try files of a reader until the time is over: outcomes, messages of failures by file, and most memory [bytes]."""
    corpus, counts, failures = make_corpus(reader), Counter(), {}
    base = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    if reader == "config":  # which is read in this process
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MOST_MEMORY, resource.RLIM_INFINITY))
    signal.signal(signal.SIGALRM, _stop)
    end = time.monotonic() + 60 * minutes
    while time.monotonic() < end:
        suffix, content, rng = make_file(reader, counts["files"], seed, corpus)
        path = folder / f"{reader.replace('.', '-')}-{seed}-{counts['files']}{suffix}"
        path.write_bytes(content)
        # Only of a configuration, because other readers have to stop by themselves.
        signal.setitimer(signal.ITIMER_REAL, LONGEST if reader == "config" else 10 * LONGEST)
        try:
            outcome, message = try_file(reader, path, rng, base if rng.integers(2) else None)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        counts.update(["files", outcome])
        if outcome == "failures":
            failures[path.name] = message
        else:
            path.unlink()
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    reading_process.stop()  # its peak of memory is known once it has ended
    peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) * 1024
    return counts, failures, peak


def fuzz_reader(reader, minutes, seed, folder):
    """Counts of a reader and its failures, in a process of its own, which a file may crash."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        try:
            counts, failures, peak = pool.submit(fuzz, reader, minutes, seed, folder).result()
        except BrokenProcessPool:
            return Counter(), {"the file that is left in the folder": "crashed the process of the caller"}
    if peak > 1.2 * MOST_MEMORY:
        failures["memory"] = f"{peak / 1e9:.2f} GB"
    return counts, failures
