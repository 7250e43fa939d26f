"""Checksum at the end of a file: whatever has changed since it was written is noticed before a library opens it.

HDF5 does not read what stands behind its content, and removes it when a program changes the file: such a file has no
checksum any more, and no wrong one.
"""

from __future__ import annotations

import hashlib
import os
from typing import BinaryIO

MARK = b"\nankleloop: SHA-256 of all before this line: "
LENGTH = len(MARK) + 2 * hashlib.sha256().digest_size + 1
PIECE = 1 << 20


def append_checksum(path: str | os.PathLike[str]) -> None:
    """Append the checksum of its content to a file."""
    with open(path, "rb+") as file:
        line = _compute_line(file, os.fstat(file.fileno()).st_size)
        file.write(line)


def has_right_checksum(path: str | os.PathLike[str]) -> bool | None:
    """Whether the content of a file is the one that was written; None for a file without a checksum."""
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size - LENGTH
        if size < 0:
            return None
        file.seek(size)
        line = file.read(LENGTH)
        if not line.startswith(MARK):
            return None
        file.seek(0)
        return line == _compute_line(file, size)


def _compute_line(file: BinaryIO, size: int) -> bytes:
    """Line with the checksum of the first bytes of a file, which is read as far as these bytes."""
    checksum = hashlib.sha256()
    while size > 0 and (piece := file.read(min(size, PIECE))):
        checksum.update(piece)
        size -= len(piece)
    return MARK + checksum.hexdigest().encode() + b"\n"
