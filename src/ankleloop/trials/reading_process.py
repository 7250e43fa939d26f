"""Files that may be damaged are opened by another process, with limits of time and memory.

A file that is damaged in a way that crashes or halts the library of its format, or makes it take all memory, gives a
`DataError`, and nothing else happens. The process is started for the first file (to start one takes longer than to read
a file), and serves those that follow, until a library fails: then its state is not to be trusted any more.

Requests and answers are JSON over a pipe, and samples behind their channel as bytes: nothing in an answer is executed.
"""

from __future__ import annotations

import atexit
import io
import json
import math
import mmap
import os
import resource
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ankleloop.errors import DataError, ResourceError
from ankleloop.trials.channels import Channel
from ankleloop.trials.containers import (
    SUFFIXES,
    Contents,
    find_suffix,
    find_variables,
    select_channels,
)
from ankleloop.trials.files import check_readable, has_right_checksum, stamp_file

if TYPE_CHECKING:
    from ankleloop.trials.reading_options import ReadingOptions

SECONDS, SECONDS_PER_MEGABYTE = 10.0, 1.0  # of the processor for a file
BYTES, BYTES_PER_BYTE = 1 << 30, 4  # of memory for a file
START_SECONDS = 120.0  # until the process is ready, on a machine that is busy or has a slow disk
PATIENCE = 10.0  # times as long a busy machine or a slow disk may take
LONGEST_MESSAGE = 1 << 20
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
PROGRAM = "import sys; sys.path.insert(0, sys.argv[1]); from ankleloop.trials.reading_process import main; main()"

PathLike = str | os.PathLike[str]
Describe = Callable[[str], str]  # gives the message about a file that cannot be read, for a reason


def list_variables(path: PathLike, case: int | None = None) -> list[Channel]:
    """List the variables of a file of any size: full names, units and shapes."""
    return list(_ask(path, "listing", case=case).values())


def read_channels(path: PathLike, options: ReadingOptions, **wanted: Any) -> dict[str, Channel]:
    """Read the channels of a trial from a file, with its times and its sampling rate.

    `wanted` is what `containers.select_channels` takes beside the variables and the rate.
    """
    variables = {**options.channels, **options.further}
    return _ask(path, "channels", case=options.case, variables=variables, rate=options.sampling_rate, **wanted)


