"""A process that opens files which may be damaged, with limits of time and memory.

A file that is damaged in a way that crashes or halts the library of its format, or makes it take all memory, gives an
`UnreadableError`, and nothing else happens. The process is started for the first file (to start one takes longer than
to read a file), and serves those that follow, until a library fails: then its state is not to be trusted any more.

Requests and answers are lines of JSON over pipes, and behind the line of an array stand so many samples as it says:
nothing in an answer is executed, and no answer can be taken for another one. Every wait for an answer has a limit.

On Windows neither memory nor the time of the processor is limited: there the wait for the answer ends the process.
"""

from __future__ import annotations

import atexit
import io
import json
import mmap
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ankleloop.errors import DataError, ResourceError
from ankleloop.trials.files import UnreadableError, describe_cause, has_checksum

# Limits of the processor and of memory for a file.
SECONDS, SECONDS_PER_MEGABYTE = 10.0, 1.0
BYTES, BYTES_PER_BYTE = 1 << 30, 4
PATIENCE = 20.0  # times as long a busy machine or a slow disk may take
STARTING = 60.0  # s, until the process has started
# Statuses of a process that has not started or was killed, which says nothing about the file, and of one that has taken
# its time; they are numbers, as Windows has no such signals.
ENDED, PROFILED = (1, -9), -27

Arrays = Iterable[tuple[dict[str, Any], np.ndarray]]  # each with what is said of it
# Imports what it needs, without limits, and returns a generator that reads, within them: its arguments are a path, and
# what was asked beside it.
Task = Callable[..., Arrays]


class GuardedProcess:
    """The process that opens files, with pipes as its standard input and output.

    `main` is the function that it runs: it serves tasks, by `serve`.
    """

    def __init__(self, main: Callable[[], None]) -> None:
        self.program = write_program(main)
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        atexit.register(self.stop)
        if hasattr(os, "register_at_fork"):  # where programs fork
            os.register_at_fork(after_in_child=self._forget)

    def _forget(self) -> None:
        """A fork of this program starts a process of its own."""
        self._process = None
        self._lock = threading.Lock()

    def _start(self) -> Any:
        """Start the process."""
        # Without a buffer of requests, of which a fork would have a copy.
        process = start_python(
            self.program, stderr=subprocess.DEVNULL, bufsize=0, start_new_session=True
        )
        process.stdout = io.BufferedReader(process.stdout)
        return process

    def stop(self) -> None:
        """End the process; the next file starts it again."""
        if self._process is not None:
            with self._process:
                self._process.kill()
            self._process = None

    def ask(self, path: Path, task: str, **wanted: Any) -> Arrays:
        """What a task gives of a file."""
        size = path.stat().st_size
        if size == 0:
            raise UnreadableError("it is empty, 0 bytes")
        request = {
            "task": task,
            "path": str(path.absolute()),
            "seconds": SECONDS + SECONDS_PER_MEGABYTE * size / 1e6,
            "memory": BYTES + BYTES_PER_BYTE * size,
            "wanted": wanted,
        }
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                self.stop()
                self._process = self._start()
            try:
                return _exchange(self._process, request, path.name)
            except DataError:
                raise
            except BaseException:
                # A library has failed, or the answer may be half read, after Ctrl-C for example.
                self.stop()
                raise


def write_program(main: Callable[[], None]) -> str:
    """Program that runs a function of a module in an interpreter of its own, which has the folder of the packages."""
    name = main.__name__
    return f"import sys; sys.path.insert(0, sys.argv[1]); from {main.__module__} import {name}; {name}()"


def start_python(program: str, **options: Any) -> Any:
    """Start an interpreter that runs such a program, with pipes as its standard input and output."""
    package_folder = str(Path(__file__).parents[2])
    # -P: files of the current folder that have the name of a module are not imported.
    command = [sys.executable, "-P", "-c", program, package_folder]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, **options)


