"""One row of the table of bad inputs: how it is made, the call that gets it, and what the library must do."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
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
    make : callable
        Makes the input in an empty folder, and returns it.
    call : callable
        Call of the library that gets the input. Where no error is expected, it returns the list of warnings, the
        command that has ended, or whatever `right` checks.
    says : tuple of str
        Texts that the message, or the warnings, must contain: file, variable, sample, remedy.
    error : type of exception or None
        Class of the error; None where the library does not refuse the input.
    status : int or None
        Exit status, where the call runs a command.
    right : callable or None
        Fails where the result is wrong, for inputs that the library understands after all.
    """

    wrong: str
    make: Callable[[Path], Any]
    call: Callable[[Any], Any]
    says: tuple[str, ...] = ()
    error: type[BaseException] | None = field(default=DataError, kw_only=True)
    status: int | None = field(default=None, kw_only=True)
    right: Callable[[Any], None] | None = field(default=None, kw_only=True)

    def check(self, folder: Path) -> None:
        """Make the input in a folder, call the library, and compare what it does with what it must do."""
        value = self.make(folder)
        before = list_files(folder)
        if self.status is not None:
            process = self.call(value)
            message = process.stdout + process.stderr
            assert process.returncode == self.status, message
        elif self.right is not None:
            self.right(self.call(value))
            return
        elif self.error is None:
            message = " ".join(map(str, self.call(value)))
            assert message, "there is no warning"
        else:
            with pytest.raises(self.error) as caught:
                self.call(value)
            message = str(caught.value)
            assert caught.type is self.error, f"{caught.type.__name__}: {message}"
            assert len(message) <= LONGEST, message
        for text in self.says:
            assert text in message, f"{text!r} is not in: {message}"
        assert list_files(folder) == before, "the call has written, changed or removed a file"


def list_files(folder: Path) -> dict[str, str]:
    """All files, folders and links below a folder, with a digest of their contents."""
    entries = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink():
            entries[name] = f"link to {path.readlink()}"
        elif path.is_dir():
            entries[name] = "folder"
        elif path.is_file():
            mode = path.stat().st_mode
            path.chmod(mode | 0o400)
            entries[name] = hashlib.sha256(path.read_bytes()).hexdigest()
            path.chmod(mode)
        else:
            entries[name] = "special file"
    return entries


def rows_of(usual: Callable[[Any], Any]) -> Callable[..., BadInput]:
    """A function that makes rows of one call: row(wrong, make, *says), and what differs from that by name."""

    def row(
        wrong: str, make: Callable[[Path], Any], *says: str, call: Callable[[Any], Any] = usual, **outcome: Any
    ) -> BadInput:
        return BadInput(wrong, make, call, says, **outcome)

    return row
