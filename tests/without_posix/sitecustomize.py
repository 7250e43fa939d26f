"""What Windows lacks is hidden from the programs of Python that have this folder in PYTHONPATH.

PYTHONPATH=tests/without_posix python -m pytest tests/unit/lab/files -m "not posix"

The standard library has imported before what it needs. A file that is open cannot be replaced or removed.
"""

import asyncio  # noqa: F401
import concurrent.futures.process as _  # noqa: F401
import multiprocessing.pool  # noqa: F401
import os
import signal
import sys
from contextlib import suppress
from types import ModuleType

with suppress(ImportError):  # the tests have it; another part of it is for Windows
    import psutil  # noqa: F401

MODULES = ("fcntl", "posix", "resource")
FUNCTIONS = ("fork", "mkfifo", "register_at_fork")
SIGNALS = ("SIGINT", "SIGTERM", "SIG_DFL", "SIG_IGN", "default_int_handler", "getsignal", "signal")


def send_signal(process, number, kill=os.kill):
    """Send a signal, but not the one that presses Ctrl-C on Windows."""
    assert number != 0, "os.kill presses Ctrl-C on Windows"
    kill(process, number)


def refuse_open(change):
    """The function that changes names of files, which refuses those that this process has open."""

    def change_closed(*paths, **options):
        for descriptor in os.listdir("/proc/self/fd"):
            with suppress(FileNotFoundError):  # of the list itself
                opened = os.readlink(f"/proc/self/fd/{descriptor}")
                if opened in map(os.path.realpath, paths):
                    raise PermissionError(13, "The process cannot access the file", opened)
        return change(*paths, **options)

    return change_closed


os.kill = send_signal
if os.path.exists("/proc/self/fd"):
    os.replace = refuse_open(os.replace)
    os.unlink = refuse_open(os.unlink)
for function in FUNCTIONS:
    delattr(os, function)
for module in MODULES:
    sys.modules[module] = None
windows_signal = ModuleType("signal")
windows_signal.CTRL_C_EVENT = 0
for name in SIGNALS:
    setattr(windows_signal, name, getattr(signal, name))
sys.modules["signal"] = windows_signal
