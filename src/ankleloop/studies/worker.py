"""A child process for work that may be killed, by the system for its memory or by a library that crashes."""

from __future__ import annotations

import logging
import multiprocessing
import pickle
import signal
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Self

log = logging.getLogger(__name__)


class WorkerKilledError(Exception):
    """The process of a worker has ended before its call did; the message says how."""


class Worker:
    """Runs a function call after call in one child process, and in a new one where that was killed.

    Other systems than Linux cannot fork a process safely: there the function runs in the calling process.

    Parameters
    ----------
    function : callable
        The function; its arguments and results are pickled.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._process: Any = None
        self._pipe: Connection | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if kind is not None and self._pipe is not None:  # as after SIGTERM: what it does is of no use any more
            self._process.kill()
        self._end()

    def call(self, *args: Any) -> Any:
        """Call the function."""
        if sys.platform != "linux":
            return self._function(*args)
        pipe = self._pipe or self._start()
        try:
            pipe.send(args)
            succeeded, value = pipe.recv()
        except (EOFError, ConnectionError):
            raise WorkerKilledError(self._end()) from None
        if succeeded:
            return value
        raise value

    def _start(self) -> Connection:
        context = multiprocessing.get_context("fork")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(self._function, other, self._pipe), daemon=True)
        self._process.start()
        other.close()
        return self._pipe

    def _end(self) -> str:
        """Wait for the end of the process, and say how it ended."""
        if self._pipe is None:
            return ""
        self._pipe.close()
        self._process.join()
        code, self._pipe = self._process.exitcode, None
        return f"it was killed by {signal.Signals(-code).name}" if code < 0 else f"it ended with code {code}"


def _serve(function: Callable[..., Any], pipe: Connection, other: Connection) -> None:
    """Answer calls until the other end of the pipe is closed."""
    other.close()
    while True:
        try:
            args = pipe.recv()
        except EOFError:
            return
        try:
            answer = True, function(*args)
        except Exception as error:
            log.exception("failed")
            answer = False, _portable(error)
        pipe.send(answer)


def _portable(error: Exception) -> Exception:
    """An error that can be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
