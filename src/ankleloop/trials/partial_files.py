"""Names of files that are being written, and removal of those whose writer was killed."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import time
import uuid
from contextlib import suppress
from functools import cache
from pathlib import Path

NAME_BYTES = 200  # of the name of the file in the name of its partial file; file systems allow 255 in all
ABANDONED = 7 * 86400.0  # s without writing, after which a partial file of another computer has no writer

PATTERN = re.compile(r"([0-9a-f]{8})-([0-9a-f]{8})-(\d+)-[0-9a-f]{8}\.part")


def partial_path(path: Path) -> Path:
    """Hidden name beside a file under which it is written: it states the computer, its start and the process."""
    return path.with_name(f"{_prefix(path)}{'-'.join(_computer())}-{os.getpid()}-{uuid.uuid4().hex[:8]}.part")


def remove_stale(path: Path) -> None:
    """Remove the partial files of a file whose process no longer lives.

    A partial file of this computer is stale if the computer has started anew since, or if its process has ended; one of
    another computer, whose processes cannot be seen from here, after a week in which nothing was written to it.
    """
    prefix = _prefix(path)
    with suppress(OSError):  # the writer reports a folder that cannot be used
        for name in os.listdir(path.parent):
            match = PATTERN.fullmatch(name[len(prefix) :]) if name.startswith(prefix) else None
            partial = path.with_name(name)
            with suppress(OSError):  # another writer removes it at the same time
                if match and _is_stale(partial, match[1], match[2], int(match[3])):
                    partial.unlink()


def _prefix(path: Path) -> str:
    return f".{os.fsencode(path.name)[:NAME_BYTES].decode(errors='ignore')}."


def _is_stale(partial: Path, host: str, start: str, process: int) -> bool:
    here, this_start = _computer()
    if host != here or os.name != "posix":  # elsewhere than on POSIX, signal 0 ends the process
        return time.time() - partial.stat().st_mtime > ABANDONED
    return start != this_start or not _lives(process)


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # it is another user's
        return True
    return True


@cache
def _computer() -> tuple[str, str]:
    """Digests of the computer with its space of process numbers (of a container), and of its start."""
    start, processes = "", ""
    with suppress(OSError):  # Linux only
        processes = os.readlink("/proc/self/ns/pid")
        start = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii")
    host, start = (hashlib.sha256(t.encode()).hexdigest()[:8] for t in (f"{platform.node()} {processes}", start))
    return host, start
