"""What HDF5 files are written to: a failure of the disk must not reach the HDF5 library, which it would crash."""

from __future__ import annotations

import io
from pathlib import Path
from types import TracebackType
from typing import Any, Self


class Sink(io.RawIOBase):
    """A new binary file for the HDF5 library, which cannot close a file after a failed write, and then crashes at exit.

    After a failure all else that is written is lost; `check` and the end of the block raise the failure.

    Parameters
    ----------
    path : pathlib.Path
        The file, which must not exist.
    """

    def __init__(self, path: Path) -> None:
        self._file = open(path, "xb+", buffering=0)  # noqa: SIM115
        self._failure: OSError | None = None

    def check(self) -> None:
        """Raise the first failure of the disk, if there was any."""
        if self._failure is not None:
            raise self._failure

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._file.close()
        self.check()  # also instead of an error in the block, which follows from it

    def readable(self) -> bool:
        """Whether the file can be read: HDF5 reads what it has written."""
        return True

    def writable(self) -> bool:
        """Whether the file can be written."""
        return True

    def seekable(self) -> bool:
        """Whether the file has positions."""
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to a position."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Position in the file."""
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        """Read into a buffer, and return the number of bytes."""
        return self._file.readinto(buffer)

    def write(self, data: Any) -> int:
        """Write all bytes, or remember why not."""
        view = memoryview(data).cast("B")
        start, written = self._file.tell(), 0
        try:
            while self._failure is None and written < len(view):
                written += self._file.write(view[written:])
        except OSError as failure:
            self._failure = failure
        if self._failure is not None:
            self._file.seek(start + len(view))
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Cut or extend the file."""
        size = self._file.tell() if size is None else size
        try:
            return self._file.truncate(size)
        except OSError as failure:
            self._failure = self._failure or failure
            return size
