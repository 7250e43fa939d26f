"""`ankleloop study`: a configuration for the user's own recordings."""

from __future__ import annotations

import json
import os
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ankleloop_lab.command_line.check import check_file
from ankleloop_lab.command_line.naming import map_recordings, names_option
from ankleloop_lab.command_line.reading import FILE, name_recording, reading_options
from ankleloop_lab.command_line.terminal import (
    DATA,
    DONE,
    SOME,
    echo,
    join_words,
    refuse_existing,
    show_error,
    show_next,
)

Values = dict[str, Any]  # by name

ALWAYS = {"position", "torque", "reference", "position_unit", "sampling_rate", "torque_sign"}
HEADER = """\
# Written by `ankleloop study`. Look through it, then run it in the folder of the repository:
#   snakemake --cores 2 --configfile {file}
# The results begin at results/reports/{name}.html. config/README.md describes every key."""
EPILOG = """\b
Examples:
  ankleloop study my-recordings.yaml S1.mat S2.mat
  ankleloop study my-recordings.yaml data/*.csv --position-unit deg --names '{subject}_{condition}'
"""


@click.command(epilog=EPILOG)
@click.argument("new", metavar="NEW.yaml", type=click.Path(dir_okay=False, path_type=Path))
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=FILE)
@click.option("--overwrite", is_flag=True, help="Replace the file NEW.yaml.")
@names_option
@reading_options
def study(
    new: Path,
    files: tuple[Path, ...],
    overwrite: bool,
    names: str | None,
    **values: Any,
) -> int:
    """Write a configuration of a study of recordings, for the workflow.

    Each file is read and checked, and the configuration has its names, units and signs, and in comments what the check
    has found. Options for reading concern all files. A file that cannot be read is left out: then the exit status is 3,
    and 1 if none can be read.
    """
    import yaml

    from ankleloop.trials.files import atomic_file
    from ankleloop_lab.checking import ConfigError
    from ankleloop_workflow.config.run import read_run

    if new.suffix not in (".yaml", ".yml"):
        raise click.UsageError(f"{new}: the name of a configuration ends in .yaml.")
    if not overwrite:
        refuse_existing([new])
    # The only study of a file has the name of the file, so that no other study has its results.
    name = name_recording(new).replace(".", "-")
    if values.get("apparatus") is not None:  # the study may run in another folder
        values["apparatus"] = str(Path(values["apparatus"]).absolute())
    settings, remarks, left_out = _describe_recordings(files, names, values)
    if not settings["files"]:
        show_error(f"no file can be read: {' '.join(left_out)}")
        return DATA
    config = {"run": [name], "article": [], "studies": {name: settings}}
    try:
        read_run(config, [])
    except ConfigError as error:
        raise click.UsageError(str(error)) from None
    wrapper = textwrap.TextWrapper(120, initial_indent="# ", subsequent_indent="#   ")
    parts = [HEADER.format(file=new.name, name=name), *map(wrapper.fill, [*left_out, *remarks])]
    plain = json.loads(json.dumps(config))  # what stands twice is no alias then
    parts.append(yaml.safe_dump(plain, sort_keys=False, allow_unicode=True, width=120))
    with atomic_file(new, overwrite=overwrite) as partial:
        partial.write_text("\n".join(parts), encoding="utf-8")
    echo(f"\n{new} is written.")
    command = join_words(["snakemake", "--cores", "2", "--configfile", str(new.absolute())])
    show_next(f"look through {new}, then, in the folder of the repository: {command}")
    return SOME if left_out else DONE


def _describe_recordings(
    files: Sequence[Path], names: str | None, values: Values
) -> tuple[Values, list[str], list[str]]:
    """Settings of a study of recordings, each of which is read and checked, what was found, and what is left out."""
    from ankleloop_lab.recordings.validity import usual_methods

    folder = Path(os.path.commonpath([file.absolute().parent for file in files]))
    recordings = []
    described = {}
    remarks = []
    left_out = []
    for name, (recording, file) in map_recordings(files, names, values, tolerant=True).items():
        trial, check = check_file(file, recording)
        if trial is None:
            left_out.append(f"{name} is left out: {' '.join(check.reasons)}")
            echo(left_out[-1])
            continue
        if values.get("torque_sign") is None and "torque_sign" in check.remedy:
            recording = recording.model_copy(update={"torque_sign": -1})
            remark = f"{name}: torque_sign is -1: as the file has it, the torque does not oppose stretch."
            remarks.append(remark)
            echo(remark)
            _, check = check_file(file, recording)
        for finding in check.findings:
            if finding.verdict != "ok":
                remarks.append(f"{name}: {finding.verdict}, {finding.name}: {finding.text}")
        recordings.append(recording)
        described[name] = {
            "file": file.absolute().relative_to(folder).as_posix(),
            **recording.model_dump(mode="json", include=ALWAYS),
            **recording.model_dump(mode="json", exclude_defaults=True, exclude={"file"}),
        }
    if names is None:
        remarks += _suggest_labels(files)
    changing = any(recording.changes for recording in recordings)
    methods: Values = {}
    # Those with a reference first.
    kinds = {"reference" in recording.channels for recording in recordings}
    for has_reference in sorted(kinds, reverse=True):
        for key, method in usual_methods(reference=has_reference, changing=changing).items():
            stated = {name: value for name, value in method.items() if value}
            if methods.setdefault(key, stated) != stated:
                label = f"{method['label']} (no reference)"
                methods[f"{key}-no-reference"] = {**stated, "label": label}
    settings = {
        "kind": "recordings",
        "title": "Recordings",
        "folder": str(folder).replace("$", "$$"),
        **_share_defaults(described),
        "methods": methods,
    }
    return settings, remarks, left_out


def _share_defaults(described: dict[str, Values]) -> Values:
    """Recordings without what all have alike, which are defaults; of a single one nothing is."""
    first, *others = described.values() or [{}]
    shared = {
        key: value
        for key, value in first.items()
        if others and all(key in other and other[key] == value for other in others)
    }
    files = {
        name: {key: value for key, value in recording.items() if key not in shared}
        for name, recording in described.items()
    }
    return {"defaults": shared, "files": files} if shared else {"files": files}


def _suggest_labels(files: Sequence[Path]) -> list[str]:
    """What the names of the files suggest, and the option that takes it."""
    from ankleloop_lab.recordings.labels import read_labels, suggest_names

    names = suggest_names(files)
    if names is None:
        return []
    labels = [f"{file.name}: {read_labels(file, names)}" for file in files]
    return [f"The names suggest labels, which --names '{names}' would write:", *labels]
