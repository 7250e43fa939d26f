"""Files that may be damaged are opened by another process, with limits of time and memory.

A file that is damaged in a way that crashes or halts the library of its format, or makes it take all memory, gives a
`DataError`, and nothing else happens. The process is started for the first file (to start one takes longer than to read
a file), and serves those that follow, until a library fails: then its state is not to be trusted any more.

Requests and answers are JSON over a pipe, and samples behind their channel as bytes: nothing in an answer is executed.
"""

from __future__ import annotations

import atexit
import json
import mmap
import os
import resource
import signal
import subprocess
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any

import numpy as np

from ankleloop.errors import DataError, ResourceError
from ankleloop.trials.channels import (
    SUFFIXES,
    Contents,
    Variable,
    find_suffix,
    find_variables,
    select_channels,
)
from ankleloop.trials.files import (
    PathLike,
    UnreadableError,
    check_readable,
    has_checksum,
    stamp_file,
)

SECONDS, SECONDS_PER_MEGABYTE = 10.0, 1.0  # of the processor for a file
PATIENCE = 20.0  # times as long a busy machine or a slow disk may take
BYTES, BYTES_PER_BYTE = 1 << 30, 4  # of memory for a file
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
PROGRAM = "import sys; sys.path.insert(0, sys.argv[1]); from ankleloop.trials.reading_process import main; main()"
WHOLE = "check that the file is whole and its suffix right, or restore it from a copy"
# How the process may end without an answer, where that says nothing about the file.
ENDS = {
    1: f"the process that reads it did not start: {sys.executable} -P -c ... failed; use another Python",
    -signal.SIGKILL: "the process that reads it was killed (SIGKILL), most often as memory was short: free memory",
    -signal.SIGALRM: "it was not read in time: the computer is busy, or the disk slow",
}


def list_variables(path: PathLike, case: int | None = None) -> list[Variable]:
    """List the variables of a file of any size: full names, units and shapes."""
    return list(read_channels(path, case, "list").values())


def read_channels(
    path: PathLike, case: int | None, task: str = "read", **wanted: Any
) -> dict[str, Variable]:
    """Read the channels of a trial from a file, with its times and its sampling rate.

    `wanted` is what `channels.select_channels` takes beside the open file.
    """
    path = check_readable(path)
    suffix = find_suffix(path)
    if suffix is None:
        raise DataError(
            f"{path.name}: unknown kind of file: convert it to one of {', '.join(SUFFIXES)}."
        )
    with name_errors(path.name, f"{suffix} file", WHOLE):
        return _ask(path, task, case, wanted)


@contextmanager
def readable_file(path: PathLike, kind: str, remedy: str) -> Iterator[Path]:
    """Provide a file of this library that can be opened in this process.

    A file without a checksum (of an older version, or changed by another program) is opened by the other process first.
    """
    path = check_readable(path)
    with name_errors(path, kind, remedy):
        if not has_checksum(path):
            _ask(path, "try", None, {})
        yield path


@contextmanager
def name_errors(path: PathLike, kind: str, remedy: str) -> Iterator[None]:
    """Say in plain words what is wrong with the contents of a file."""
    try:
        yield
    except (DataError, ResourceError, MemoryError):  # a lack of memory says nothing about the file
        raise
    except Exception as cause:
        raise DataError(
            f"{path}: not a readable {kind} ({_describe(cause)}): it is damaged, or of another origin: {remedy}."
        ) from cause


def _describe(cause: Exception) -> str:
    kind = "" if isinstance(cause, UnreadableError) else f"{type(cause).__name__}: "
    return f"{kind}{cause}".partition("\n")[0][:300]


_reader: tuple[subprocess.Popen[bytes], Connection] | None = (
    None  # the process that opens files, and the pipe to it
)
_lock = threading.Lock()


def _start() -> tuple[subprocess.Popen[bytes], Connection]:
    pipe, end = Pipe()
    # -P: files of the current folder that have the name of a module are not imported.
    command = [
        sys.executable,
        "-P",
        "-c",
        PROGRAM,
        str(Path(__file__).parents[2]),
        str(end.fileno()),
    ]
    nothing = subprocess.DEVNULL
    with end:
        process = subprocess.Popen(
            command, stdout=nothing, stderr=nothing, pass_fds=[end.fileno()], start_new_session=True
        )
    return process, pipe


@atexit.register
def stop() -> None:
    """End the process that reads files; the next file starts it again."""
    global _reader
    if _reader is not None:
        _reader[0].kill()
        _reader[0].wait()
        _reader = None


def _forget() -> None:
    """A fork of this program starts a process of its own."""
    global _reader, _lock
    _reader, _lock = None, threading.Lock()


os.register_at_fork(after_in_child=_forget)


