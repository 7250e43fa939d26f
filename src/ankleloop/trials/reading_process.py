"""Files that may be damaged are opened by another process, with limits of time and memory: `trials.reading_server`.

A file that is damaged in a way that kills or halts the library of its format gives a `DataError`, and nothing else
happens. The other process is started for the first file, and serves those that follow, as long as no library fails.
"""

from __future__ import annotations

import atexit
import io
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

import numpy as np

from ankleloop.errors import DataError, ResourceError
from ankleloop.trials.channel_files import Request
from ankleloop.trials.channels import Channel
from ankleloop.trials.file_formats import SUFFIXES, find_suffix
from ankleloop.trials.files import check_readable, has_right_checksum
from ankleloop.trials.reading_options import ReadingOptions

SECONDS, SECONDS_PER_MEGABYTE = 10.0, 1.0  # of the processor for a file
BYTES, BYTES_PER_BYTE = 1 << 30, 4  # of memory for a file
START_SECONDS = 120.0  # until the process is ready, on a machine that is busy or has a slow disk
PATIENCE = 10.0  # times as long a busy machine or a slow disk may take
LONGEST_MESSAGE = 1 << 20
LIBRARY = Path(__file__).parents[2]
PROGRAM = "import sys; sys.path.insert(0, sys.argv[1]); from ankleloop.trials.reading_server import main; main()"

PathLike = str | os.PathLike[str]
Describe = Callable[[str], str]  # gives the message about a file that cannot be read, for a reason


def list_variables(path: PathLike) -> list[Channel]:
    """List the variables of a file of any size: full names, units and shapes."""
    return list(read_channels(path, ReadingOptions(), task="listing").values())


def copy_file(path: Path, describe: Describe) -> bytes:
    """Have the contents of a NetCDF-4 file or MATLAB file written anew, so that this process can open the copy."""
    copy = _server().ask(Request(str(path.absolute()), *_limits(path), task="copy"), describe)["copy"].values
    assert copy is not None
    return copy.tobytes()


@contextmanager
def readable_file(path: PathLike, kind: str, remedy: str) -> Iterator[Path | io.BytesIO]:
    """Provide what can be opened in this process in place of a file of this library.

    It is the file itself if its checksum is right. The contents of a file without a checksum (of an older version, or
    changed by another program) are written anew by another process, with limits of time and memory
    (`trials.reading_process`), into memory.
    """
    check_readable(path)
    path = Path(path)
    with name_errors(path, kind, remedy):
        is_right = has_right_checksum(path)
        if is_right is False:
            reason = "its checksum is wrong: bytes have changed since it was written"
            raise DataError(describe_damage(path, kind, remedy, reason))
        if is_right:
            yield path
            return
        yield io.BytesIO(copy_file(path, lambda reason: describe_damage(path, kind, remedy, reason)))


@contextmanager
def name_errors(path: PathLike, kind: str, remedy: str) -> Iterator[None]:
    """Say in plain words what is wrong with the contents of a file."""
    try:
        yield
    except (DataError, ResourceError, MemoryError):  # a lack of memory says nothing about the file
        raise
    except Exception as cause:
        reason = f"{type(cause).__name__}: {cause}".partition("\n")[0]
        raise DataError(describe_damage(path, kind, remedy, reason)) from cause


def describe_damage(path: PathLike, kind: str, remedy: str, reason: str) -> str:
    """Message about a file that cannot be read."""
    return f"{path}: not a readable {kind} ({reason}): it is damaged, or of another origin: {remedy}."


def _limits(path: Path) -> tuple[float, float]:
    """Limits of time [s] and memory [bytes] for a file."""
    size = path.stat().st_size
    return SECONDS + SECONDS_PER_MEGABYTE * size / 1e6, BYTES + BYTES_PER_BYTE * size


def read_channels(path: PathLike, options: ReadingOptions, **wanted: Any) -> dict[str, Channel]:
    """Read the channels of a trial from a file, with its times and its sampling rate, or what `Request` has of them."""
    path = Path(path)
    check_readable(path)
    suffix = find_suffix(path)
    if suffix is None:
        raise DataError(f"{path.name}: unknown kind of file: convert it to one of {', '.join(SUFFIXES)}.")

    def describe(reason: str) -> str:
        return f"{path.name}: cannot be read as {suffix} ({reason}): check that the file is whole and its suffix right."

    if path.stat().st_size == 0:
        raise DataError(describe("it is empty, 0 bytes"))
    variables = {**options.channels, **options.further}
    request = Request(str(path.absolute()), *_limits(path), variables=variables, rate=options.sampling_rate, **wanted)
    return _server().ask(request, describe)


