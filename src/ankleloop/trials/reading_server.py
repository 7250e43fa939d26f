"""The process that opens files for another one: `ankleloop.trials.reading_process` starts it.

A damaged file can crash the libraries of a format, halt them, or make them take all memory. The process ends after a
file that a library failed on, because its state is not to be trusted any more.

Requests come as lines of JSON on the standard input. The answer is a sequence of lines of JSON on the standard output:
channels, each with its samples behind it as bytes, and a last line that says how it ended.
"""

from __future__ import annotations

import io
import json
import mmap
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.trials.channel_files import Contents, Request, list_variables, read_channels
from ankleloop.trials.channels import Channel
from ankleloop.trials.file_formats import choose_reader
from ankleloop.trials.files import has_right_checksum, stamp_file

Send = Callable[..., None]


def main() -> None:
    """Answer requests until the standard input ends, or a library fails."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that waits for the answer ends this one
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not get among the answers

    def send(message: Mapping[str, Any], samples: Any = b"") -> None:
        output.write(json.dumps(message).encode() + b"\n")
        output.write(memoryview(samples).cast("B"))
        output.flush()

    send({"kind": "ready"})
    for line in sys.stdin.buffer:
        end = _answer(Request(**json.loads(line)), send)
        send(end)
        if end["kind"] in ("failed", "memory", "limited"):
            return


def _answer(request: Request, send: Send) -> dict[str, Any]:
    """Do what is requested with a file; the last message."""
    path, end = Path(request.path), {"kind": "end"}
    reader, stamp = choose_reader(path), stamp_file(path)  # a library is imported without limits
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        allowance = _limit(request.seconds, request.memory)
        try:
            for role, channel in _read(path, reader, request):
                values = channel.values
                message = {"role": role, "name": channel.name, "unit": channel.unit, "shape": channel.shape}
                kind = None if values is None else values.dtype.str
                send({"kind": "channel", "type": kind, **message}, b"" if values is None else values.ravel())
        except DataError as error:
            end = {"kind": "refused", "text": str(error)}
        except MemoryError:
            end = {"kind": "memory" if allowance >= request.memory else "limited"}
        except Exception as cause:  # the libraries raise almost anything on a damaged file
            end = {"kind": "failed", "text": _describe(cause)}
        finally:
            _limit(0.0, None)
    if stamp_file(path) != stamp:
        text = f"{path.name}: the file has changed while it was read: wait until it is whole, and read it again."
        end = {"kind": "refused", "text": text}
    # Warnings of libraries are not for the reader of a trial; those here begin with the name of the file.
    texts = [str(w.message) for w in caught if w.category is UserWarning and str(w.message).startswith(path.name)]
    return {**end, "warnings": texts}


def _read(path: Path, reader: type[Contents], request: Request) -> Iterator[tuple[str, Channel]]:
    if request.task == "copy":
        copy = np.frombuffer(_copy_matlab(path) if path.suffix == ".mat" else _copy_netcdf(path), np.uint8)
        yield "copy", Channel(path.name, "", copy.shape, copy)
        return
    if request.part is None and request.with_samples and has_right_checksum(path) is False:
        raise DataError(
            f"{path.name}: bytes have changed since the file was written (its checksum is wrong): restore it from a "
            "copy."
        )
    with closing(reader(path)) as contents:
        yield from list_variables(contents) if request.task == "listing" else read_channels(contents, request)


def _describe(cause: Exception) -> str:
    text = f"{type(cause).__name__}: {cause}".partition("\n")[0]
    return text if len(text) <= 300 else f"{text[:297]}..."


def _limit(seconds: float, memory: float | None) -> float:
    """Limit the processor's time [s], and the memory to what is in use and an allowance, which is returned [bytes].

    0 s and None lift the limits. That of the memory is one of the address space, in which mapped files count, too.
    """
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, seconds)  # its signal ends the process
    try:
        import resource

        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        used = int(Path("/proc/self/statm").read_text().split()[0]) * mmap.PAGESIZE
        wanted = resource.RLIM_INFINITY if memory is None else int(used + memory)
        soft = wanted if hard == resource.RLIM_INFINITY else hard if memory is None else min(wanted, hard)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    except (ImportError, OSError, ValueError):
        return memory or 0.0
    return soft - used


def _copy_matlab(path: Path) -> bytes:
    """The contents of a MATLAB file, written anew, so that what is damaged or unusual in it stays behind."""
    import scipy.io

    contents = scipy.io.loadmat(path, appendmat=False)
    variables = {name: value for name, value in contents.items() if not name.startswith("__")}
    copy = io.BytesIO()
    scipy.io.savemat(copy, variables, appendmat=False, long_field_names=True)
    return copy.getvalue()


def _copy_netcdf(path: Path) -> bytes:
    """The contents of a NetCDF-4 file, written anew."""
    import h5netcdf

    copy = io.BytesIO()
    with (
        h5netcdf.File(path, "r", phony_dims="access") as source,
        h5netcdf.File(copy, "w", invalid_netcdf=True) as target,
    ):
        _copy_group(source, target)
    return copy.getvalue()


def _copy_group(source: Any, target: Any) -> None:
    """Write attributes, dimensions, variables and groups of a group into an empty one, one variable after the other."""
    import h5py

    target.attrs.update(dict(source.attrs))
    dimensions = {name: variable.dimensions for name, variable in source.variables.items()}  # which names those without
    for name, dimension in source.dimensions.items():
        if name not in target.dimensions:  # as those of the groups around it are
            target.dimensions[name] = dimension.size
    for name, variable in source.variables.items():
        data = variable._h5ds
        if data.is_virtual or data.external:  # HDF5 puts zeros where such a file is missing
            raise ValueError(f"the samples of {name} are in other files")
        values, attributes = np.asarray(variable[...]), dict(variable.attrs)
        fill_value = attributes.pop("_FillValue", None)
        kind = h5py.string_dtype() if values.dtype.kind == "O" else values.dtype
        copy = target.create_variable(name, dimensions[name], kind, data=values, fillvalue=fill_value)
        copy.attrs.update(attributes)
    for name, group in source.groups.items():
        _copy_group(group, target.create_group(name))
