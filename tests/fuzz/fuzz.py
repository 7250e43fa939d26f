"""Fuzzer of the readers: files that are damaged at random have to be read, or refused by a clear error.

    python tests/fuzz/fuzz.py --minutes 10 --processes 2 --json counts.json

A failure is any other outcome: another error than `DataError` (of a configuration, `ConfigError`), a message that does
not name the file, a crash, more than 12 s, or more than 1 GB. Files that fail are written to a folder. File number k
of a seed is the same in every run.
"""

import argparse
import concurrent.futures
import gzip
import json
import multiprocessing
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).parents[1]))
from ankleloop import DataError, LongRecord, read_trial
from ankleloop.records import reading_process
from ankleloop.records.validation import validate
from ankleloop.studies.checking import ConfigError
from ankleloop.studies.config_files import check_config_file
from ankleloop.studies.study import read_studies
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
# What a message of a refused file says of its reading process.
SIGNS = {"crashes": "it crashed the process", "stopped": "(stopped after", "memory": "GB of memory"}
CONFIG = Path(__file__).parents[2] / "config" / "config.yaml"


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
    except SlowError:
        outcome, message = "failures", "too slow"
    except Exception:
        outcome, message = "failures", traceback.format_exc()
    seconds = time.monotonic() - start
    return ("failures", f"took {seconds:.1f} s: {message}") if seconds > LONGEST else (outcome, message)


def fuzz(reader, numbers, seconds, seed, folder):
    """Try files of a reader until the time is over; counts of outcomes, and messages of failures by file."""
    corpus, counts, failures = make_corpus(reader), Counter(), {}
    base = yaml.safe_load(CONFIG.read_text(encoding="utf-8")) if reader == "config" else None
    signal.signal(signal.SIGALRM, _stop)
    end = time.monotonic() + seconds
    for number in numbers:
        if time.monotonic() > end:
            break
        suffix, content, rng = make_file(reader, number, seed, corpus)
        path = folder / f"{reader.replace('.', '-')}-{seed}-{number}{suffix}"
        path.write_bytes(content)
        # Only of a configuration, because other readers have to stop by themselves.
        signal.setitimer(signal.ITIMER_REAL, LONGEST if reader == "config" else 10 * LONGEST)
        try:
            outcome, message = try_file(reader, path, rng, base if rng.integers(2) else None)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        counts.update(["files", outcome])
        counts.update(kind for kind, text in SIGNS.items() if text in message)
        if outcome == "failures":
            failures[path.name] = message
        else:
            path.unlink()
    return counts, failures


def _work(reader, worker, workers, seconds, seed, folder):
    """Task of a process: every so many-th file of a reader."""
    if reader == "config":  # which is read in this process
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MOST_MEMORY, resource.RLIM_INFINITY))
    start = time.monotonic()
    try:
        counts, failures = fuzz(reader, range(worker, 10**9, workers), seconds, seed, Path(folder))
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    reading_process.stop()  # its peak of memory is known once it has ended
    peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) * 1024
    return counts, failures, peak, time.monotonic() - start


def fuzz_reader(reader, minutes, workers, seed, folder):
    """Counts of a reader, its failures, and the peak of memory, from several processes."""
    total, failures, peaks, times = Counter(), {}, [], []
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(workers, mp_context=context) as pool:
        tasks = [
            pool.submit(_work, reader, worker, workers, 60 * minutes, seed, str(folder)) for worker in range(workers)
        ]
        for task in tasks:
            try:
                counts, failed, peak, seconds = task.result()
            except concurrent.futures.process.BrokenProcessPool:
                total["failures"] += 1
                failures["the file that is left in the folder"] = "crashed the process of the caller"
                continue
            total += counts
            failures |= failed
            peaks.append(peak)
            times.append(seconds)
    peak = max(peaks, default=0)
    if peak > 1.2 * MOST_MEMORY:
        total["failures"] += 1
        failures["memory"] = f"{peak / 1e9:.2f} GB"
    keys = ("files", "read", "refused", "failures", *SIGNS)
    return {
        **{key: total[key] for key in keys},
        "seconds": round(sum(times), 1),
        "peak_memory_mb": round(peak / 1e6),
    }, failures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=1.0, help="for each reader")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--readers", nargs="+", choices=READERS, default=READERS)
    parser.add_argument("--json", type=Path, help="file for the counts")
    parser.add_argument("--failures", type=Path, help="folder for files that fail; by default a temporary one")
    arguments = parser.parse_args()
    folder = arguments.failures or Path(tempfile.mkdtemp(prefix="fuzz-"))
    folder.mkdir(parents=True, exist_ok=True)
    results = {}
    for reader in arguments.readers:
        results[reader], failures = fuzz_reader(reader, arguments.minutes, arguments.processes, arguments.seed, folder)
        print(f"{reader:15}", ", ".join(f"{key} {value}" for key, value in results[reader].items()), flush=True)
        for name, message in failures.items():
            print(f"  FAILURE {folder / name}\n    {message.strip()[-1500:]}", flush=True)
    failed = sum(counts["failures"] for counts in results.values())
    if arguments.json:
        report = {"seed": arguments.seed, "minutes": arguments.minutes, "readers": results}
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    if not failed and not arguments.failures:
        shutil.rmtree(folder)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
