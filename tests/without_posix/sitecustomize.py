"""What Windows lacks is hidden from the programs of Python that have this folder in PYTHONPATH.

    PYTHONPATH=tests/without_posix python -m pytest tests/unit -m "not posix"

The standard library itself goes on as it is: it has imported what it needs.
"""

import os
import signal
import sys
from types import ModuleType

MODULES = ("fcntl", "grp", "posix", "pwd", "resource", "termios")
FUNCTIONS = ("fork", "geteuid", "getuid", "mkfifo", "register_at_fork", "setsid", "WIFSIGNALED")
SIGNALS = {"SIGABRT", "SIGFPE", "SIGILL", "SIGINT", "SIGSEGV", "SIGTERM"}
POSIX = ("ITIMER_", "SIG", "alarm", "getitimer", "pause", "pthread_", "setitimer", "sig")

send_signal = os.kill


def kill(process, number):
    """Send a signal, unless it would press Ctrl-C there."""
    assert number != 0, "os.kill presses Ctrl-C on Windows"
    send_signal(process, number)


os.kill = kill
for name in FUNCTIONS:
    delattr(os, name)
sys.modules |= dict.fromkeys(MODULES)
windows_signal = ModuleType("signal")
for name, value in vars(signal).items():
    if name in SIGNALS | {"SIG_DFL", "SIG_IGN", "signal"} or not name.startswith(POSIX):
        setattr(windows_signal, name, value)
windows_signal.CTRL_C_EVENT = 0
windows_signal.SIGBREAK = signal.SIGHUP
sys.modules["signal"] = windows_signal
