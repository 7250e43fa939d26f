"""What a command shows: results on the standard output, messages and progress on the standard error."""

from __future__ import annotations

import logging
import os
import re
import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import click

COLOURS = {"ok": "green", "warning": "yellow", "refused": "red"}
PROGRESS = "ankleloop.recordings.analysis"  # the logger that says which method is being fitted
# What messages ask for, the option that gives it, and its value: what only the user knows is in capitals.
REMEDIES = (
    (r"pass sampling_rate", "--sampling-rate", "HZ"),
    (r"position_unit='(\w+)'", "--position-unit", "{}"),
    (r"position_sign[:=] ?(-?1)", "--position-sign", "{}"),
    (r"torque_sign[:=] ?(-?1)", "--torque-sign", "{}"),
    (r"the option case", "--case", "NUMBER"),
    (r"variables of read_trial", "--variables", "NAME=VARIABLE"),
    (r"\(drift, ", "--drift", "1"),
    (r"\(start, stop\)", "--start", "S"),
    (r"\(start, stop\)", "--stop", "S"),
    (r"overwrite(?:=True| replaces)", "--overwrite", ""),
)


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


def show_error(text: str, words: Sequence[str]) -> None:
    """Show why a command of some words ends, and the command that its message asks for."""
    echo(f"{click.style('error', fg='red', bold=True)}: {text}", err=True)
    show_correction(text, words)


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Show a warning of the library, as `warnings.showwarning` does; those of other kinds concern programmers."""
    if issubclass(category, UserWarning):
        echo(f"{click.style('warning', fg='yellow')}: {message}", err=True)


def show_next(step: str) -> None:
    """Show what to do next."""
    echo(f"{click.style('next', fg='cyan')}: {step}", err=True)


def show_correction(text: str, words: Sequence[str]) -> None:
    """Show the command of some words with the options that a message asks for, if it asks for any."""
    options = find_options(text)
    command = ["ankleloop", *words]
    for option, value in options.items():
        command = _set_option(command, option, value)
    if options:
        show_next(shlex.join(command))


def find_options(text: str) -> dict[str, str]:
    """Options that a message asks for, with their values; that of a flag is empty."""
    options = {}
    for pattern, option, value in REMEDIES:
        match = re.search(pattern, text)
        if match:
            options[option] = value.format(*match.groups())
    return options


def _set_option(words: Sequence[str], option: str, value: str) -> list[str]:
    """Words of a command with an option at their end, in the place of the same option with another value."""
    command = [word for word in words if not word.startswith(f"{option}=")]
    setting = [option, value] if value else [option]
    if option in command:
        place = command.index(option)
        del command[place : place + len(setting)]
    return command + setting


def refuse_existing(paths: Sequence[os.PathLike[str]]) -> None:
    """Refuse to replace files."""
    for path in paths:
        if os.path.lexists(path):
            raise click.UsageError(
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
