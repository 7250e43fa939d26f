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
# Words of the library in messages that are options here, with the value that the message states.
OPTION_WORDS = re.compile(
    r"\b(?P<name>sampling_rate|position_unit|position_sign|torque_sign)\b(?! out| is stated)"
    r"(?:(?:=|: )'?(?P<value>-?\w+))?|\b(?P<flag>drift|overwrite)(?:=|: )(?P<number>\w+)"
    r"|\b(?P<variables>variables)(?= of read_trial)|\((?P<part>start, stop)\)"
)
# Values that only the user knows.
UNKNOWN = {"sampling_rate": "HZ", "position_unit": "UNIT", "variables": "NAME=VARIABLE", "start": "S", "stop": "S"}


def echo(text: str = "", *, err: bool = False, nl: bool = True) -> None:
    """Print a text, with its colours on a terminal only, and not if the variable NO_COLOR is set."""
    click.echo(text, err=err, nl=nl, color=False if os.environ.get("NO_COLOR") else None)


def show_verdict(verdict: str, name: str, text: str) -> None:
    """Show a finding, with the colour of its verdict."""
    echo(f"{click.style(f'{verdict:>8}', fg=COLOURS[verdict])}  {name}: {text}")


def show_error(text: str, words: Sequence[str] = ()) -> None:
    """Show why a command of some words ends, and the command that its message asks for."""
    echo(f"{click.style('error', fg='red', bold=True)}: {text}", err=True)
    show_next(*correct_command(text, words))


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Show a warning of the library, as `warnings.showwarning` does; those of other kinds concern programmers."""
    if issubclass(category, UserWarning):
        echo(f"{click.style('warning', fg='yellow')}: {message}", err=True)


def show_next(*steps: str) -> None:
    """Show what to do next."""
    for step in steps:
        echo(f"{click.style('next', fg='cyan')}: {step}", err=True)


def correct_command(text: str, words: Sequence[str]) -> list[str]:
    """The command of some words with the options that a message of the library is about; none if it is about none."""
    options: dict[str, str] = {}
    for match in OPTION_WORDS.finditer(text):
        groups = match.groupdict()
        for name in (groups["part"] or groups["name"] or groups["flag"] or groups["variables"]).split(", "):
            stated = groups["value"] or groups["number"]
            options[name] = stated or options.get(name) or UNKNOWN.get(name, "-1")
    if words and words[-2:] == ["--torque-sign", "-1"] and options.get("torque_sign") == "-1":
        options["torque_sign"] = "1"
    command = ["ankleloop", *words]
    for name, value in options.items():
        command += [f"--{name.replace('_', '-')}", *([value] if name != "overwrite" else [])]
    return [shlex.join(command)] if options else []


@contextmanager
def show_progress() -> Iterator[None]:
    """Show which method is being fitted while the block runs, also in processes that it starts."""
    logger, handler = logging.getLogger(PROGRESS), logging.StreamHandler()
    handler.addFilter(lambda record: record.levelno == logging.INFO)
    level, logger.level, logger.propagate = logger.level, logging.INFO, False
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.level, logger.propagate = level, True


def format_table(rows: list[list[Any]]) -> str:
    """Lines of aligned cells."""
    texts = [[str(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in texts)
    return "\n".join(line.rstrip() for line in lines)
