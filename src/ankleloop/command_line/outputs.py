"""Files that a command writes: those that exist are refused before anything is computed, with the option that helps."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click


def check_outputs(paths: Iterable[Path], remedy: str, *, overwrite: bool, inputs: Iterable[Path] = ()) -> None:
    """Refuse files that cannot be written, or that exist and are not to be replaced."""
    from ankleloop.errors import DataError
    from ankleloop.trials.files import check_output, holds_content

    inputs = [*inputs]
    for path in paths:
        try:
            check_output(path, overwrite=True, inputs=inputs)
        except DataError as error:
            raise click.UsageError(str(error)) from None
        if not overwrite and holds_content(path):
            raise click.UsageError(f"{path}: the file exists already. {remedy}")
