"""One function for many items, in processes side by side, which a script and a notebook need not prepare for.

Where processes can be forked safely (Linux), they are forks of this one after its imports. Elsewhere they are
interpreters of their own: a pool that starts processes anew would run the script of its user again in each of them.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from ankleloop.errors import ResourceError
from ankleloop.trials.guarded_process import start_python, write_program

IS_FORKED = sys.platform == "linux"
KILLED = (
    "the process of the analysis was killed: most often memory was short; free memory, take fewer processes at a time, "
    "or a shorter part of the recording (start, stop)."
)

NEW_OBJECTS = 50_000  # after which a fork searches for cycles
SHORTER = {"start": None, "stop": None}  # options that take a shorter part

Function = Callable[[Any], Any]


def run_each(function: Function, items: Sequence[Any], jobs: int = 1) -> Iterator[Any]:
    """Results of a function of each of some items, in their order, from so many processes side by side.

    Function, items and results have to be such that another process can be given them. The system may kill a process,
    which says nothing about its item: that is a `ResourceError`.
    """
    count = max(1, min(jobs, len(items)))
    if IS_FORKED:
        return _run_forks(function, items, count)
    if count == 1:
        return map(function, items)
    return _run_interpreters(function, items, count)


def _run_forks(function: Function, items: Sequence[Any], count: int) -> Iterator[Any]:
    """Results from forks of this process."""
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(count, mp_context=context, initializer=_begin) as pool:
        try:
            yield from pool.map(function, items)
        except BrokenProcessPool:
            raise ResourceError(KILLED, remedy=SHORTER) from None


def _begin() -> None:
    """End a fork where its parent is killed, which cannot say so."""
    # Modules of the parent stay, and figures are many small objects: to search them all for cycles takes an eighth of
    # the time.
    gc.freeze()
    gc.set_threshold(NEW_OBJECTS)
    parent: Any = multiprocessing.parent_process()
    threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()


def _run_interpreters(function: Function, items: Sequence[Any], count: int) -> Iterator[Any]:
    """Results from interpreters of their own, which take the items in turn."""
    started = [_start_interpreter(function, items[first::count]) for first in range(count)]
    try:
        for number in range(len(items)):
            result, error = pickle.load(started[number % count].stdout)  # noqa: S301  # our own
            if error is not None:
                raise error
            yield result
    except EOFError:
        raise ResourceError(KILLED, remedy=SHORTER) from None
    finally:
        for process in started:
            process.kill()
            process.stdout.close()
            process.wait()


def _start_interpreter(function: Function, items: Sequence[Any]) -> Any:
    """Start an interpreter that runs a function for some items, and writes what they give to its output."""
    process = start_python(write_program(main))
    pickle.dump((function, items), process.stdin)
    process.stdin.close()
    return process


def main() -> None:
    """Run a function for each item that came through the input, in an interpreter of its own."""
    output = sys.stdout.buffer
    sys.stdout = sys.stderr  # what a function prints is no result
    function, items = pickle.load(sys.stdin.buffer)  # noqa: S301  # of the process that started this one
    for item in items:
        result: tuple[Any, Exception | None]
        try:
            result = (function(item), None)
        except Exception as error:
            result = (None, error)
        pickle.dump(result, output)
        output.flush()
