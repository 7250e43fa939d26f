"""Files of laboratories: each is read by another process, whose container knows the format by the suffix.

To add a format, write a class of `Contents` and a function here that opens it, and name the function by its suffix.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from ankleloop.errors import DataError
from ankleloop.trials.files import PathLike, check_readable
from ankleloop.trials.guarded_process import Arrays, GuardedProcess, serve
from ankleloop.trials.readable_files import name_errors
from ankleloop_lab.files.channels import find_channels
from ankleloop_lab.files.channels import read_channels as read_open_channels
from ankleloop_lab.files.contents import Contents, Variable

WHOLE = "check that the file is whole and its suffix right, or restore it from a copy"
Container = Callable[..., Contents]


# The libraries of a format are imported where a file of it is opened.


def _load_csv() -> Container:
    import pandas as pd

    # Arrow, which has the text of columns otherwise, takes more address space than a file may.
    pd.set_option("mode.string_storage", "python")
    from ankleloop_lab.files.csv_files import CsvContents

    return CsvContents


def _load_matlab() -> Container:
    from ankleloop_lab.files.matlab_files import MatContents

    return MatContents


def _load_hdf5() -> Container:
    from ankleloop_lab.files.hdf5_files import Hdf5Contents

    return Hdf5Contents


def _load_classic_netcdf() -> Container:
    from ankleloop_lab.files.classic_netcdf_files import ClassicNetcdfContents

    return ClassicNetcdfContents


def _load_flb() -> Container:
    from ankleloop_lab.files.flb_files import FlbContents

    return FlbContents


def _load_c3d() -> Container:
    from ankleloop_lab.files.c3d_files import C3dContents

    return C3dContents


def _load_tdms() -> Container:
    from ankleloop_lab.files.tdms_files import TdmsContents

    return TdmsContents


CONTAINERS: dict[str, Callable[[], Container]] = {
    ".csv": _load_csv,
    ".csv.gz": _load_csv,
    ".txt": _load_csv,
    ".tsv": _load_csv,
    ".sto": _load_csv,
    ".mot": _load_csv,
    ".mat": _load_matlab,
    ".h5": _load_hdf5,
    ".hdf5": _load_hdf5,
    ".nc": _load_hdf5,
    ".flb": _load_flb,
    ".c3d": _load_c3d,
    ".tdms": _load_tdms,
}


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
        arrays = process.ask(path, task, case=case, **wanted)
    variables = {}
    for description, samples in arrays:
        role = description.pop("role")
        shape = tuple(description.pop("shape"))
        attributes = {"unit": description.pop("unit")}
        variables[role] = Variable(
            shape=shape, read=samples.copy, attributes=attributes, **description
        )
    return variables


def find_suffix(path: Path) -> str | None:
    """Suffix by which the format of a file is chosen; None if it is unknown."""
    return next((suffix for suffix in CONTAINERS if path.name.lower().endswith(suffix)), None)


# --- What runs in the other process


def _find(path: Path, case: int | None, **wanted: Any) -> Arrays:
    """The variables of a trial, without their samples."""
    return _describe_channels(choose_container(path), path, case, find_channels, wanted)


def _read(path: Path, case: int | None, **wanted: Any) -> Arrays:
    """The variables of a trial."""
    return _describe_channels(choose_container(path), path, case, read_open_channels, wanted)


def _describe_channels(
    container: Container, path: Path, case: int | None, task: Any, wanted: dict[str, Any]
) -> Arrays:
    """What a task gives of an open file."""
    options = {} if case is None else {"case": case}
    with closing(container(path, **options)) as contents:
        for role, variable, samples in task(contents, **wanted):
            description = {
                "role": role,
                "name": variable.name,
                "shape": variable.shape,
                "unit": variable.unit,
                "count": variable.count,
            }
            yield description, samples


def choose_container(path: Path) -> Container:
    """Class that opens a file, by its suffix and its first bytes."""
    load = CONTAINERS[str(find_suffix(path))]
    with open(path, "rb") as file:
        start = file.read(4)
    if start == b"\x89HDF":
        load = _load_hdf5
    elif start.startswith(b"CDF") and load is _load_hdf5:
        load = _load_classic_netcdf
    try:
        return load()
    except ImportError as error:
        advice = 'install what reads such files by: pip install "ankleloop[lab,formats]".'
        raise DataError(f"{path.name}: {error}: {advice}") from None


def main() -> None:
    """What the other process runs."""
    # Texts of tables are those of Arrow where it is installed, and its usual allocator takes more address space than a
    # file may.
    os.environ["ARROW_DEFAULT_MEMORY_POOL"] = "system"
    serve({"find": _find, "read": _read})


process = GuardedProcess(main)
