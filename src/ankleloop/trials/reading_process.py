"""Files that may be damaged are opened by another process, with limits of time and memory.

A file that is damaged in a way that crashes or halts the library of its format, or makes it take all memory, gives a
`DataError`, and nothing else happens. The process is started for the first file (to start one takes longer than to read
a file), and serves those that follow, until a library fails: then its state is not to be trusted any more.

Requests and answers are lines of JSON over pipes, and behind the line of a variable stand so many samples as it says:
nothing in an answer is executed, and no answer can be taken for another one. Every wait for an answer has a limit.

On Windows neither memory nor the time of the processor is limited: there the wait for the answer ends the process.
"""

from __future__ import annotations

import atexit
import io
import json
import mmap
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ankleloop.errors import DataError, ResourceError
from ankleloop.trials import channels
from ankleloop.trials.contents import Contents, Variable
from ankleloop.trials.files import PathLike, UnreadableError, check_readable, has_checksum

# Modules and classes of the containers, by the suffix of a file.
CONTAINERS = {
    ".csv": ("csv_files", "CsvContents"),
    ".csv.gz": ("csv_files", "CsvContents"),
    ".txt": ("csv_files", "CsvContents"),
    ".tsv": ("csv_files", "CsvContents"),
    ".mat": ("matlab_files", "MatContents"),
    ".h5": ("hdf5_files", "Hdf5Contents"),
    ".hdf5": ("hdf5_files", "Hdf5Contents"),
    ".nc": ("hdf5_files", "Hdf5Contents"),
    ".flb": ("flb_files", "FlbContents"),
    ".c3d": ("recorder_files", "C3dContents"),
    ".tdms": ("recorder_files", "TdmsContents"),
}
# Limits of the processor and of memory for a file.
SECONDS, SECONDS_PER_MEGABYTE = 10.0, 1.0
BYTES, BYTES_PER_BYTE = 1 << 30, 4
PATIENCE = 20.0  # times as long a busy machine or a slow disk may take
STARTING = 60.0  # s, until the process has started
PROGRAM = "import sys; sys.path.insert(0, sys.argv[1]); from ankleloop.trials.reading_process import main; main()"
WHOLE = "check that the file is whole and its suffix right, or restore it from a copy"
# Statuses of a process that has not started or was killed, which says nothing about the file, and of one that has taken
# its time; they are numbers, as Windows has no such signals.
ENDED, PROFILED = (1, -9), -27


def read_channels(
    path: PathLike, case: int | None, task: str = "read", **wanted: Any
) -> dict[str, Variable]:
    """Read the variables of a trial from a file by role, with its times and its sampling rates.

    `wanted` is what `channels.read_channels` takes beside the open file. The task "find" finds the variables in a file
    of any size, without their samples: `wanted` is what `channels.find_channels` takes.
    """
    path = check_readable(path)
    suffix = find_suffix(path)
    if suffix is None:
        raise DataError(
            f"{path.name}: unknown kind of file: convert it to one of {', '.join(CONTAINERS)}."
        )
    if case is not None and suffix != ".flb":
        raise DataError(f"{path.name}: case chooses a trial of an .flb file: leave it out.")
    with name_errors(path.name, f"{suffix} file", WHOLE):
        return _ask(path, task, case, wanted)


def find_suffix(path: Path) -> str | None:
    """Suffix by which the format of a file is chosen; None if it is unknown."""
    return next((suffix for suffix in CONTAINERS if path.name.lower().endswith(suffix)), None)


@contextmanager
def readable_file(path: PathLike, kind: str, advice: str) -> Iterator[Path]:
    """Provide a file of this library that can be opened in this process.

    A file without a checksum (of an older version, or changed by another program) is opened by the other process first.
    """
    path = check_readable(path)
    with name_errors(path, kind, advice):
        if not has_checksum(path):
            _ask(path, "try", None, {})
        yield path


