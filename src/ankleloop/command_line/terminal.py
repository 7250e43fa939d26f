"""What a command shows: results on the standard output, messages and progress on the standard error."""

from __future__ import annotations

import logging
import os
import re
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import click

COLOURS = {"ok": "green", "warning": "yellow", "refused": "red"}
PROGRESS = "ankleloop.recordings.analysis"  # the logger that says which method is being fitted
# What messages ask for, and the options that give it; what only the user knows is in capitals.
REMEDIES = {
    r"pass sampling_rate": "--sampling-rate HZ",
    r"position_unit='(\w+)'": "--position-unit {}",
    r"torque_sign: -1": "--torque-sign -1",
    r"the option case": "--case NUMBER",
    r"variables of read_trial": "--variables NAME=VARIABLE",
    r"\(drift, ": "--drift 1",
    r"\(start, stop\)": "--start S --stop S",
    r"overwrite(=True| replaces)": "--overwrite",
}


def echo(text: str = "", *, err: bool = False) -> None:
    """Print a text, with its colours on a terminal only, and not if the variable NO_COLOR is set."""
    click.echo(text, err=err, color=False if os.environ.get("NO_COLOR") else None)


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
    matches = {option: re.search(pattern, text) for pattern, option in REMEDIES.items()}
    options = " ".join(option.format(*match.groups()) for option, match in matches.items() if match)
    if "--torque-sign -1" in " ".join(words):
        options = options.replace("--torque-sign -1", "--torque-sign 1")
    if options:
        show_next(shlex.join(["ankleloop", *words, *options.split()]))


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
    logger, handler = logging.getLogger(PROGRESS), logging.StreamHandler()
    handler.addFilter(lambda record: record.levelno == logging.INFO)
    logger.setLevel(logging.INFO)
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
