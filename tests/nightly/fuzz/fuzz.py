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

import numpy as np

from ankleloop import DataError, load_estimate, load_trial, read_trial
from ankleloop.trials import readable_files
from ankleloop.trials.trial import validate
from ankleloop.trials.trial_files import load_trials
from ankleloop_lab.files import reading_process
from fuzz.corpus import READERS, make_corpus
from fuzz.mutation import mutate

LONGEST = 60  # s: reading stops after 10 s, on a busy machine later
MOST_MEMORY = 1.2 * 2**30  # bytes
OPTIONS = (
    *[{"sampling_rate": 200.0}] * 6,
    {},
    {"sampling_rate": 200.0, "position": "link"},
    {"sampling_rate": 200.0, "position": "rec.ankle.pos"},
    {"position": "T.position"},
    {"torque": "note"},
    {"reference": "time"},
    {"sampling_rate": 200.0, "position_unit": "deg", "torque_sign": -1},
)
OWN = {
    "trial": load_trial,
    "trials": lambda path: list(load_trials(path)),
    "estimate": load_estimate,
}


def make_file(reader, corpus, rng):
    """Suffix and content of a damaged file."""
    suffix, content = corpus[rng.integers(len(corpus))]
    others = [other for _, other in corpus]
    if reader != "csv.gz":
        return suffix, mutate(content, others, rng)
    if rng.integers(2):  # damaged before it was compressed
        return ".csv.gz", gzip.compress(mutate(content, others, rng), mtime=0)
    return ".csv.gz", mutate(gzip.compress(content, mtime=0), others, rng)


def read_file(reader, path, rng):
    """Read a damaged file."""
    options = OPTIONS[rng.integers(len(OPTIONS))]
    if reader in OWN:
        OWN[reader](path)
    else:
        validate(read_trial(path, **options))


def try_file(reader, path, rng):
    """Outcome of a file, and its message: "read", "refused" or "failures"."""
    start = time.monotonic()
    outcome, message = "read", ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            warnings.simplefilter("ignore", UserWarning)
            read_file(reader, path, rng)
    except DataError as error:
        outcome, message = "refused" if path.name in str(error) else "failures", str(error)
    except Exception:
        outcome, message = "failures", traceback.format_exc()
    seconds = time.monotonic() - start
    return (
        ("failures", f"took {seconds:.1f} s: {message}")
        if seconds > LONGEST
        else (outcome, message)
    )


def fuzz(reader, minutes, seed, folder):
    """Try files of a reader until the time is over: outcomes, and messages of failures by file."""
    corpus, counts, failures = make_corpus(reader, folder), Counter(), {}
    end = time.monotonic() + 60 * minutes
    while time.monotonic() < end:
        rng = np.random.default_rng([seed, READERS.index(reader), counts["files"]])
        suffix, content = make_file(reader, corpus, rng)
        path = folder / f"{reader.replace('.', '-')}-{seed}-{counts['files']}{suffix}"
        path.write_bytes(content)
        signal.alarm(2 * LONGEST)  # it ends a process that hangs
        outcome, message = try_file(reader, path, rng)
        counts.update(["files", outcome])
        if outcome == "failures":
            failures[path.name] = message
        else:
            path.unlink()
    signal.alarm(0)
    # Their peak of memory is known once they have ended.
    reading_process.process.stop()
    readable_files.process.stop()
    peak = (
        max(
            resource.getrusage(who).ru_maxrss
            for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
        )
        * 1024
    )
    return counts, failures | ({"memory": f"{peak / 1e9:.2f} GB"} if peak > MOST_MEMORY else {})


def fuzz_reader(reader, minutes, seed, folder):
    """Counts of a reader and its failures, in a process of its own, which a file may crash or halt."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        try:
            return pool.submit(fuzz, reader, minutes, seed, folder).result()
        except BrokenProcessPool:
            return Counter(), {
                "the file that is left in the folder": "crashed the process of the caller"
            }
