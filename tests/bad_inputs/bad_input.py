"""One row of the table of bad inputs: how it is made, the call that gets it, and what the library must do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from ankleloop.errors import DataError

LONGEST = 1500  # characters of a message that somebody still reads


@dataclass(frozen=True)
class BadInput:
    """An input that is wrong, and the outcome that it must have.

    Parameters
    ----------
    wrong : str
        What is wrong with it; names the row.
    make : callable or object
        The input, or a function that makes it in an empty folder.
    call : callable
        Call of the library that gets the input. Where no error is expected, it returns the list of warnings; where a
        status is, the exit status and the output of a command.
    says : tuple of str
        Texts that the message, or the warnings, must contain: file, variable, sample, remedy.
    error : type of exception or None
        Class of the error; None where the library does not refuse the input.
    status : int or None
        Exit status, where the call runs a command.
    remedy : dict or None
        Options that the error asks for, with their values.
    """

    wrong: str
    make: Any
    call: Callable[[Any], Any]
    says: tuple[str, ...]
    error: type[BaseException] | None
    status: int | None
    remedy: dict[str, Any] | None = None

    def check(self, folder: Path) -> None:
        """Make the input in a folder, call the library, and compare what it does with what it must do."""
        value = self.make(folder) if callable(self.make) else self.make
        before = read_files(folder)
        if self.status is not None:
            status, message = self.call(value)
            assert status == self.status, message
        elif self.error is None:
            message = " ".join(map(str, self.call(value)))
        else:
            with pytest.raises(self.error) as caught:
                self.call(value)
            message = str(caught.value)
            assert caught.type is self.error, f"{caught.type.__name__}: {message}"
            assert len(message) <= LONGEST, message
            assert getattr(caught.value, "remedy", {}) == (self.remedy or {}), message
        for text in self.says:
            assert text in message, f"{text!r} is not in: {message}"
        assert read_files(folder) == before, "the call has written, changed or removed a file"


def read_files(folder: Path) -> dict[Path, bytes | None]:
    """Contents of all files below a folder, None for those of a folder."""
    return {
        path: path.read_bytes() if path.is_file() else None for path in sorted(folder.rglob("*"))
    }


def rows_of(
    usual: Callable[[Any], Any], error: type[BaseException] | None = DataError
) -> Callable[..., BadInput]:
    """A function that makes rows of one call: row(wrong, make, *says), and what differs from that by name."""

    def row(
        wrong: str,
        make: Any,
        *says: str,
        call: Callable[[Any], Any] = usual,
        error: type[BaseException] | None = error,
        status: int | None = None,
        remedy: dict[str, Any] | None = None,
    ) -> BadInput:
        return BadInput(wrong, make, call, says, error, status, remedy)

    return row