def _ask(path: Path, task: str, case: int | None, wanted: dict[str, Any]) -> dict[str, Variable]:
    """What the other process reads of a file."""
    global _reader
    stamp, size = stamp_file(path), path.stat().st_size
    if size == 0:
        raise UnreadableError("it is empty, 0 bytes")
    limits = (SECONDS + SECONDS_PER_MEGABYTE * size / 1e6, BYTES + BYTES_PER_BYTE * size)
    with _lock:
        if _reader is None or _reader[0].poll() is not None:
            _reader = _start()
        try:
            return _exchange(
                *_reader, [task, str(path.absolute()), case, *limits, wanted], path.name
            )
        except DataError:
            raise
        except (
            BaseException
        ):  # a library has failed, or the answer may be half read, after Ctrl-C for example
            stop()
            raise
        finally:
            if stamp_file(path) != stamp:
                raise DataError(
                    f"{path.name}: the file has changed while it was read: wait until it is whole."
                )


def _exchange(
    process: subprocess.Popen[bytes], pipe: Connection, request: list[Any], name: str
) -> dict[str, Variable]:
    """Send a request about a file, and receive channels."""
    channels = {}
    try:
        pipe.send_bytes(json.dumps(request).encode())
        while isinstance(message := json.loads(pipe.recv_bytes()), list):
            role, variable, unit, shape = message
            samples = np.frombuffer(pipe.recv_bytes(), "<f8")
            channels[role] = Variable(variable, tuple(shape), samples.__getitem__, {"unit": unit})
    except (OSError, EOFError):
        code = process.wait()
        if code in ENDS:
            raise ResourceError(f"{name}: {ENDS[code]}; try again.") from None
        is_late = code == -signal.SIGPROF
        limit = f"stopped after {request[3]:.0f} s, the limit for its size"
        raise UnreadableError(
            limit if is_late else f"it crashed the process that reads it, status {code}"
        ) from None
    if "refusal" in message:
        raise DataError(message["refusal"])
    if "reason" in message:
        raise UnreadableError(message["reason"])
    for text in message["warnings"]:
        warnings.warn(text, UserWarning, stacklevel=7)  # of the caller of read_trial
    return channels


# --- What runs in the other process


def main() -> None:
    """Answer requests until the pipe is closed."""
    pipe = Connection(int(sys.argv[2]))
    with suppress(EOFError):
        while True:
            pipe.send_bytes(json.dumps(_answer(pipe, json.loads(pipe.recv_bytes()))).encode())


def _answer(pipe: Connection, request: list[Any]) -> dict[str, Any]:
    """Send the channels that a task with a file gives; its end."""
    task, name, case, seconds, memory, wanted = request
    path = Path(name)
    try:
        container = choose_container(path)  # a library is imported without limits
        _limit(seconds, memory)
        if task == "read" and "part" not in wanted:
            has_checksum(path)
        contents = container(path, case)
        if task == "try":
            for variable in filter(None, map(contents.find, contents.names())):
                variable.read(slice(None))
        channels = (
            select_channels(contents, **wanted)
            if task == "read"
            else enumerate(find_variables(contents))
        )
        for role, channel in channels:
            pipe.send_bytes(json.dumps([role, channel.name, channel.unit, channel.shape]).encode())
            pipe.send_bytes(channel.values.tobytes())
        return {"warnings": contents.warnings}
    except DataError as error:
        return {"refusal": str(error)}
    except MemoryError:
        return {"reason": f"it needs more than {memory / 1e9:.1f} GB of memory"}
    except Exception as cause:  # the libraries raise almost anything on a damaged file
        return {"reason": _describe(cause)}
    finally:
        _limit(0.0, memory)


def choose_container(path: Path) -> type[Contents]:
    """Class that opens a file; its module imports the libraries of the format."""
    suffix = str(find_suffix(path))
    if suffix in (".csv", ".csv.gz"):
        from ankleloop.trials.csv_files import CsvContents

        return CsvContents
    from ankleloop.trials.binary_files import (
        ClassicNetcdfContents,
        FlbContents,
        Hdf5Contents,
        MatContents,
    )

    with open(path, "rb") as file:
        start = file.read(512 + len(HDF5_SIGNATURE))
    if start.startswith(HDF5_SIGNATURE) or start.endswith(
        HDF5_SIGNATURE
    ):  # behind the header that MATLAB writes
        return Hdf5Contents
    return {".flb": FlbContents, ".mat": MatContents, ".nc": ClassicNetcdfContents}.get(
        suffix, Hdf5Contents
    )


def _limit(seconds: float, memory: int) -> None:
    """Limit the time [s], where 0 lifts the limit, and the memory to what is in use and so many bytes.

    The limit of the memory is one of the address space, in which mapped files count, too.
    """
    signal.setitimer(signal.ITIMER_PROF, seconds)  # of the processor; their signals end the process
    signal.setitimer(signal.ITIMER_REAL, PATIENCE * seconds)
    with suppress(OSError, ValueError):  # not on Linux, or above a limit of the system
        used = int(Path("/proc/self/statm").read_text().split()[0]) * mmap.PAGESIZE
        resource.setrlimit(
            resource.RLIMIT_AS, (used + memory, resource.getrlimit(resource.RLIMIT_AS)[1])
        )
