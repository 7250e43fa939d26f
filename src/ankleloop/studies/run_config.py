"""The configuration of a run, checked before its first job: all that it names, and the files of recordings."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ankleloop.studies.checking import ConfigError
from ankleloop.studies.config import Config
from ankleloop.studies.config_files import find_key
from ankleloop.studies.results import run_studies
from ankleloop.studies.study import RecordedStudy, SimulatedStudy, Study, read_studies
from ankleloop.studies.study_checks import check_uses


def read_run(
    config: Mapping[str, Any], paths: Sequence[str | os.PathLike[str]], command_line: Mapping[str, Any] | None = None
) -> tuple[Config, dict[str, Study]]:
    """Read the configuration of a run, and refuse what a job would refuse."""
    command_line = command_line or {}
    for key, value in command_line.items():
        if value is None:  # of an empty variable of the shell; no names would mean all studies
            raise ConfigError(f"--config: the key {key!r} has no value.")
    try:
        checked, studies = read_studies(config)
        for study in run_studies(checked, studies):
            if isinstance(study, RecordedStudy):
                study.check_files()
            elif isinstance(study, SimulatedStudy):
                check_uses(study)
    except ConfigError as error:
        overridden = bool(error.keys) and error.keys[0] in command_line
        place = "--config" if overridden else find_key(error.keys, [_shorten(path) for path in paths])
        raise ConfigError(f"{place}: {error}" if place else str(error), error.keys) from None
    return checked, studies


def describe_article(config: Config) -> str:
    """Sentence that says why a run does not make the ledger and the article; empty if it does, or none is wanted."""
    missing = [name for name in config.article if name not in config.run_names]
    if not missing:
        return ""
    return f"The ledger and the article are not made, because run leaves out studies of article: {', '.join(missing)}."


def _shorten(path: str | os.PathLike[str]) -> str:
    """A path below the working directory, relative to it."""
    absolute, here = Path(os.path.abspath(path)), Path.cwd()
    return str(absolute.relative_to(here)) if absolute.is_relative_to(here) else str(absolute)
