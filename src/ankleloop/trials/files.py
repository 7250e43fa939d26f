"""Files that appear under their name only when they are complete, and never replace another one unasked.

NetCDF files end with a checksum: whatever has changed since one was written is noticed before a library opens it. HDF5
does not read what stands behind its content, and removes it when a program changes the file: such a file has no
checksum any more, and no wrong one.
"""

from __future__ import annotations

import errno
import glob
import hashlib
import io
import os
import platform
import signal
import stat
import threading
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ankleloop.errors import DataError, ResourceError

if TYPE_CHECKING:
    import h5netcdf
    import pandas as pd
    import xarray as xr

PathLike = str | os.PathLike[str]

FULL_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
# Characters of a file and of a computer in the name of a partial file; file systems allow 255 bytes in all.
FILE_CHARACTERS, NODE_CHARACTERS = 40, 30
CHECKSUM_MARK = b"\nankleloop: SHA-256 of all before this line: "
CHECKSUM_LENGTH = len(CHECKSUM_MARK) + 2 * hashlib.sha256().digest_size + 1
PIECE = 1 << 20  # bytes
_lock = threading.Lock()


class UnreadableError(Exception):
    """What is wrong with the contents of a file, for a message that names it."""


def describe_cause(cause: Exception) -> str:
    """What an error says, in one line, with its type unless it is one of ours."""
    text = str(cause) if isinstance(cause, UnreadableError) else f"{type(cause).__name__}: {cause}"
    return text.partition("\n")[0][:300]


