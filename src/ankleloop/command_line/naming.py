"""The option `--names`: subject, condition and repetition from the names of files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ankleloop.errors import DataError

HELP = (
    "Subject, condition, trial and session in the names of the files, without their suffix, such as "
    "'{subject}_{condition}' or '{subject}/{condition}-{trial}'."
)
names_option = click.option("--names", metavar="PATTERN", help=HELP)


def read_names(path: Path, names: str | None) -> dict[str, Any]:
    """Labels in the name of a file, by option; without a pattern none."""
    from ankleloop.recordings.labels import GROUPS, read_labels

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
