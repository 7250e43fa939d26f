"""The process that opens files for another one: `ankleloop.trials.reading_process` starts it.

A damaged file can crash the libraries of a format, halt them, or make them take all memory. On Linux each file is read
by a fork of this process, whose memory no earlier file has touched; elsewhere by this process itself, which ends after
a file that a library failed on.

Requests come as lines of JSON on the standard input: to read the channels of a recording, to list the variables of a
file, or to write its contents anew. The answer is a sequence of lines of JSON on the standard output: channels, each
with its samples behind it as bytes, and a last line that says how it ended.
"""

from __future__ import annotations

import gc
import importlib
import json
import mmap
import os
import signal
import sys
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any

from ankleloop.errors import DataError
from ankleloop.trials.channel_files import Request, list_variables, read_channels
from ankleloop.trials.checksums import has_right_checksum
from ankleloop.trials.file_formats import open_contents

# Imported before the next fork, which would otherwise import them anew.
LIBRARIES = {
    ".csv": ("pandas",),
    ".csv.gz": ("pandas",),
    ".mat": ("scipy.io", "ankleloop.trials.hdf5_files"),
    ".nc": ("scipy.io", "ankleloop.trials.hdf5_files"),
    ".h5": ("ankleloop.trials.hdf5_files",),
    ".hdf5": ("ankleloop.trials.hdf5_files",),
    "rewriting": ("scipy.io", "ankleloop.trials.rewriting"),
}
FORMATS = tuple(LIBRARIES)

FAILURE, END_OF_INPUT, IMPORT = 1, 2, 10  # statuses of a fork; from IMPORT on: import the libraries of that format
IDLE, SENDING, DONE = 0, 1, 2  # how far an answer is

Message = Mapping[str, Any]
Send = Callable[..., None]


def main(arguments: list[str]) -> None:
    """Answer requests until the standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that waits for the answer ends this one
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not get among the answers
    send = _sender(output)
    send({"kind": "ready"})
    if "fork" in arguments:
        _answer_in_forks(send)
        return
    for line in sys.stdin.buffer:
        request = json.loads(line)
        _import_libraries(request["format"])
        if not _answer(request, send):
            return


def _import_libraries(name: str) -> None:
    for module in LIBRARIES[name]:
        importlib.import_module(module)


def _sender(output: IO[bytes]) -> Send:
    def send(message: Message, samples: Any = b"") -> None:
        output.write(json.dumps(message).encode() + b"\n")
        output.write(memoryview(samples).cast("B"))
        output.flush()

    return send


def _answer(request: Message, send: Send) -> bool:
    """Do what is requested with a file; False if a library failed, whose state is not to be trusted any more."""
    path = Path(request["path"])
    end: dict[str, Any] = {"kind": "end"}
    sound = True
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            _limit_memory(request["memory"])
            if request["format"] == "rewriting":
                _rewrite(path, request)
            else:
                _send_channels(path, request, send)
        except DataError as error:
            end = {"kind": "refused", "text": str(error)}
        except MemoryError:
            end, sound = {"kind": "memory"}, False
        except Exception as cause:  # the libraries raise almost anything on a damaged file
            end, sound = {"kind": "failed", "text": _describe(cause)}, False
        finally:
            _limit_memory(None)
    # Warnings of libraries are not for the reader of a trial; those here begin with the name of the file.
    texts = [str(w.message) for w in caught if w.category is UserWarning and str(w.message).startswith(path.name)]
    send({**end, "warnings": texts})
    return sound


def _send_channels(path: Path, request: Message, send: Send) -> None:
    part = request["part"]
    wanted = Request(
        variables=request["variables"],
        extras=tuple(request["extras"]),
        rate=request["rate"],
        part=None if part is None else slice(*part),
        with_samples=request["with_samples"],
        roles=None if request["roles"] is None else tuple(request["roles"]),
    )
    if part is None and request["with_samples"] and has_right_checksum(path) is False:
        raise DataError(
            f"{path.name}: bytes have changed since the file was written (its checksum is wrong): restore it from a "
            "copy."
        )
    contents = open_contents(path)
    for role, channel in list_variables(contents) if request["listing"] else read_channels(contents, wanted):
        message = {"kind": "channel", "role": role, "name": channel.name, "unit": channel.unit, "shape": channel.shape}
        if channel.values is None:
            send({**message, "bytes": None})
        else:
            send({**message, "bytes": channel.values.nbytes}, channel.values.ravel())
    contents.close()


def _rewrite(path: Path, request: Message) -> None:
    from ankleloop.trials.rewriting import rewrite  # here, because recordings do not need it

    rewrite(path, Path(request["copy"]))


def _describe(cause: Exception) -> str:
    text = f"{type(cause).__name__}: {cause}".partition("\n")[0]
    return text if len(text) <= 300 else f"{text[:297]}..."


def _limit_memory(allowance: int | None) -> None:
    """Limit the memory to what is in use and an allowance [bytes], where the system can; None lifts the limit.

    The limit is that of the address space, in which mapped files count, too.
    """
    try:
        import resource

        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        used = int(Path("/proc/self/statm").read_text().split()[0]) * mmap.PAGESIZE
        soft = resource.RLIM_INFINITY if allowance is None else used + allowance
        resource.setrlimit(resource.RLIMIT_AS, (soft if hard < 0 else min(soft, hard), hard))
    except (ImportError, OSError, ValueError):
        return


def _answer_in_forks(send: Send) -> None:
    """Let a fork answer each request; if one dies, say so. It is made ahead, so that no request waits for it."""
    while True:
        gc.freeze()  # the collector would write to memory that the forks share
        sending = mmap.mmap(-1, 1)  # shared: how far the answer of the fork is
        process = os.fork()
        if process == 0:
            status = FAILURE
            try:
                status = _answer_as_fork(send, sending)
            finally:
                os._exit(status)
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        if code == END_OF_INPUT:
            return
        if sending[0] == SENDING or (code >= 0 and sending[0] != DONE):
            sys.exit(1)  # the answer is cut off: its reader has to notice
        if code >= IMPORT:
            _import_libraries(FORMATS[code - IMPORT])
        elif code < 0 and sending[0] != DONE:
            send({"kind": "slow"} if code == -signal.SIGALRM else {"kind": "died", "code": code})


def _answer_as_fork(send: Send, sending: mmap.mmap) -> int:
    """Answer one request; the status tells what the next fork lacks."""
    line = sys.stdin.buffer.readline()
    if not line:
        return END_OF_INPUT
    request = json.loads(line)
    name = request["format"]
    is_ready = all(module in sys.modules for module in LIBRARIES[name])
    _import_libraries(name)
    # Its own clock ends a fork that outlives the process that asked.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, request["seconds"])

    def send_all(message: Message, samples: Any = b"") -> None:
        sending[0] = SENDING
        send(message, samples)
        sending[0] = IDLE if message["kind"] == "channel" else DONE

    _answer(request, send_all)
    return 0 if is_ready else IMPORT + FORMATS.index(name)


if __name__ == "__main__":
    main(sys.argv[1:])
