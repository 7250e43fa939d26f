"""Files of this library that are read again: what is damaged in them reaches no library that it could kill or halt."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ankleloop.errors import DataError, ResourceError
from ankleloop.trials.files import check_readable, has_right_checksum

PathLike = str | os.PathLike[str]


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
        from ankleloop.trials.reading_process import copy_file  # here: files with a checksum do not need it

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
