"""Formats of data files by their suffixes: a reader of another format is added here, as a class of `Contents`.

Damaged files can kill or halt the process that opens them, so the readers run in the process of
`ankleloop.trials.reading_server`, and in no other.
"""

from __future__ import annotations

from pathlib import Path

from ankleloop.trials.channel_files import Contents

SUFFIXES = (".csv", ".csv.gz", ".mat", ".h5", ".hdf5", ".nc")
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def find_suffix(path: Path) -> str | None:
    """Suffix by which the format of a file is chosen; None if it is unknown."""
    return next((suffix for suffix in SUFFIXES if path.name.lower().endswith(suffix)), None)


def choose_reader(path: Path) -> type[Contents]:
    """Class that reads a file; its module imports the library of the format."""
    suffix = find_suffix(path)
    if suffix in (".csv", ".csv.gz"):
        from ankleloop.trials.csv_files import CsvContents

        return CsvContents
    if suffix in (".h5", ".hdf5") or _is_hdf5(path):
        from ankleloop.trials.hdf5_files import Hdf5Contents

        return Hdf5Contents
    from ankleloop.trials.scipy_files import ClassicNetcdfContents, MatContents

    return MatContents if suffix == ".mat" else ClassicNetcdfContents


def _is_hdf5(path: Path) -> bool:
    """Whether a file has the signature of HDF5, at its start or behind a user block, as MATLAB writes it."""
    with open(path, "rb") as file:
        start = file.read(2048 + len(HDF5_SIGNATURE))
    return any(start.startswith(HDF5_SIGNATURE, offset) for offset in (0, 512, 1024, 2048))
