"""Files that may be damaged are opened by another process, with limits of time and memory: `records.reading_server`.

A file that is damaged in a way that kills or halts the library of its format gives a `DataError`, and nothing else
happens. The other process is started for the first file, and serves all that follow.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.channels import MAX_SAMPLES, Channel
from ankleloop.trials.file_formats import SUFFIXES, find_suffix
from ankleloop.trials.files import check_readable
from ankleloop.trials.reading_options import ReadingOptions

START_SECONDS = 120.0  # until the process is ready, on a machine that is busy or has a slow disk
SECONDS, SECONDS_PER_MEGABYTE = 10.0, 1.0  # for a file
BYTES, BYTES_PER_BYTE = 1 << 30, 4  # of memory for a file
LONGEST_MESSAGE = 1 << 20
LIBRARY = Path(__file__).parents[2]
PROGRAM = (
    "import sys; sys.path.insert(0, sys.argv[1]); from ankleloop.trials.reading_server import main; main(sys.argv[2:])"
)
WHOLE = "check that the file is whole and its suffix right"
LONG = "a long record is read from HDF5 or NetCDF with ankleloop.LongRecord"

Describe = Callable[[str], str]  # gives the message about a file that cannot be read, for a reason


def read_channels(
    path: str | os.PathLike[str], options: ReadingOptions, extras: Sequence[str] = ()
) -> dict[str, Channel]:
    """Read the channels of a trial from a file, with its times and its sampling rate."""
    return _request(path, options, extras=list(extras))


def describe_channels(
    path: str | os.PathLike[str], options: ReadingOptions, extras: Sequence[str] = ()
) -> dict[str, Channel]:
    """Describe the channels of a trial in a file of any size: names, units and shapes, and the sampling rate."""
    return _request(path, options, extras=list(extras), with_samples=False)


def list_variables(path: str | os.PathLike[str]) -> list[Channel]:
    r"""List the variables of a file of any size: full names, units and shapes."""
    nothing = ReadingOptions()  # no variable of the file is read
    return list(_request(path, nothing, with_samples=False, listing=True).values())


def read_samples(
    path: str | os.PathLike[str], options: ReadingOptions, start: int, stop: int, channels: Sequence[str] | None = None
) -> dict[str, Channel]:
    """Read a piece of a long record, for HDF5 and NetCDF in a time that does not depend on its length."""
    return _request(path, options, part=[int(start), int(stop)], roles=None if channels is None else list(channels))


def rewrite_file(path: Path, copy: Path, describe: Describe) -> None:
    """Have the contents of a NetCDF-4 file or MATLAB file written anew, so that this process can open the copy."""
    message = {"path": str(path.absolute()), "copy": str(copy), "format": "rewriting", **_limits(path.stat().st_size)}
    _server().ask(message, describe)


def _limits(size: int) -> dict[str, float]:
    """Limits of time [s] and memory [bytes] for a file of a size [bytes]."""
    return {"seconds": SECONDS + SECONDS_PER_MEGABYTE * size / 1e6, "memory": BYTES + BYTES_PER_BYTE * size}


def _check_file(path: Path) -> int:
    """Size of a file [bytes], which must be there, readable, and not empty."""
    check_readable(path)
    if find_suffix(path) is None:
        raise DataError(f"{path.name}: unknown kind of file: convert it to one of {', '.join(SUFFIXES)}.")
    size = path.stat().st_size
    if size == 0:
        raise DataError(_describe(path, "it is empty, 0 bytes"))
    return size


def _describe(path: Path, reason: str) -> str:
    return f"{path.name}: cannot be read as {find_suffix(path)} ({reason}): {WHOLE}."


def _request(path: str | os.PathLike[str], options: ReadingOptions, **changes: Any) -> dict[str, Channel]:
    path = Path(path)
    size = _check_file(path)
    message = {
        "path": str(path.absolute()),
        "format": find_suffix(path),
        "variables": {**options.channels, **options.further},
        "extras": [],
        "rate": options.sampling_rate,
        "part": None,
        "with_samples": True,
        "roles": None,
        "listing": False,
        **_limits(size),
        **changes,
    }
    return _server().ask(message, lambda reason: _describe(path, reason))


class _Server:
    """The process that opens files; it answers one request after the other."""

    def __init__(self, *, is_forking: bool | None = None) -> None:
        self.owner = os.getpid()
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._formats: set[str] = set()  # whose libraries it has
        # Forks are safe where no system library has started threads of its own, as those of macOS do.
        self._arguments = ["fork"] if (sys.platform == "linux" if is_forking is None else is_forking) else []

    def ask(self, message: dict[str, Any], describe: Describe) -> dict[str, Channel]:
        """Send a request; receive the channels."""
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                self._start()
            try:
                return self._ask(message, describe)
            except DataError:
                raise
            except BaseException:  # the answer may be half read, after Ctrl-C for example
                self.stop()
                raise

    def _end(self) -> int | None:
        """End the process; its status, if it had ended before."""
        process, code = self._process, None
        if process is not None:
            with suppress(subprocess.TimeoutExpired):
                code = process.wait(1.0)
        self.stop()
        return code

    def stop(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is None:
            return
        _kill(process)
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(OSError):  # what was not sent is lost with the process
                    pipe.close()

    def _start(self) -> None:
        self.stop()
        self._formats.clear()
        # -P: files of the current folder that have the name of a module are not imported.
        command = [sys.executable, "-P", "-c", PROGRAM, str(LIBRARY), *self._arguments]
        variables = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **variables},
            start_new_session=True,
            pipesize=1 << 20,
        )
        with _Deadline(self._process, START_SECONDS):
            line = _pipe(self._process.stdout).readline(LONGEST_MESSAGE)
        if json.loads(line or b"{}").get("kind") != "ready":
            self.stop()
            raise RuntimeError(
                f"the process that reads files did not start: {' '.join(command[:4])} ... failed. Run this program by "
                "the Python of its environment."
            )

    def _ask(self, message: dict[str, Any], describe: Describe) -> dict[str, Channel]:
        process, limit = self._process, message["seconds"]
        assert process is not None
        start = time.monotonic()
        channels: dict[str, Channel] = {}
        # A fork ends itself by then; the first file of a format waits for its libraries.
        extra = (5.0 if self._arguments else 0.0) + (0.0 if message["format"] in self._formats else START_SECONDS)
        with _Deadline(process, limit + extra) as deadline:
            try:
                _pipe(process.stdin).write(json.dumps(message).encode() + b"\n")
                _pipe(process.stdin).flush()
                end = _receive(_pipe(process.stdout), channels)
                self._formats.add(message["format"])
            except (OSError, EOFError, ValueError, KeyError):  # no whole answer
                end = {"kind": "slow" if deadline.is_over else "died", "code": self._end()}
        if not self._arguments and end["kind"] in ("failed", "memory"):
            self.stop()  # it ends by itself, but perhaps after the next request
        _refuse(end, message, describe, time.monotonic() - start)
        for text in end.get("warnings", ()):
            warnings.warn(text, UserWarning, stacklevel=6)  # of the caller of read_trial
        return channels


def _receive(pipe: IO[bytes], channels: dict[str, Channel]) -> dict[str, Any]:
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
        if message["bytes"] is not None:
            values = np.empty(message["bytes"] // 8, dtype="<f8")
            if values.size > MAX_SAMPLES or pipe.readinto(values.view(np.uint8)) != message["bytes"]:  # type: ignore[attr-defined]
                raise EOFError
            values = values.reshape(shape)
        channels[message["role"]] = Channel(message["name"], message["unit"], shape, values)


def _refuse(end: dict[str, Any], request: dict[str, Any], describe: Describe, seconds: float) -> None:
    """Raise the error that an answer stands for."""
    kind = end["kind"]
    if kind == "refused":
        raise DataError(end["text"])
    if kind == "failed":
        raise DataError(describe(end["text"]))
    if kind == "memory":
        hint = "" if request["format"] == "rewriting" else f"; {LONG}"
        raise DataError(
            describe(f"it needs more than {request['memory'] / 1e9:.1f} GB of memory").rstrip(".") + f"{hint}."
        )
    if kind == "slow":
        limit = request["seconds"]
        raise DataError(describe(f"stopped after {seconds:.0f} s, {limit:.0f} s is the limit for its size"))
    if kind == "died":
        raise DataError(describe(f"it crashed the process that reads it{_name_signal(end.get('code'))}"))


def _name_signal(code: int | None) -> str:
    if code is None or code >= 0:
        return ""
    try:
        return f", {signal.Signals(-code).name}"
    except ValueError:
        return f", signal {-code}"


class _Deadline:
    """Kills a process that is not done in time, which ends the wait for its answer."""

    def __init__(self, process: subprocess.Popen[bytes], seconds: float) -> None:
        self.is_over = False
        self._process = process
        self._timer = threading.Timer(min(seconds, threading.TIMEOUT_MAX), self._end)
        self._timer.daemon = True

    def _end(self) -> None:
        self.is_over = True
        _kill(self._process)

    def __enter__(self) -> _Deadline:
        self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process with its forks."""
    if process.poll() is not None:
        return
    try:
        os.killpg(process.pid, signal.SIGKILL)  # it leads a group of its own
    except (AttributeError, OSError):
        process.kill()


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None
    return pipe


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
