"""Tables of a job, written in another order than that in which their rows are made."""

from __future__ import annotations

import csv
import os
import pickle
import weakref
from array import array
from collections.abc import Iterable, Mapping, Sequence
from tempfile import SpooledTemporaryFile
from typing import Any

from ankleloop.trials.files import atomic_file

MEMORY = 2**23  # bytes of rows that are in memory before they go to a temporary file


class TableRows:
    """Rows of a table, grouped; they are in a temporary file, so that any number of them takes little memory.

    Parameters
    ----------
    columns : sequence of str
        The first columns, which the table has even without rows.
    folder : path-like, optional
        Folder of the temporary file; by default that of the system.
    """

    def __init__(self, columns: Sequence[str] = (), folder: str | os.PathLike[str] | None = None) -> None:
        self._file = SpooledTemporaryFile(MEMORY, dir=None if folder is None else os.fspath(folder))  # noqa: SIM115
        weakref.finalize(self, self._file.close)
        self._columns = dict.fromkeys(columns)
        self._places: dict[Any, array[int]] = {}  # 8 bytes for each row

    def add(self, group: Any, row: Mapping[str, Any]) -> None:
        """Add a row to a group."""
        self._columns |= dict.fromkeys(row)
        self._places.setdefault(group, array("q")).append(self._file.tell())
        pickle.dump(dict(row), self._file)

    def write(self, path: str | os.PathLike[str], groups: Iterable[Any]) -> None:
        """Write a CSV file; it appears when it is complete, and replaces one of its name.

        Numbers are written with all of their digits; missing values and nan are empty.
        """
        end = self._file.tell()
        with atomic_file(path, overwrite=True) as partial, open(partial, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(self._columns)
            for group in groups:
                for place in self._places.get(group, ()):
                    self._file.seek(place)
                    row = pickle.load(self._file)
                    writer.writerow(_as_text(row.get(name)) for name in self._columns)
        self._file.seek(end)


def _as_text(value: Any) -> str:
    return "" if value is None or value != value else str(value)