def check_output(path: PathLike, *, overwrite: bool = False) -> Path:
    """Check that a file can be written and that nothing is lost by it; long computations do so before they begin."""
    path = Path(path)
    try:
        if not path.parent.is_dir():
            raise DataError(f"{path}: there is no folder {path.parent}: make it first.")
        if not os.access(path.parent, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if path.exists() and not path.is_file():
            raise DataError(f"{path}: this is a folder or a device, no file: write to a file.")
        # Nothing is lost of an empty file.
        if not overwrite and os.path.lexists(path) and path.lstat().st_size > 0:
            raise DataError(
                f"{path}: the file exists already: write to another name, or replace it by overwrite=True.",
                remedy={"overwrite": True},
            )
    except OSError as cause:
        raise _write_error(path, cause) from cause
    return path


def _write_error(path: Path, cause: OSError) -> DataError | ResourceError:
    """The error that says why a file cannot be written."""
    fault = f"{path}: the file cannot be written ({cause.strerror or cause})"
    if cause.errno in FULL_DISK:
        return ResourceError(
            f"{fault}: free space in the folder {path.parent}. Nothing has been changed."
        )
    return DataError(
        f"{fault}: check its name, that you may write to the folder {path.parent}, and that no other program has the "
        "file open. Nothing has been changed."
    )


def _partial_path(path: Path) -> Path:
    """Hidden name beside a file under which this process writes it; removes what killed processes have left there."""
    start = f".{path.name[:FILE_CHARACTERS]}.{platform.node()[:NODE_CHARACTERS]}-"
    for partial in path.parent.glob(f"{glob.escape(start)}*.part"):
        if hasattr(signal, "CTRL_C_EVENT"):  # which os.kill would send: on Windows they stay
            break
        with suppress(PermissionError):  # the process of another user lives
            process = int(partial.name.removeprefix(start).partition("-")[0])
            try:
                os.kill(process, 0)
            except ProcessLookupError:
                partial.unlink(missing_ok=True)
    return path.with_name(f"{start}{os.getpid()}-{uuid.uuid4().hex[:8]}.part")


@contextmanager
def atomic_file(path: PathLike, *, overwrite: bool = False) -> Iterator[Path]:
    """Provide a temporary path, and move the file to its name if the block ends without an error.

    Of two writers of the same file both write a whole one: the later one replaces the file of the earlier one, or is
    refused without `overwrite`. If a process is killed, its partial file stays until the file is written again.
    """
    path = check_output(path, overwrite=overwrite)
    partial = _partial_path(path)
    try:
        yield partial
        with open(partial, "rb+") as file:
            # A power cut must not leave the name without the content.
            os.fsync(file.fileno())
        with _lock:  # of two threads the later one sees the file of the earlier one
            check_output(path, overwrite=overwrite)  # others may have written it meanwhile
            os.replace(partial, path)
    except OSError as cause:
        is_of_another_file = (
            cause.filename is not None and Path(os.fsdecode(cause.filename)) != partial
        )
        if is_of_another_file:
            raise
        raise _write_error(path, cause) from cause
    finally:
        partial.unlink(missing_ok=True)


class _Sink(io.FileIO):
    """A new binary file for the HDF5 library, which cannot close a file after a failed write, and then crashes at exit.

    After a failure all else that is written is lost; the end of the block raises the failure.
    """

    failure: OSError | None = None

    def __exit__(self, *_: object) -> None:
        self.close()
        if self.failure is not None:  # also instead of an error in the block, which follows from it
            raise self.failure

    def write(self, data: Any) -> int:
        """Write all bytes, or remember why not."""
        view = memoryview(data).cast("B")
        end = self.tell() + len(view)
        written = 0
        try:
            while self.failure is None and written < len(view):
                written += super().write(view[written:])
        except OSError as failure:
            self.failure = failure
        self.seek(end)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Cut or extend the file."""
        try:
            return super().truncate(size)
        except OSError as failure:
            self.failure = self.failure or failure
            return size or 0


@contextmanager
def _netcdf_sink(path: PathLike, overwrite: bool) -> Iterator[_Sink]:
    """A file for the HDF5 library, which gets its checksum, and then its name."""
    with atomic_file(path, overwrite=overwrite) as partial:
        with _Sink(partial, "xb+") as sink:
            yield sink
        with open(partial, "ab") as file:
            file.write(_checksum_line(partial, file.tell()))


@contextmanager
def atomic_netcdf(path: PathLike, *, overwrite: bool = False) -> Iterator[h5netcdf.File]:
    """Open a NetCDF-4 file to be filled piece by piece, which appears when it is complete, with its checksum."""
    import h5netcdf  # here, with h5py: few jobs write such files

    with _netcdf_sink(path, overwrite) as sink, h5netcdf.File(sink, "w") as file:
        yield file


def write_netcdf(
    groups: Mapping[str, xr.Dataset], path: PathLike, *, overwrite: bool = False
) -> None:
    """Write data sets as groups of a NetCDF-4 file, which appears when it is complete, with its checksum."""
    import xarray as xr

    # Encodings that are left from another file (packing, fill values) would change the samples.
    tree = xr.DataTree.from_dict(
        {f"/{name}": data.drop_encoding() for name, data in groups.items()}
    )
    encoding = {
        node.path: {name: {"_FillValue": None} for name in node.variables} for node in tree.subtree
    }
    with _netcdf_sink(path, overwrite) as sink:
        tree.to_netcdf(sink, engine="h5netcdf", encoding=encoding)


def check_readable(path: PathLike) -> Path:
    """Refuse a path from which no file can be read."""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise DataError(f"{path}: this is a folder or a device, no file: check the path.")
        open(path, "rb").close()
        return Path(path)
    except FileNotFoundError:
        raise DataError(f"{path}: there is no such file: check the path.") from None
    except OSError as cause:
        reason = f"the file cannot be opened ({cause.strerror})"
        raise DataError(f"{path}: {reason}: check the path and the permission.") from cause


def has_checksum(path: PathLike) -> bool:
    """Whether a file ends with a checksum; one whose content is not the one that was written is unreadable."""
    size = os.stat(path).st_size - CHECKSUM_LENGTH
    with open(path, "rb") as file:
        file.seek(max(size, 0))
        line = file.read(CHECKSUM_LENGTH)
    if not line.startswith(CHECKSUM_MARK):
        return False
    if line != _checksum_line(path, size):
        raise UnreadableError("its checksum is wrong: bytes have changed since it was written")
    return True


def _checksum_line(path: PathLike, size: int) -> bytes:
    """Line with the checksum of the first bytes of a file."""
    checksum = hashlib.sha256()
    with open(path, "rb") as file:
        while size > 0 and (piece := file.read(min(size, PIECE))):
            checksum.update(piece)
            size -= len(piece)
    return CHECKSUM_MARK + checksum.hexdigest().encode() + b"\n"


# --- Tables for people, as CSV


def write_csv(table: pd.DataFrame, path: PathLike, *, overwrite: bool = False) -> None:
    """Write a table; text in it that begins like a formula gets a quote in front."""
    texts = table.select_dtypes(exclude=["number", "bool"])
    with atomic_file(path, overwrite=overwrite) as partial:
        table.assign(**texts.map(_quote)).to_csv(partial, index=False, lineterminator="\n")


def _quote(value: Any) -> Any:
    """A text that cannot be taken for a formula."""
    is_formula = isinstance(value, str) and value.startswith(("=", "+", "-", "@"))
    return f"'{value}" if is_formula else value