@contextmanager
def name_errors(path: PathLike, kind: str, advice: str) -> Iterator[None]:
    """Say in plain words what is wrong with the contents of a file."""
    try:
        yield
    except (DataError, ResourceError, MemoryError):  # a lack of memory says nothing about the file
        raise
    except Exception as cause:
        raise DataError(
            f"{path}: not a readable {kind} ({_describe(cause)}): it is damaged, or of another origin: {advice}."
        ) from cause


def _describe(cause: Exception) -> str:
    """What an error says, in one line, with its type unless it is one of ours."""
    text = str(cause) if isinstance(cause, UnreadableError) else f"{type(cause).__name__}: {cause}"
    return text.partition("\n")[0][:300]


# The process that opens files, with pipes as its standard input and output.
_reader: subprocess.Popen[bytes] | None = None
_lock = threading.Lock()


def _start() -> subprocess.Popen[bytes]:
    """Start the process that opens files."""
    package_folder = str(Path(__file__).parents[2])
    process = subprocess.Popen(
        # -P: files of the current folder that have the name of a module are not imported.
        [sys.executable, "-P", "-c", PROGRAM, package_folder],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        bufsize=0,  # of requests, of which a fork would have a copy
        start_new_session=True,
    )
    process.stdout = io.BufferedReader(process.stdout)  # type: ignore[type-var]
    return process


@atexit.register
def stop() -> None:
    """End the process that reads files; the next file starts it again."""
    global _reader
    if _reader is not None:
        with _reader:
            _reader.kill()
        _reader = None


def _forget() -> None:
    """A fork of this program starts a process of its own."""
    global _reader, _lock
    _reader = None
    _lock = threading.Lock()


if hasattr(os, "register_at_fork"):  # where programs fork
    os.register_at_fork(after_in_child=_forget)


def _ask(path: Path, task: str, case: int | None, wanted: dict[str, Any]) -> dict[str, Variable]:
    """What the other process reads of a file."""
    global _reader
    size = path.stat().st_size
    if size == 0:
        raise UnreadableError("it is empty, 0 bytes")
    request = {
        "task": task,
        "path": str(path.absolute()),
        "case": case,
        "seconds": SECONDS + SECONDS_PER_MEGABYTE * size / 1e6,
        "memory": BYTES + BYTES_PER_BYTE * size,
        "wanted": wanted,
    }
    with _lock:
        if _reader is None or _reader.poll() is not None:
            stop()
            _reader = _start()
        try:
            return _exchange(_reader, request, path.name)
        except DataError:
            raise
        except BaseException:
            # A library has failed, or the answer may be half read, after Ctrl-C for example.
            stop()
            raise


def _exchange(
    process: subprocess.Popen[bytes], request: dict[str, Any], name: str
) -> dict[str, Variable]:
    """Send a request about a file, and receive variables by role, or end the process if that takes too long."""
    watch = threading.Timer(STARTING + PATIENCE * request["seconds"], process.kill)
    watch.daemon = True
    watch.start()
    variables = {}
    try:
        _send(process.stdin, request)
        while "role" in (answer := _receive(process.stdout)):
            samples = _receive_samples(process.stdout, answer["size"])
            variables[answer["role"]] = Variable(
                name=answer["name"],
                shape=tuple(answer["shape"]),
                read=samples.copy,
                attributes={"unit": answer["unit"]},
                count=answer["count"],
            )
    except (OSError, EOFError):
        status = process.wait()
        if status in ENDED:
            raise ResourceError(
                f"{name}: the process that reads it did not start, was killed, or did not answer in time: free memory, "
                "wait for other programs or a slow disk, and try again."
            ) from None
        if status == PROFILED:
            fault = f"stopped after {request['seconds']:.0f} s, the limit for its size"
        else:
            fault = f"it crashed the process that reads it, status {status}"
        raise UnreadableError(fault) from None
    finally:
        watch.cancel()
    if "refusal" in answer:
        raise DataError(answer["refusal"], answer["remedy"])
    if "reason" in answer:
        raise UnreadableError(answer["reason"])
    return variables


