"""Files that may be damaged are opened by another process, with limits of time and memory.

A file that is damaged in a way that crashes or halts the library of its format, or makes it take all memory, gives a
`DataError`, and nothing else happens. The process is started for the first file (to start one takes longer than to read
a file), and serves those that follow, until a library fails: then its state is not to be trusted any more.

Requests and answers are lines of JSON over pipes, and the samples of a variable stand behind its line, in one message:
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
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ankleloop.errors import DataError, ResourceError
from ankleloop.trials import channels
from ankleloop.trials.contents import Contents, Variable
from ankleloop.trials.files import (
    PathLike,
    UnreadableError,
    check_readable,
    has_checksum,
    stamp_file,
)

TABLES = (".csv", ".csv.gz", ".txt", ".tsv")
SUFFIXES = (*TABLES, ".mat", ".h5", ".hdf5", ".nc", ".flb", ".c3d", ".tdms")
# Limits of the processor and of memory for a file.
SECONDS, SECONDS_PER_MEGABYTE = 10.0, 1.0
BYTES, BYTES_PER_BYTE = 1 << 30, 4
PATIENCE = 20.0  # times as long a busy machine or a slow disk may take
STARTING = 60.0  # s, until the process has started
LENGTH_BYTES = 8  # of a message
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
MATLAB_HEADER = 512  # bytes before that signature in files of MATLAB v7.3
PROGRAM = "import sys; sys.path.insert(0, sys.argv[1]); from ankleloop.trials.reading_process import main; main()"
WHOLE = "check that the file is whole and its suffix right, or restore it from a copy"
LATE = "it was not read in time: the computer is busy, or the disk slow"
# Statuses of a process that a signal has ended: Windows has no such signals, and no names of them.
KILLED, ALARMED, PROFILED = -9, -14, -27
# How the process may end without an answer, where that says nothing about the file.
ENDS = {
    1: f"the process that reads it did not start: {sys.executable} -P -c ... failed; use another Python",
    KILLED: "the process that reads it was killed (SIGKILL), most often as memory was short: free memory",
    ALARMED: LATE,
}


def read_channels(
    path: PathLike, case: int | None, task: str = "read", **wanted: Any
) -> dict[str, Variable]:
    """Read the variables of a trial from a file by role, with its times and its sampling rates.

    `wanted` is what `channels.read_channels` takes beside the open file. The task "find" finds the variables in a file
    of any size, without their samples: `wanted` is what `channels.find_channels` takes.
    """
    path = check_readable(path)
    suffix = find_suffix(path)
    if suffix is None:
        raise DataError(
            f"{path.name}: unknown kind of file: convert it to one of {', '.join(SUFFIXES)}."
        )
    with name_errors(path.name, f"{suffix} file", WHOLE):
        return _ask(path, task, case, wanted)


def find_suffix(path: Path) -> str | None:
    """Suffix by which the format of a file is chosen; None if it is unknown."""
    return next((suffix for suffix in SUFFIXES if path.name.lower().endswith(suffix)), None)


@contextmanager
def readable_file(path: PathLike, kind: str, advice: str) -> Iterator[Path]:
    """Provide a file of this library that can be opened in this process.

    A file without a checksum (of an older version, or changed by another program) is opened by the other process first.
    """
    path = check_readable(path)
    with name_errors(path, kind, advice):
        if not has_checksum(path):
            _ask(path, "try", None, {})
        yield path


@contextmanager
def name_errors(path: PathLike, kind: str, advice: str) -> Iterator[None]:
    """Say in plain words what is wrong with the contents of a file."""
    try:
        yield
    except (DataError, ResourceError, MemoryError):  # a lack of memory says nothing about the file
        raise
    except Exception as cause:
        raise DataError(
            f"{path}: not a readable {kind} ({_describe(cause)}): it is damaged, or of another origin: {advice}."
        ) from cause


def _describe(cause: Exception) -> str:
    """What an error says, in one line, with its type unless it is one of ours."""
    text = str(cause) if isinstance(cause, UnreadableError) else f"{type(cause).__name__}: {cause}"
    return text.partition("\n")[0][:300]


# The process that opens files, with pipes as its standard input and output.
_reader: subprocess.Popen[bytes] | None = None
_lock = threading.Lock()


def _start() -> subprocess.Popen[bytes]:
    """Start the process that opens files."""
    package_folder = str(Path(__file__).parents[2])
    return subprocess.Popen(
        # -P: files of the current folder that have the name of a module are not imported.
        [sys.executable, "-P", "-c", PROGRAM, package_folder],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        bufsize=0,
        start_new_session=True,
    )


@atexit.register
def stop() -> None:
    """End the process that reads files; the next file starts it again."""
    global _reader
    if _reader is not None:
        with _reader:
            _reader.kill()
        _reader = None


def _forget() -> None:
    """A fork of this program starts a process of its own."""
    global _reader, _lock
    _reader = None
    _lock = threading.Lock()


if hasattr(os, "register_at_fork"):  # where programs fork
    os.register_at_fork(after_in_child=_forget)


def _ask(path: Path, task: str, case: int | None, wanted: dict[str, Any]) -> dict[str, Variable]:
    """What the other process reads of a file."""
    global _reader
    stamp = stamp_file(path)
    size = path.stat().st_size
    if size == 0:
        raise UnreadableError("it is empty, 0 bytes")
    request = {
        "task": task,
        "path": str(path.absolute()),
        "case": case,
        "seconds": SECONDS + SECONDS_PER_MEGABYTE * size / 1e6,
        "memory": BYTES + BYTES_PER_BYTE * size,
        "wanted": wanted,
    }
    with _lock:
        if _reader is None or _reader.poll() is not None:
            stop()
            _reader = _start()
        try:
            return _exchange(_reader, request, path.name)
        except DataError:
            raise
        except BaseException:
            # A library has failed, or the answer may be half read, after Ctrl-C for example.
            stop()
            raise
        finally:
            if stamp_file(path) != stamp:
                raise DataError(
                    f"{path.name}: the file has changed while it was read: wait until it is whole."
                )


def _exchange(
    process: subprocess.Popen[bytes], request: dict[str, Any], name: str
) -> dict[str, Variable]:
    """Send a request about a file, and receive variables by role, or end the process if that takes too long."""
    variables: dict[str, Variable] = {}
    is_late = threading.Event()

    def end_process() -> None:
        is_late.set()
        process.kill()

    watch = threading.Timer(STARTING + PATIENCE * request["seconds"], end_process)
    watch.daemon = True
    watch.start()
    try:
        _send(process.stdin, _line(request))
        while (answer := _receive_answer(process.stdout, variables)) is None:
            pass
    except (OSError, EOFError):
        status = process.wait()
        end = LATE if is_late.is_set() else ENDS.get(status)
        if end is not None:
            raise ResourceError(f"{name}: {end}; try again.") from None
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
    for text in answer["warnings"]:
        warnings.warn(text, UserWarning, stacklevel=5)  # of the caller of read_trial
    return variables


def _receive_answer(pipe: Any, variables: dict[str, Variable]) -> dict[str, Any] | None:
    """Receive a variable; what else the process answers is the end."""
    message = _receive(pipe)
    end = message.index(b"\n") + 1
    answer: dict[str, Any] = json.loads(message[:end])
    if "role" not in answer:
        return answer
    variables[answer["role"]] = Variable(
        name=answer["name"],
        shape=tuple(answer["shape"]),
        read=partial(np.frombuffer, message, "<f8", offset=end),
        attributes={"unit": answer["unit"]},
        count=answer["count"],
    )
    return None


# --- Messages over a pipe without a buffer, of which a fork would have a copy


def _line(content: dict[str, Any]) -> bytes:
    """A line of JSON."""
    return json.dumps(content).encode() + b"\n"


def _send(pipe: Any, message: bytes) -> None:
    """Send a message behind its length."""
    for part in (len(message).to_bytes(LENGTH_BYTES, "little"), message):
        rest = memoryview(part)
        while rest:
            rest = rest[pipe.write(rest) :]


def _receive(pipe: Any) -> bytearray:
    """Receive a message."""
    length = int.from_bytes(_receive_bytes(pipe, LENGTH_BYTES), "little")
    return _receive_bytes(pipe, length)


def _receive_bytes(pipe: Any, length: int) -> bytearray:
    """Receive so many bytes."""
    message = bytearray(length)
    rest = memoryview(message)
    while rest:
        count = pipe.readinto(rest)
        if not count:
            raise EOFError
        rest = rest[count:]
    return message


# --- What runs in the other process


def _try(contents: Contents) -> tuple[()]:
    """Read everything, and give nothing."""
    for name in contents.names():
        contents.require(name).read()
    return ()


TASKS: dict[str, Any] = {
    "find": channels.find_channels,
    "read": channels.read_channels,
    "try": _try,
}


def main() -> None:
    """Answer requests until the pipe is closed."""
    requests = io.FileIO(0)
    answers = io.FileIO(os.dup(1), "w")
    os.dup2(2, 1)  # what a library prints is no answer
    with suppress(EOFError):
        while True:
            request = json.loads(_receive(requests))
            _send(answers, _line(_answer(answers, request)))


def _answer(pipe: Any, request: dict[str, Any]) -> dict[str, Any]:
    """Do a task with a file, and send the variables that it gives; its end."""
    path = Path(request["path"])
    memory = request["memory"]
    try:
        container = choose_container(path, request["case"])  # a library is imported without limits
        _limit(request["seconds"], memory)
        has_checksum(path)
        contents = container(path)
        task = TASKS[request["task"]]
        for role, variable, numbers in task(contents, **request["wanted"]):
            line = _line(
                {
                    "role": role,
                    "name": variable.name,
                    "shape": variable.shape,
                    "unit": variable.unit,
                    "count": variable.count,
                }
            )
            _send(pipe, b"".join([line, np.ravel(numbers).data]))
        return {"warnings": contents.warnings}
    except DataError as error:
        return {"refusal": str(error), "remedy": error.remedy}
    except MemoryError:
        return {"reason": f"it needs more than {memory / 1e9:.1f} GB of memory"}
    except Exception as cause:  # the libraries raise almost anything on a damaged file
        return {"reason": _describe(cause)}
    finally:
        _limit(0.0, memory)


def choose_container(path: Path, case: int | None) -> Callable[[Path], Contents]:
    """Class that opens a file; its module imports the libraries of the format."""
    suffix = str(find_suffix(path))
    if case is not None and suffix != ".flb":
        raise DataError(f"{path.name}: case chooses a trial of an .flb file: leave it out.")
    if suffix in TABLES:
        from ankleloop.trials.csv_files import CsvContents

        return CsvContents
    if suffix in (".c3d", ".tdms"):
        from ankleloop.trials.recorder_files import find_container

        return find_container(path, suffix)
    from ankleloop.trials.binary_files import (
        ClassicNetcdfContents,
        FlbContents,
        Hdf5Contents,
        MatContents,
    )

    with open(path, "rb") as file:
        start = file.read(MATLAB_HEADER + len(HDF5_SIGNATURE))
    if HDF5_SIGNATURE in (start[: len(HDF5_SIGNATURE)], start[MATLAB_HEADER:]):
        return Hdf5Contents
    if suffix == ".flb":
        return partial(FlbContents, case=case)
    containers = {".mat": MatContents, ".nc": ClassicNetcdfContents}
    return containers.get(suffix, Hdf5Contents)


def _limit(seconds: float, memory: int) -> None:
    """Limit the time [s], where 0 lifts the limit, and the memory to what is in use and so many bytes.

    The limit of the memory is one of the address space, in which mapped files count, too.
    """
    if hasattr(signal, "setitimer"):  # not on Windows
        signal.setitimer(signal.ITIMER_PROF, seconds)  # of the processor; they end the process
        signal.setitimer(signal.ITIMER_REAL, PATIENCE * seconds)
    with suppress(ImportError, OSError, ValueError):  # not on Linux, or above a limit of the system
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
        hard_limit = resource.getrlimit(resource.RLIMIT_AS)[1]
        resource.setrlimit(resource.RLIMIT_AS, (pages * mmap.PAGESIZE + memory, hard_limit))
