"""Files that a command writes: those that exist are refused before anything is computed, with the option that helps."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click


def check_outputs(
    folder: Path, names: Iterable[str], remedy: str, *, overwrite: bool, inputs: Iterable[Path] = ()
) -> None:
    """Make a folder; refuse files in it that cannot be written, or that exist and are not to be replaced."""
    from ankleloop.errors import DataError
    from ankleloop.trials.files import check_output, holds_content

    inputs = [*inputs]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path in (folder / name for name in names if (folder / name).parent.is_dir()):
            check_output(path, overwrite=True, inputs=inputs)
            if not overwrite and holds_content(path):
                raise click.UsageError(f"{path}: the file exists already. {remedy}")
    except (DataError, OSError) as error:
        raise click.UsageError(f"{error} {remedy}") from None