class _Server:
    """The process that opens files; it answers one request after the other."""

    def __init__(self) -> None:
        self.owner = os.getpid()
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, request: Request, describe: Describe) -> dict[str, Channel]:
        """Send a request; receive the channels."""
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                self._start()
            try:
                channels, end = self._exchange(request)
            except BaseException:  # the answer may be half read, after Ctrl-C for example
                self.stop()
                raise
            if end["kind"] not in ("end", "refused"):
                self.stop()
        _raise_error(end, request, describe)
        for text in end["warnings"]:
            warnings.warn(text, UserWarning, stacklevel=5)  # of the caller of read_trial
        return channels

    def stop(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            with suppress(OSError):  # what was not sent is lost with the process
                process.communicate()

    def _start(self) -> None:
        self.stop()
        # -P: files of the current folder that have the name of a module are not imported.
        command = [sys.executable, "-P", "-c", PROGRAM, str(LIBRARY)]
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env={**os.environ, **threads}, start_new_session=True, pipesize=1 << 20,
        )  # fmt: skip
        with _deadline(self._process, START_SECONDS):
            assert self._process.stdout is not None
            line = self._process.stdout.readline(LONGEST_MESSAGE)
        if json.loads(line or b"{}").get("kind") != "ready":
            self.stop()
            raise RuntimeError(
                f"the process that reads files did not start: {' '.join(command[:4])} ... failed. Run this program by "
                "the Python of its environment."
            )

    def _exchange(self, request: Request) -> tuple[dict[str, Channel], dict[str, Any]]:
        """The channels, and how the answer ended."""
        process = self._process
        assert process is not None and process.stdin is not None and process.stdout is not None  # noqa: PT018
        channels: dict[str, Channel] = {}
        start = time.monotonic()
        with _deadline(process, START_SECONDS + PATIENCE * request.seconds) as is_late:
            try:
                process.stdin.write(json.dumps(asdict(request)).encode() + b"\n")
                process.stdin.flush()
                return channels, _receive(process.stdout, channels, request)
            except (OSError, EOFError, ValueError, KeyError, TypeError):  # no whole answer
                code = None
                with suppress(subprocess.TimeoutExpired):
                    code = process.wait(1.0)
                end = {"kind": "late" if is_late.is_set() else "died", "signal": _name_signal(code)}
                return channels, {**end, "seconds": time.monotonic() - start}


def _receive(pipe: IO[bytes], channels: dict[str, Channel], request: Request) -> dict[str, Any]:
    """Receive channels until the last message, which is returned."""
    while True:
        line = pipe.readline(LONGEST_MESSAGE)
        if not line.endswith(b"\n"):
            raise EOFError
        message: dict[str, Any] = json.loads(line)
        if message["kind"] != "channel":
            return message
        shape = tuple(int(size) for size in message["shape"])
        values = None
        if message["type"] is not None:
            kind = np.dtype({"<f8": "<f8", "|u1": "|u1"}[message["type"]])
            if kind.itemsize * math.prod(shape) > request.memory:
                raise EOFError
            values = np.empty(shape, kind)
            if pipe.readinto(values.reshape(-1).view(np.uint8)) != values.nbytes:  # type: ignore[attr-defined]
                raise EOFError
        channels[message["role"]] = Channel(message["name"], message["unit"], shape, values)


def _raise_error(end: dict[str, Any], request: Request, describe: Describe) -> None:
    """Raise the error that the last message stands for."""
    kind, hint, name = end["kind"], "", Path(request.path).name
    ended, seconds = end.get("signal", ""), f"{end.get('seconds', 0.0):.0f} s"
    if kind == "end":
        return
    if kind == "refused":
        raise DataError(end["text"])
    if kind == "limited":
        raise ResourceError(f"{name}: this program is allowed too little memory to read the file (ulimit -v).")
    if kind == "late":
        raise ResourceError(
            f"{name}: the file was not read within {seconds}: the computer is busy, or the disk slow; try again later."
        )
    if ended in ("SIGKILL", "SIGTERM"):
        raise ResourceError(
            f"{name}: the process that reads the file was killed ({ended}), most often because memory was short: free "
            "memory, and try again."
        )
    if kind == "failed":
        reason = end["text"]
    elif kind == "memory":
        reason = f"it needs more than {request.memory / 1e9:.1f} GB of memory"
        hint = "; a long record is read from HDF5 or NetCDF with ankleloop.LongRecord" * (request.task != "copy")
    elif ended == "SIGPROF":
        reason = f"stopped after {seconds}, {request.seconds:.0f} s is the limit for its size"
    else:
        reason = f"it crashed the process that reads it{ended and f', {ended}'}"
    raise DataError(f"{describe(reason).rstrip('.')}{hint}.")


def _name_signal(code: int | None) -> str:
    """Name of the signal that a process ended by, or the empty string."""
    if code is None or code >= 0:
        return ""
    return {item.value: item.name for item in signal.Signals}.get(-code, f"signal {-code}")


@contextmanager
def _deadline(process: subprocess.Popen[bytes], seconds: float) -> Iterator[threading.Event]:
    """Kill a process that is not done in time, which ends the wait for its answer; the event is set then."""
    timer = threading.Timer(min(seconds, threading.TIMEOUT_MAX), process.kill)
    timer.daemon = True
    timer.start()
    try:
        yield timer.finished
    finally:
        timer.cancel()


_current: _Server | None = None


def _server() -> _Server:
    """The server of this process: a fork of the process that started it takes one of its own."""
    global _current
    if _current is None or _current.owner != os.getpid():
        _current = _Server()
        atexit.register(_current.stop)
    return _current


def stop() -> None:
    """End the process that reads files; the next file starts it again."""
    if _current is not None and _current.owner == os.getpid():
        _current.stop()
