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
import stat
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ankleloop.errors import DataError, ResourceError

if TYPE_CHECKING:
    import h5netcdf
    import pandas as pd
    import xarray as xr

PathLike = str | os.PathLike[str]

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
FORBIDDEN = {errno.EACCES, errno.EPERM, errno.EROFS}

NAME_BYTES, NODE_CHARACTERS = 180, 32  # in the name of a partial file; file systems allow 255 bytes in all
FORMULA = ("=", "+", "-", "@")  # with which a spreadsheet begins a formula

MARK = b"\nankleloop: SHA-256 of all before this line: "
LENGTH = len(MARK) + 2 * hashlib.sha256().digest_size + 1
PIECE = 1 << 20

PRECISIONS: dict[str, type[np.floating]] = {"double": np.float64, "single": np.float32}


def parse_precision(precision: str) -> type[np.floating]:
    """Type of the floating-point numbers on disk."""
    if precision not in PRECISIONS:
        raise ValueError(f"unknown precision {precision!r}; known: {', '.join(PRECISIONS)}.")
    return PRECISIONS[precision]


def check_output(path: PathLike, *, overwrite: bool = False, inputs: Iterable[PathLike] = ()) -> Path:
    """Check that a file can be written and that nothing is lost by it; long computations do so before they begin."""
    path = Path(path)
    try:
        if not path.parent.is_dir():
            raise DataError(f"{path}: there is no folder {path.parent}: make it first.")
        if not os.access(path.parent, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        with suppress(FileNotFoundError):
            _check_existing(path, path.lstat().st_mode, overwrite, inputs)
    except OSError as cause:
        raise _write_error(path, cause) from cause
    except DataError:
        raise
    except ValueError as cause:  # a byte 0 in the path
        raise DataError(f"{path}: the file cannot be written ({cause}): write to another name.") from cause
    return path


def _check_existing(path: Path, kind: int, overwrite: bool, inputs: Iterable[PathLike]) -> None:
    for source in inputs:
        if path.exists() and os.path.exists(source) and path.samefile(source):
            raise DataError(f"{path}: the file is being read ({source}): write to another name.")
    if path.is_dir():
        raise DataError(f"{path}: this is a folder: write to a file in it.")
    if not (stat.S_ISREG(kind) or stat.S_ISLNK(kind)):
        raise DataError(f"{path}: this is a device, no file: write to a file.")
    if not overwrite and holds_content(path):
        raise DataError(f"{path}: the file exists already: write to another name, or replace it by overwrite=True.")


def holds_content(path: PathLike) -> bool:
    """Whether there is a file of this name in which something is lost if it is replaced."""
    try:
        status = Path(path).lstat()
    except FileNotFoundError:
        return False
    return status.st_size > 0 or not stat.S_ISREG(status.st_mode)


def _write_error(path: Path, cause: OSError) -> DataError | ResourceError:
    fault = f"{path}: the file cannot be written ({cause.strerror or cause})"
    if cause.errno in FULL:
        remedy = f"free space in the folder {path.parent}, or write to another disk"
        return ResourceError(f"{fault}: {remedy}. Nothing has been changed.")
    if cause.errno in FORBIDDEN:
        remedy = f"the folder {path.parent} cannot be written to: allow it, or write to another folder"
    else:
        remedy = f"check the folder {path.parent} and the name of the file"
    return DataError(f"{fault}: {remedy}. Nothing has been changed.")


def _partial_path(path: Path) -> Path:
    """Hidden name beside a file under which it is written: it states the computer and the process."""
    return path.with_name(f"{_partial_start(path)}{os.getpid()}-{uuid.uuid4().hex[:8]}.part")


def _partial_start(path: Path) -> str:
    name = os.fsencode(path.name)[:NAME_BYTES].decode(errors="ignore")
    return f".{name}.{platform.node()[:NODE_CHARACTERS]}-"


def _remove_stale(path: Path) -> None:
    """Remove the partial files of a file whose process, on this computer, no longer lives."""
    start = _partial_start(path)
    for partial in path.parent.glob(f"{glob.escape(start)}*.part"):
        process = partial.name.removeprefix(start).partition("-")[0]
        try:
            os.kill(int(process), 0)
        except (ProcessLookupError, OverflowError):
            partial.unlink(missing_ok=True)
        except (OSError, ValueError):  # it is another user's, or no file of this library
            continue


@contextmanager
def atomic_file(path: PathLike, *, overwrite: bool = False, inputs: Iterable[PathLike] = ()) -> Iterator[Path]:
    """Provide a temporary path, and move the file to its name if the block ends without an error.

    Of two writers of the same file both write a whole one: the later one replaces the file of the earlier one, or is
    refused without `overwrite`. If a process is killed, its partial file stays until the file is written again.
    """
    inputs = [*inputs]
    path = check_output(path, overwrite=overwrite, inputs=inputs)
    partial = _partial_path(path)
    try:
        _remove_stale(path)
        yield partial
        with open(partial, "rb+") as file:  # a power cut must not leave the name without the content
            os.fsync(file.fileno())
        check_output(path, overwrite=overwrite, inputs=inputs)  # others may have written it meanwhile
        os.replace(partial, path)
    except OSError as cause:
        if cause.filename is not None and Path(os.fsdecode(cause.filename)) != partial:  # of another file
            raise
        raise _write_error(path, cause) from cause
    finally:
        partial.unlink(missing_ok=True)


class Sink(io.FileIO):
    """A new binary file for the HDF5 library, which cannot close a file after a failed write, and then crashes at exit.

    After a failure all else that is written is lost; `check` and the end of the block raise the failure.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "xb+")
        self._failure: OSError | None = None

    def check(self) -> None:
        """Raise the first failure of the disk, if there was any."""
        if self._failure is not None:
            raise self._failure

    def __exit__(self, *_: object) -> None:
        self.close()
        self.check()  # also instead of an error in the block, which follows from it

    def write(self, data: Any) -> int:
        """Write all bytes, or remember why not."""
        view = memoryview(data).cast("B")
        end, written = self.tell() + len(view), 0
        try:
            while self._failure is None and written < len(view):
                written += super().write(view[written:])
        except OSError as failure:
            self._failure = failure
        self.seek(end)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Cut or extend the file."""
        try:
            return super().truncate(size)
        except OSError as failure:
            self._failure = self._failure or failure
            return self.tell() if size is None else size


@contextmanager
def _netcdf_sink(path: PathLike, overwrite: bool, inputs: Iterable[PathLike]) -> Iterator[Sink]:
    with atomic_file(path, overwrite=overwrite, inputs=inputs) as partial:
        with Sink(partial) as sink:
            yield sink
        append_checksum(partial)


@contextmanager
def atomic_netcdf(
    path: PathLike, *, overwrite: bool = False, inputs: Iterable[PathLike] = ()
) -> Iterator[tuple[h5netcdf.File, Sink]]:
    """Open a NetCDF-4 file to be filled piece by piece, which appears when it is complete, with its checksum."""
    import h5netcdf  # here, with h5py: few jobs write such files

    with _netcdf_sink(path, overwrite, inputs) as sink, h5netcdf.File(sink, "w") as file:
        yield file, sink


def write_netcdf(data: xr.Dataset | xr.DataTree, path: PathLike, *, overwrite: bool = False) -> None:
    """Write a data set or a tree of them as a NetCDF-4 file, which appears when it is complete, with its checksum."""
    if hasattr(data, "subtree"):
        encoding: Any = {node.path: {name: {"_FillValue": None} for name in node.variables} for node in data.subtree}
    else:
        encoding = {name: {"_FillValue": None} for name in data.variables}  # fill values would change numbers
    with _netcdf_sink(path, overwrite, source_files(data)) as sink:
        data.to_netcdf(sink, engine="h5netcdf", encoding=encoding)


def source_files(data: xr.Dataset | xr.DataTree) -> set[str]:
    """Files from which a data set or a tree of data sets has been opened."""
    nodes = getattr(data, "subtree", (data,))
    encodings = [holder.encoding for node in nodes for holder in (node, *node.variables.values())]
    return {encoding["source"] for encoding in encodings if isinstance(encoding.get("source"), str)}


def check_readable(path: PathLike) -> None:
    """Refuse a path from which no file can be read."""
    path = Path(path)
    try:
        kind = path.stat().st_mode
        if stat.S_ISREG(kind):
            path.open("rb").close()
    except (FileNotFoundError, NotADirectoryError):
        if path.is_symlink():
            raise DataError(f"{path}: this is a link that leads to no file: check the path.") from None
        raise DataError(f"{path}: there is no such file: check the path.") from None
    except (OSError, ValueError) as cause:  # a ValueError for a byte 0 in the path
        reason = getattr(cause, "strerror", None) or str(cause)
        raise DataError(f"{path}: the file cannot be opened ({reason}): check the path and the permission.") from cause
    if not stat.S_ISREG(kind):
        name = "a folder" if stat.S_ISDIR(kind) else "a device"
        raise DataError(f"{path}: this is {name}, no file: check the path.")


def stamp_file(path: PathLike) -> tuple[int, ...]:
    """What changes with a file; nothing of one that is gone."""
    try:
        status = os.stat(path)
    except OSError:
        return ()
    return status.st_ino, status.st_size, status.st_mtime_ns


def append_checksum(path: PathLike) -> None:
    """Append the checksum of its content to a file."""
    line = _checksum_line(path, os.stat(path).st_size)
    with open(path, "ab") as file:
        file.write(line)


def has_right_checksum(path: PathLike) -> bool | None:
    """Whether the content of a file is the one that was written; None for a file without a checksum."""
    size = os.stat(path).st_size - LENGTH
    if size < 0:
        return None
    with open(path, "rb") as file:
        file.seek(size)
        line = file.read(LENGTH)
    return line == _checksum_line(path, size) if line.startswith(MARK) else None


def _checksum_line(path: PathLike, size: int) -> bytes:
    """Line with the checksum of the first bytes of a file."""
    checksum = hashlib.sha256()
    with open(path, "rb") as file:
        while size > 0 and (piece := file.read(min(size, PIECE))):
            checksum.update(piece)
            size -= len(piece)
    return MARK + checksum.hexdigest().encode() + b"\n"


# --- Tables for people, as CSV


def write_csv(table: pd.DataFrame, path: PathLike, *, overwrite: bool = False) -> None:
    """Write a table; text in it that begins like a formula gets a quote in front."""
    with atomic_file(path, overwrite=overwrite) as partial:
        quote_formulas(table).to_csv(partial, index=False, lineterminator="\n")


def quote_formulas(table: pd.DataFrame) -> pd.DataFrame:
    """A table with a quote in front of text that a spreadsheet would take for a formula."""
    texts = table.select_dtypes(exclude=["number", "bool"]).columns
    return table.assign(**{name: table[name].map(_quote) for name in texts})


def _quote(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value