# --- Messages: a line of JSON, and behind it the samples of a variable


def _send(pipe: Any, content: dict[str, Any], samples: Any = b"") -> None:
    """Send a line, and samples, at once."""
    message = b"".join([json.dumps(content).encode(), b"\n", samples])
    if pipe.write(message) < len(message):
        raise EOFError


def _receive(pipe: Any) -> dict[str, Any]:
    """Receive a line."""
    line = pipe.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    content: dict[str, Any] = json.loads(line)
    return content


def _receive_samples(pipe: Any, count: int) -> np.ndarray:
    """Receive so many samples."""
    content = pipe.read(8 * count)
    if len(content) < 8 * count:
        raise EOFError
    return np.frombuffer(content, "<f8")


# --- What runs in the other process


def _try(contents: Contents) -> tuple[()]:
    """Read everything, and give nothing."""
    for name in contents.names():
        contents.require(name).read()
    return ()


TASKS: dict[str, Any] = {
    "find": channels.find_channels,
    "read": channels.read_channels,
    "try": _try,
}


def main() -> None:
    """Answer requests until the pipe is closed."""
    requests = os.fdopen(0, "rb")
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    with suppress(EOFError):
        while True:
            end = _answer(answers, _receive(requests))
            _send(answers, end)
            answers.flush()


def _answer(pipe: Any, request: dict[str, Any]) -> dict[str, Any]:
    """Do a task with a file, and send the variables that it gives; its end."""
    path = Path(request["path"])
    memory = request["memory"]
    options = {} if request["case"] is None else {"case": request["case"]}
    try:
        container = choose_container(path)  # a library is imported without limits
        _limit(request["seconds"], memory)
        has_checksum(path)
        task = TASKS[request["task"]]
        with closing(container(path, **options)) as contents:
            for role, variable, numbers in task(contents, **request["wanted"]):
                described = {
                    "role": role,
                    "name": variable.name,
                    "shape": variable.shape,
                    "unit": variable.unit,
                    "count": variable.count,
                    "size": numbers.size,
                }
                _send(pipe, described, np.ravel(numbers).data)
    except DataError as error:
        return {"refusal": str(error), "remedy": error.remedy}
    except ImportError as error:
        advice = "install what reads such files by: pip install ezc3d npTDMS."
        return {"refusal": f"{path.name}: {error}: {advice}", "remedy": {}}
    except MemoryError:
        return {"reason": f"it needs more than {memory / 1e9:.1f} GB of memory"}
    except Exception as cause:  # the libraries raise almost anything on a damaged file
        return {"reason": _describe(cause)}
    finally:
        _limit(0.0, memory)
    return {}


def choose_container(path: Path) -> Callable[..., Contents]:
    """Class that opens a file; its module imports the libraries of the format."""
    module, name = CONTAINERS[str(find_suffix(path))]
    with open(path, "rb") as file:
        start = file.read(4)
    if start == b"\x89HDF":
        module, name = CONTAINERS[".h5"]
    elif start.startswith(b"CDF") and name == "Hdf5Contents":
        module, name = "classic_netcdf_files", "ClassicNetcdfContents"
    container: Callable[..., Contents] = getattr(import_module(f"ankleloop.trials.{module}"), name)
    return container


def _limit(seconds: float, memory: int) -> None:
    """Limit the time [s], where 0 lifts the limit, and the memory to what is in use and so many bytes.

    The limit of the memory is one of the address space, in which mapped files count, too.
    """
    if hasattr(signal, "setitimer"):  # not on Windows
        signal.setitimer(
            signal.ITIMER_PROF, seconds
        )  # of the processor; its end is that of the process
    with suppress(ImportError, OSError, ValueError):  # not on Linux, or above a limit of the system
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
        hard_limit = resource.getrlimit(resource.RLIMIT_AS)[1]
        resource.setrlimit(resource.RLIMIT_AS, (pages * mmap.PAGESIZE + memory, hard_limit))
