"""`ankleloop study`: a commented configuration for the user's own recordings, or for a sweep."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ankleloop.command_line.check import check_file, show_reading
from ankleloop.command_line.outputs import check_outputs
from ankleloop.command_line.reading import map_file, name_recordings, reading_options
from ankleloop.command_line.terminal import echo, show_next

EPILOG = """\b
Examples:
  ankleloop study my-recordings.yaml S1.mat S2.mat
  ankleloop study my-recordings.yaml data/*.csv --position-unit deg --subject S1
  ankleloop study my-sweep.yaml --sweep reflex_gain --sweep voluntary

\b
Then look through the file, and run it in the folder of the repository:
  snakemake --cores 2 --configfile my-recordings.yaml

Exit status: 0 done; 1 a file cannot be read; 2 wrong usage.
"""


@click.command(epilog=EPILOG)
@click.argument("new", metavar="NEW.yaml", type=click.Path(dir_okay=False, path_type=Path))
@click.argument("files", nargs=-1, metavar="[FILE]...", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--sweep", "varied", multiple=True, metavar="SETTING", help="Setting of the simulation that varies.")
@click.option("--overwrite", is_flag=True, help="Replace the file NEW.yaml.")
@reading_options
def study(new: Path, files: tuple[Path, ...], varied: tuple[str, ...], overwrite: bool, **values: Any) -> int:
    """Write a commented configuration of a study, for the workflow.

    With FILEs it is a study of these recordings: each file is read and checked, and the configuration has its names,
    units and signs, with a remark where they follow from the file. With --sweep it is a sweep over settings of the
    simulation. Options for reading concern all files.
    """
    if bool(files) == bool(varied):
        raise click.UsageError("name either the files of recordings, or settings by --sweep.")
    if new.suffix not in (".yaml", ".yml"):
        raise click.UsageError(f"{new}: the name of a configuration ends in .yaml.")
    check_outputs(
        new.parent, [new.name], "Write to another name; --overwrite replaces it.", overwrite=overwrite, inputs=files
    )
    text = _describe_recordings(new, files, values) if files else _describe_sweep(new, varied)
    _write(new, text, files, overwrite=overwrite)
    echo(f"\n{new} is written.")
    show_next(
        f"look through {new}, then, in the folder of the repository: "
        + shlex.join(["snakemake", "--cores", "2", "--configfile", str(new.absolute())])
    )
    return 0


def _describe_recordings(new: Path, files: Sequence[Path], values: dict[str, Any]) -> str:
    """Text of a study of recordings, each of which is read and checked."""
    from ankleloop.command_line.study_texts import RecordedFile, recordings_text

    folder = Path(os.path.commonpath([file.absolute().parent for file in files]))
    recorded: dict[str, RecordedFile] = {}
    for name, file in name_recordings(files).items():
        reading = map_file(file, **values)
        trial, check = check_file(file, reading)
        show_reading(file, reading, trial)
        relative = file.absolute().relative_to(folder).as_posix()
        is_turned = values.get("torque_sign") is None and any(
            finding.name == "sign of the torque" and finding.verdict == "refused" for finding in check.findings
        )
        if is_turned:
            echo("  torque_sign is -1 in the configuration: as the file has it, the torque does not oppose stretch.")
        recorded[name] = RecordedFile(relative, reading, trial, check, is_turned=is_turned)
    return recordings_text(new, folder, recorded)


def _describe_sweep(new: Path, varied: Sequence[str]) -> str:
    from ankleloop.command_line.study_texts import sweep_text
    from ankleloop.options import suggest_name
    from ankleloop.simulation.settings import SimulationSettings

    for name in varied:
        if name not in SimulationSettings.model_fields:
            known = ", ".join(SimulationSettings.model_fields)
            close = suggest_name(name, SimulationSettings.model_fields)
            raise click.UsageError(f"--sweep: there is no setting {name!r}{close}; there are {known}.")
    return sweep_text(new, list(dict.fromkeys(varied)))


def _write(new: Path, text: str, files: Sequence[Path], *, overwrite: bool) -> None:
    """Write a configuration that the workflow accepts."""
    import yaml

    from ankleloop.studies.checking import ConfigError, check_config_file
    from ankleloop.studies.run_config import read_run
    from ankleloop.trials.files import atomic_file

    with atomic_file(new, overwrite=overwrite, inputs=files) as partial:
        partial.write_text(text, encoding="utf-8")
        try:
            check_config_file(partial)
            read_run(yaml.safe_load(text), [partial])
        except ConfigError as error:
            raise click.UsageError(str(error).replace(partial.name, new.name)) from None