@contextmanager
def readable_file(path: PathLike, kind: str, remedy: str) -> Iterator[Path | io.BytesIO]:
    """Provide what can be opened in this process in place of a file of this library.

    It is the file itself if its checksum is right. The contents of a file without a checksum (of an older version, or
    changed by another program) are written again into memory by the other process.
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
        answer = _answer_of(path, "copy", lambda reason: describe_damage(path, kind, remedy, reason), {})
        yield io.BytesIO(answer["copy"].values.tobytes())


@contextmanager
def name_errors(path: PathLike, kind: str, remedy: str) -> Iterator[None]:
    """Say in plain words what is wrong with the contents of a file."""
    try:
        yield
    except (DataError, ResourceError, MemoryError):  # a lack of memory says nothing about the file
        raise
    except Exception as cause:
        raise DataError(describe_damage(path, kind, remedy, _describe(cause))) from cause


def describe_damage(path: PathLike, kind: str, remedy: str, reason: str) -> str:
    """Message about a file that cannot be read."""
    return f"{path}: not a readable {kind} ({reason}): it is damaged, or of another origin: {remedy}."


def _describe(cause: Exception) -> str:
    text = f"{type(cause).__name__}: {cause}".partition("\n")[0]
    return text if len(text) <= 300 else f"{text[:297]}..."


def _ask(path: PathLike, task: str, **wanted: Any) -> dict[str, Channel]:
    """Have the other process read a recording."""
    path = Path(path)
    check_readable(path)
    suffix = find_suffix(path)
    if suffix is None:
        raise DataError(f"{path.name}: unknown kind of file: convert it to one of {', '.join(SUFFIXES)}.")

    def describe(reason: str) -> str:
        return f"{path.name}: cannot be read as {suffix} ({reason}): check that the file is whole and its suffix right."

    if path.stat().st_size == 0:
        raise DataError(describe("it is empty, 0 bytes"))
    return _answer_of(path, task, describe, wanted)


class _Reader:
    """The process that opens files, and the pipe to it."""

    def __init__(self) -> None:
        self.pipe, end = Pipe()
        self.owner = os.getpid()  # a fork of this process starts one of its own
        # -P: files of the current folder that have the name of a module are not imported.
        command = [sys.executable, "-P", "-c", PROGRAM, str(Path(__file__).parents[2]), str(end.fileno())]
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        nothing = subprocess.DEVNULL
        with end:
            self.process = subprocess.Popen(
                command, stdin=nothing, stdout=nothing, stderr=nothing, env={**os.environ, **threads},
                pass_fds=[end.fileno()], start_new_session=True,
            )  # fmt: skip
        atexit.register(self.stop)

    def stop(self) -> None:
        """End the process."""
        if self.owner == os.getpid():
            self.process.kill()
            self.process.wait()
        self.pipe.close()
        atexit.unregister(self.stop)

    def exchange(self, request: list[Any], seconds: float, channels: dict[str, Channel]) -> dict[str, Any]:
        """Send a request and receive channels; the last message: a `fault` of the file or a `lack`, if there is one."""
        start = time.monotonic()
        try:
            self.pipe.send_bytes(json.dumps(request).encode())
            while self.pipe.poll(START_SECONDS + PATIENCE * seconds):
                message: dict[str, Any] = json.loads(self.pipe.recv_bytes(LONGEST_MESSAGE))
                if "role" not in message:
                    return message
                role, kind, samples = (message.pop(key) for key in ("role", "type", "samples"))
                values = np.frombuffer(self.pipe.recv_bytes(), kind).reshape(samples)
                channels[role] = Channel(**{**message, "shape": tuple(message["shape"])}, values=values)
        except (OSError, EOFError, ValueError, KeyError, TypeError):  # no whole answer
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(1.0)
            return self._explain_end(seconds, time.monotonic() - start)
        waited = f"{time.monotonic() - start:.0f} s"
        return {
            "lack": f"the file was not read within {waited}: the computer is busy, or the disk slow; try again later."
        }

    def _explain_end(self, limit: float, seconds: float) -> dict[str, Any]:
        """Why there is no answer of a process that has ended."""
        code = self.process.returncode or 0
        if code > 0:
            raise RuntimeError(
                f"the process that reads files did not start: {sys.executable} -P -c ... failed. Run this program by "
                "the Python of its environment."
            )
        name = signal.Signals(-code).name if code else ""
        if name in ("SIGKILL", "SIGTERM"):
            text = f"the process that reads the file was killed ({name}), most often because memory was short"
            return {"lack": f"{text}: free memory, and try again."}
        if name == "SIGPROF":
            return {"reason": f"stopped after {seconds:.0f} s, {limit:.0f} s is the limit for its size"}
        return {"reason": f"it crashed the process that reads it{name and f', {name}'}"}


_reader: _Reader | None = None
_lock = threading.Lock()
# A fork of this process waits for an answer that is under way, and has the lock for itself.
os.register_at_fork(before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_lock.release)


def stop() -> None:
    """End the process that reads files; the next file starts it again."""
    global _reader
    if _reader is not None:
        _reader.stop()
        _reader = None


def _answer_of(path: Path, task: str, describe: Describe, wanted: dict[str, Any]) -> dict[str, Channel]:
    """What the other process reads of a file."""
    global _reader
    size = path.stat().st_size
    seconds, memory = SECONDS + SECONDS_PER_MEGABYTE * size / 1e6, BYTES + BYTES_PER_BYTE * size
    channels: dict[str, Channel] = {}
    end: dict[str, Any] = {}
    with _lock:
        if _reader is None or _reader.owner != os.getpid() or _reader.process.poll() is not None:
            stop()
            _reader = _Reader()
        try:
            end = _reader.exchange([task, str(path.absolute()), seconds, memory, wanted], seconds, channels)
        finally:
            if "warnings" not in end:  # the answer may be half read, after Ctrl-C for example
                stop()
    if "refusal" in end:
        raise DataError(end["refusal"])
    if "lack" in end:
        raise ResourceError(f"{path.name}: {end['lack']}")
    if "reason" in end:
        raise DataError(f"{describe(end['reason']).rstrip('.')}{end.get('hint', '')}.")
    for text in end["warnings"]:
        warnings.warn(text, UserWarning, stacklevel=5)  # of the caller of read_trial
    return channels


# --- What runs in the other process


def main() -> None:
    """Answer requests until the pipe is closed, or a library fails."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that waits for the answer ends this one
    pipe = Connection(int(sys.argv[2]))
    end: dict[str, Any] = {"warnings": []}
    with suppress(EOFError):
        while "warnings" in end:
            end = _answer(pipe, *json.loads(pipe.recv_bytes()))
            pipe.send_bytes(json.dumps(end).encode())


