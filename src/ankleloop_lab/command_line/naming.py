"""Recordings of files by name, and the option `--names`: their labels from the names of the files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click

from ankleloop.errors import DataError
from ankleloop_lab.command_line.reading import (
    UnclearNamesError,
    map_trials,
    name_recordings,
    parse_reading,
)
from ankleloop_lab.recordings.settings import Recording, name_trials

HELP = (
    "Subject, condition, trial and session in the names of the files, without their suffix, such as "
    "'{subject}_{condition}' or '{subject}/{condition}-{trial}'."
)
names_option = click.option("--names", metavar="PATTERN", help=HELP)


def map_recordings(
    files: Iterable[Path], names: str | None, values: Mapping[str, Any], *, tolerant: bool = False
) -> dict[str, tuple[Recording, Path]]:
    """Recordings with their files, by name; a file that cannot be read is an error, or is left to its check."""
    named = name_recordings(files)
    shown: set[str] | None = set() if len(named) > 1 else None
    recordings = {}
    refused = 0
    for name, path in named.items():
        stated = {**values, **_read_names(path, names)}
        try:
            trials = map_trials(path, shown, **stated)
        except (DataError, UnclearNamesError) as error:
            refused += 1
            is_usage = isinstance(error, UnclearNamesError) and refused == len(named)
            if not tolerant or is_usage:
                raise
            trials = [parse_reading(path, **stated)]
        for trial, recording in name_trials(name, trials).items():
            recordings[trial] = (recording, path)
    return recordings


def _read_names(path: Path, names: str | None) -> dict[str, Any]:
    """Labels in the name of a file, by option; without a pattern none."""
    from ankleloop_lab.recordings.labels import GROUPS, read_labels

    if names is None:
        return {}
    try:
        labels = read_labels(path, names)
    except DataError as error:
        raise click.UsageError(f"--names: {error}") from None
    unknown = [label for label in labels if label not in GROUPS]
    if unknown:
        raise click.UsageError(
            f"--names: {unknown[0]!r} is no label of a recording; these are {', '.join(GROUPS)}."
        )
    return labels
