"""Files that this library has written: one that another program may have changed is opened by another process first."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ankleloop.errors import DataError, ResourceError
from ankleloop.trials.files import PathLike, check_readable, describe_cause, has_checksum
from ankleloop.trials.guarded_process import Arrays, GuardedProcess, serve


@contextmanager
def readable_file(path: PathLike, kind: str, advice: str) -> Iterator[Path]:
    """Provide a file of this library that can be opened in this process.

    A file without a checksum (of an older version, or changed by another program) is opened by the other process first.
    """
    path = check_readable(path)
    with name_errors(path, kind, advice):
        if not has_checksum(path):
            process.ask(path, "matlab" if path.suffix == ".mat" else "hdf5")
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
            f"{path}: not a readable {kind} ({describe_cause(cause)}): it is damaged, or of another origin: {advice}."
        ) from cause


# --- What runs in the other process


def _try_matlab(path: Path) -> Arrays:
    """Read all of a MATLAB file, and give nothing."""
    from scipy.io import loadmat

    def read() -> Arrays:
        loadmat(path, simplify_cells=True)
        yield from ()

    return read()


def _try_hdf5(path: Path) -> Arrays:
    """Read all of an HDF5 file, to which NetCDF-4 belongs, and give nothing."""
    import h5py

    def read() -> Arrays:
        with h5py.File(path) as file:
            file.visititems(lambda name, node: _read_node(path, name, node))
        yield from ()

    return read()


def _read_node(path: Path, name: str, node: Any) -> None:
    """Read a variable of HDF5; its samples are in this file."""
    if hasattr(node, "shape"):
        check_place(path, name, node)
        node[()]


def check_place(path: Path, name: str, node: Any, file: Any = None) -> None:
    """Refuse samples in other files (external links, external storage, virtual data sets), which HDF5 reads as zeros.

    Where such a file is missing, nothing else would be noticed.
    """
    import h5py

    is_data = isinstance(node, h5py.Dataset)
    is_linked = file is not None and h5py.h5f.get_name(node.id) != h5py.h5f.get_name(file.id)
    if is_linked or (is_data and (node.is_virtual or node.external)):
        raise DataError(
            f"{path.name}: the samples of {name} are in other files: copy them into one file, for example by h5repack "
            "or with MATLAB."
        )


TASKS = {"matlab": _try_matlab, "hdf5": _try_hdf5}


def main() -> None:
    """What the other process runs."""
    serve(TASKS)


process = GuardedProcess(main)