def _answer(pipe: Connection, task: str, name: str, seconds: float, memory: float, wanted: Any) -> dict[str, Any]:
    """Do a task with a file; the last message, without `warnings` if a library failed."""
    path = Path(name)
    end: dict[str, Any] = {}
    container, stamp = choose_container(path), stamp_file(path)  # a library is imported without limits
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        allowance = _limit(seconds, memory)
        try:
            for role, channel in _read(container, path, task, wanted):
                values = channel.values
                message = {"role": role, "name": channel.name, "unit": channel.unit, "shape": channel.shape}
                message |= {"type": values.dtype.str, "samples": values.shape}
                pipe.send_bytes(json.dumps(message).encode())
                pipe.send_bytes(values.tobytes())
        except DataError as error:
            end = {"refusal": str(error)}
        except MemoryError:
            end = {"lack": "this program is allowed too little memory to read the file (ulimit -v)."}
            if allowance >= memory:
                hint = "; a long record is read from HDF5 or NetCDF with ankleloop.LongRecord" * (task != "copy")
                end = {"reason": f"it needs more than {memory / 1e9:.1f} GB of memory", "hint": hint}
        except Exception as cause:  # the libraries raise almost anything on a damaged file
            end = {"reason": _describe(cause)}
        finally:
            _limit(0.0, math.inf)
    # Warnings of libraries are not for the reader of a trial; those here begin with the name of the file.
    texts = [str(w.message) for w in caught if w.category is UserWarning and str(w.message).startswith(path.name)]
    warned = {} if {"lack", "reason"} & end.keys() else {"warnings": texts}
    if stamp_file(path) != stamp:
        text = f"{path.name}: the file has changed while it was read: wait until it is whole, and read it again."
        end = {"refusal": text}
    return {**end, **warned}


def choose_container(path: Path) -> type[Contents]:
    """Class that opens a file; its module imports the library of the format."""
    suffix = find_suffix(path)
    if suffix in (".csv", ".csv.gz"):
        from ankleloop.trials.csv_files import CsvContents

        return CsvContents
    if suffix == ".flb":
        from ankleloop.trials.flb_files import FlbContents

        return FlbContents
    from ankleloop.trials.binary_files import ClassicNetcdfContents, Hdf5Contents, MatContents

    if suffix in (".h5", ".hdf5") or _is_hdf5(path):
        return Hdf5Contents
    return MatContents if suffix == ".mat" else ClassicNetcdfContents


def _is_hdf5(path: Path) -> bool:
    """Whether a file has the signature of HDF5, at its start or behind a user block, as MATLAB writes it."""
    with open(path, "rb") as file:
        start = file.read(2048 + len(HDF5_SIGNATURE))
    return any(start.startswith(HDF5_SIGNATURE, offset) for offset in (0, 512, 1024, 2048))


def _read(container: type[Contents], path: Path, task: str, wanted: dict[str, Any]) -> Iterator[tuple[str, Channel]]:
    if task == "copy":
        copy = np.frombuffer(_copy_file(container, path), np.uint8)
        yield "copy", Channel(path.name, "", copy.shape, copy)
        return
    if task == "channels" and "part" not in wanted and has_right_checksum(path) is False:
        raise DataError(
            f"{path.name}: bytes have changed since the file was written (its checksum is wrong): restore it from a "
            "copy."
        )
    contents = container(path, wanted.pop("case"))
    if task == "listing":
        yield from find_variables(contents).items()
    else:
        yield from select_channels(contents, **wanted)


def _limit(seconds: float, memory: float) -> float:
    """Limit the processor's time [s], and the memory to what is in use and an allowance, which is returned [bytes].

    0 s and infinity lift the limits. That of the memory is one of the address space, in which mapped files count, too.
    """
    signal.setitimer(signal.ITIMER_PROF, seconds)  # its signal ends the process
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    largest = math.inf if hard == resource.RLIM_INFINITY else hard
    try:
        used = int(Path("/proc/self/statm").read_text().split()[0]) * mmap.PAGESIZE
        soft = min(used + memory, largest)
        resource.setrlimit(resource.RLIMIT_AS, (hard if soft == largest else int(soft), hard))
    except (OSError, ValueError):  # not on Linux
        return memory
    return soft - used


def _copy_file(container: type[Contents], path: Path) -> bytes:
    """The contents of a MATLAB or NetCDF-4 file, written again: what is damaged or unusual in it stays behind."""
    copy = io.BytesIO()
    if path.suffix == ".mat":
        import scipy.io

        loaded = scipy.io.loadmat(path, appendmat=False)
        variables = {name: value for name, value in loaded.items() if not name.startswith("__")}
        scipy.io.savemat(copy, variables, appendmat=False, long_field_names=True)
        return copy.getvalue()
    import xarray as xr

    contents = container(path)
    for name in contents.names():
        contents.find(name)  # refuses samples in other files
    with xr.open_datatree(path, engine="h5netcdf", decode_cf=False) as tree:
        data = tree.load()
    encoding = {node.path: {name: {"_FillValue": None} for name in node.variables} for node in data.subtree}
    data.to_netcdf(copy, engine="h5netcdf", encoding=encoding)
    return copy.getvalue()
