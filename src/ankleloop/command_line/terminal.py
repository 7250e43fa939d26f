"""What a command shows: results on the standard output, messages and progress on the standard error."""

from __future__ import annotations

import logging
import os
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import click

COLOURS = {"ok": "green", "warning": "yellow", "refused": "red"}
PROGRESS = "ankleloop.recordings.analysis"  # the logger that says which method is being fitted
# Words of the library in messages, that are options here.
OPTION_WORDS = re.compile(
    r"\b(sampling_rate|position_unit|position_sign|torque_sign)\b|\b(drift|overwrite)(?=[:=])"
    r"|\b(variables)(?= of read_trial)|\((start), (stop)\)"
)


def echo(text: str = "", *, err: bool = False, nl: bool = True) -> None:
    """Print a text, with its colours on a terminal only, and not if the variable NO_COLOR is set."""
    click.echo(text, err=err, nl=nl, color=False if os.environ.get("NO_COLOR") else None)


def show_verdict(verdict: str, name: str, text: str) -> None:
    """Show a finding, with the colour of its verdict."""
    echo(f"{click.style(f'{verdict:>8}', fg=COLOURS[verdict])}  {name}: {text}")


def show_error(text: str) -> None:
    """Show why a command ends, and the options that its message is about."""
    echo(f"{click.style('error', fg='red', bold=True)}: {text}", err=True)
    show_next(*name_options(text))


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Show a warning of the library, as `warnings.showwarning` does; those of other kinds concern programmers."""
    if issubclass(category, UserWarning):
        echo(f"{click.style('warning', fg='yellow')}: {message}", err=True)


def show_next(*steps: str) -> None:
    """Show what to do next."""
    for step in steps:
        echo(f"{click.style('next', fg='cyan')}: {step}", err=True)


def name_options(text: str) -> list[str]:
    """Options of the command line that a message of the library is about."""
    words = dict.fromkeys(word for groups in OPTION_WORDS.findall(text) for word in groups if word)
    options = ", ".join("--" + word.replace("_", "-") for word in words)
    return [f"on the command line this is {options}."] if options else []


@contextmanager
def show_progress() -> Iterator[None]:
    """Show which method is being fitted while the block runs, also in processes that it starts.

    On a terminal this is one line, which is gone at the end.
    """
    logger, handler = logging.getLogger(PROGRESS), _Progress(logging.INFO)
    state = logger.level, logger.propagate
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(state[0])
        logger.propagate = state[1]
        handler.show("")


class _Progress(logging.Handler):
    """Shows messages on the standard error, on a terminal each in place of the one before."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self._start = time.monotonic()

    def emit(self, record: logging.LogRecord) -> None:
        """Show a message about progress."""
        if record.levelno == logging.INFO:
            self.show(f"{record.getMessage()} ({time.monotonic() - self._start:.0f} s)")

    def show(self, text: str) -> None:
        """Show a text; an empty one takes away the line."""
        if sys.stderr.isatty():
            echo(f"\r\x1b[K{text}", nl=False, err=True)
        elif text:
            echo(text, err=True)


def format_table(rows: list[list[Any]]) -> str:
    """Lines of aligned cells."""
    texts = [[str(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in texts)
    return "\n".join(line.rstrip() for line in lines)
