"""What a command shows: results on the standard output, messages and progress on the standard error."""

from __future__ import annotations

import logging
import os
import re
import shlex
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import click

DONE, DATA, USAGE, SOME, MISTAKE, INTERRUPTED = 0, 1, 2, 3, 4, 130  # exit statuses
COLOURS = {"ok": "green", "warning": "yellow", "refused": "red"}
PROGRESS = "ankleloop_lab.recordings.analysis"  # the logger that says which method is being fitted
# What only the user knows, by the options that need it.
PLACEHOLDERS = {
    "position": "NAME",
    "torque": "NAME",
    "reference": "NAME",
    "sampling_rate": "HZ",
    "resample": "HZ",
    "case": "NUMBER",
    "position_unit": "NUMBER",
    "torque_unit": "NUMBER",
    "reference_unit": "NUMBER",
    "variables": "NAME=VARIABLE",
    "start": "S",
    "stop": "S",
}


class ExistingFileError(click.UsageError):
    """Wrong usage: a file would be replaced."""

    remedy: Mapping[str, Any] = {"overwrite": True}


def echo(text: str = "", *, err: bool = False) -> None:
    """Print a text, with its colours on a terminal only, and not if the variable NO_COLOR is set.

    Where the program that reads it has ended, as `head` does, the command goes on in silence.
    """
    try:
        click.echo(text, err=err, color=False if os.environ.get("NO_COLOR") else None)
    except BrokenPipeError:
        stream = sys.stderr if err else sys.stdout
        with open(os.devnull, "w") as silence:
            os.dup2(silence.fileno(), stream.fileno())


def show_error(text: str) -> None:
    """Show why a command ends."""
    echo(f"{click.style('error', fg='red', bold=True)}: {text}", err=True)


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Show a warning of the library, as `warnings.showwarning` does; those of other kinds concern programmers."""
    if issubclass(category, UserWarning):
        echo(f"{click.style('warning', fg='yellow')}: {message}", err=True)


def find_status(usable: Collection[bool]) -> int:
    """Exit status of a command by which of its files can be used."""
    if all(usable):
        return DONE
    return SOME if any(usable) else DATA


def show_next(step: str) -> None:
    """Show what to do next."""
    echo(f"{click.style('next', fg='cyan')}: {step}", err=True)


def show_correction(remedy: Mapping[str, Any], words: Sequence[str]) -> None:
    """Show the command of some words with the options of a remedy, if there is one and it is another command."""
    corrected = correct(words, remedy)
    if sorted(corrected) != sorted(words):
        show_next(join_words(["ankleloop", *corrected]))


def join_words(words: Sequence[str]) -> str:
    """A command in double quotes, as the shells of all systems know them, unless a sign has a meaning in these."""
    text = shlex.join(words)
    if re.search(r"""["$`!]|\\['\\]""", text):
        return text
    return text.replace("'", '"')


def correct(words: Sequence[str], remedy: Mapping[str, Any]) -> list[str]:
    """Words of a command with the options of a remedy, each in the place of what the user gave for it."""
    known = {name: PLACEHOLDERS[name] if value is None else value for name, value in remedy.items()}
    options = set(map(name_option, known))
    end = words.index("--") if "--" in words else len(words)  # of the options
    kept = []
    rest = iter(words[:end])
    for word in rest:
        option, equals, _ = word.partition("=")
        if option not in options:
            kept.append(word)
        elif not equals:
            next(rest, None)  # its value
    return [*kept, *list_words(known), *words[end:]]


def name_option(name: str) -> str:
    """Option of a command by the name of its value."""
    return f"--{name.replace('_', '-')}"


def list_words(values: Mapping[str, Any]) -> list[str]:
    """Options with their values by name; a flag is true, and what is not stated has no value."""
    words = []
    for name, value in values.items():
        if value is True:
            words.append(name_option(name))
        elif value is not None and value is not False:
            words += [name_option(name), str(value)]
    return words


def refuse_existing(paths: Sequence[os.PathLike[str]]) -> None:
    """Refuse to replace files."""
    for path in paths:
        if os.path.lexists(path):
            raise ExistingFileError(
                f"{path}: the file exists already. --overwrite replaces it, or write elsewhere."
            )


@contextmanager
def show_progress() -> Iterator[None]:
    """Show which method is being fitted while the block runs, also in processes that it starts."""
    logger = logging.getLogger(PROGRESS)
    handler = logging.StreamHandler()
    handler.addFilter(lambda record: record.levelno == logging.INFO)
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