def _exchange(process: subprocess.Popen[bytes], request: dict[str, Any], name: str) -> Arrays:
    """Send a request about a file, and receive arrays, or end the process if that takes too long."""
    watch = threading.Timer(STARTING + PATIENCE * request["seconds"], process.kill)
    watch.daemon = True
    watch.start()
    arrays: list[tuple[dict[str, Any], np.ndarray]] = []
    try:
        _send(process.stdin, request)
        while "size" in (answer := _receive(process.stdout)):
            samples = _receive_samples(process.stdout, answer.pop("size"))
            arrays.append((answer, samples))
    except (OSError, EOFError):
        status = process.wait()
        if status in ENDED:
            raise ResourceError(
                f"{name}: the process that reads it did not start, was killed, or did not answer in time: free memory, "
                "wait for other programs or a slow disk, and try again."
            ) from None
        if status == PROFILED:
            fault = f"stopped after {request['seconds']:.0f} s, the limit for its size"
        else:
            fault = f"it crashed the process that reads it, status {status}"
        raise UnreadableError(fault) from None
    finally:
        watch.cancel()
    if "refusal" in answer:
        raise DataError(answer["refusal"], answer["remedy"])
    if "reason" in answer:
        raise UnreadableError(answer["reason"])
    return arrays


# --- Messages: a line of JSON, and behind it the samples of a variable


def _send(pipe: Any, content: dict[str, Any], samples: Any = b"") -> None:
    """Send a line, and samples, at once."""
    message = b"".join([json.dumps(content).encode(), b"\n", samples])
    if pipe.write(message) < len(message):
        raise EOFError


def _receive(pipe: Any) -> dict[str, Any]:
    """Receive a line."""
    line = pipe.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    content: dict[str, Any] = json.loads(line)
    return content


def _receive_samples(pipe: Any, count: int) -> np.ndarray:
    """Receive so many samples."""
    content = pipe.read(8 * count)
    if len(content) < 8 * count:
        raise EOFError
    return np.frombuffer(content, "<f8")


# --- What runs in the other process


def serve(tasks: Mapping[str, Task]) -> None:
    """Answer requests until the pipe is closed."""
    requests = os.fdopen(0, "rb")
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    with suppress(EOFError):
        while True:
            end = _answer(answers, _receive(requests), tasks)
            _send(answers, end)
            answers.flush()


def _answer(pipe: Any, request: dict[str, Any], tasks: Mapping[str, Task]) -> dict[str, Any]:
    """Do a task with a file, and send the arrays that it gives; its end."""
    path = Path(request["path"])
    memory = request["memory"]
    try:
        arrays = tasks[request["task"]](path, **request["wanted"])
        _limit(request["seconds"], memory)
        has_checksum(path)
        for description, samples in arrays:
            _send(pipe, {**description, "size": samples.size}, np.ravel(samples).data)
    except DataError as error:
        return {"refusal": str(error), "remedy": error.remedy}
    except MemoryError:
        return {"reason": f"it needs more than {memory / 1e9:.1f} GB of memory"}
    except Exception as cause:  # the libraries raise almost anything on a damaged file
        return {"reason": describe_cause(cause)}
    finally:
        _limit(0.0, memory)
    return {}


def _limit(seconds: float, memory: int) -> None:
    """Limit the time [s], where 0 lifts the limit, and the memory to what is in use and so many bytes.

    The limit of the memory is one of the address space, in which mapped files count, too.
    """
    if hasattr(signal, "setitimer"):  # not on Windows
        signal.setitimer(
            signal.ITIMER_PROF, seconds
        )  # of the processor; its end is that of the process
    with suppress(ImportError, OSError, ValueError):  # not on Linux, or above a limit of the system
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
        hard_limit = resource.getrlimit(resource.RLIMIT_AS)[1]
        resource.setrlimit(resource.RLIMIT_AS, (pages * mmap.PAGESIZE + memory, hard_limit))
