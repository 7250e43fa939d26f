"""How a command reads a file: its options, which the library declares, and what names and units of the file say."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin

import click

from ankleloop.studies.recording_settings import Recording

Command = TypeVar("Command", bound=Callable[..., Any])

GUESSED = ("position", "torque", "reference")
METAVARS = {  # by unit, or by name
    "Hz": "HZ",
    "s": "S",
    "variables": "NAME=VARIABLE,…",
    "cycle_onsets": "NAME|TIMES",
    **dict.fromkeys(("schedule", *GUESSED), "NAME"),
}
OTHER_DEFAULTS = {
    "position_unit": "as the file states it, else rad",
    "sampling_rate": "that of the file",
    **dict.fromkeys(GUESSED, "by its name"),
}
MOST_CHARACTERS = 60  # of the name of a recording that is made of the name of a file


@dataclass(frozen=True)
class Reading:
    """How a file is read."""

    recording: Recording  # its variables, units, signs and segment
    # Where the position, the torque, the reference and the unit of the position come from, in words.
    reasons: Mapping[str, str]


def reading_options(command: Command) -> Command:
    """Decorator that gives a command an option for each field of a recording, as the library declares it."""
    command = click.option(
        "--no-reference", is_flag=True, help="Take no variable for the reference, whatever its name."
    )(command)
    for name, field in reversed(Recording.model_fields.items()):
        if name != "file":
            command = _make_option(name, field)(command)
    return command


def _make_option(name: str, field: Any) -> Callable[[Command], Command]:
    unit = Recording.unit(name)
    # What null is in YAML is to leave out an option.
    text = re.split(r"; (?:null|0) ", field.description)[0]
    text = text[0].upper() + text[1:] + (f" [{unit}]." if unit != "1" else ".")
    default = OTHER_DEFAULTS.get(name, field.get_default())
    if default not in (None, ""):
        text += f"  [default: {default}]"
    kinds = set(get_args(field.annotation) or (field.annotation,)) - {NoneType}
    parse: Any = click.STRING
    if get_origin(field.annotation) is Literal:
        parse = click.Choice(get_args(field.annotation))
    elif kinds <= {int, float}:
        parse = click.FLOAT if float in kinds else click.INT
    metavar = METAVARS.get(name) or METAVARS.get(unit)
    return click.option(f"--{name.replace('_', '-')}", name, type=parse, metavar=metavar, help=text)


def map_file(path: Path, *, no_reference: bool = False, **values: Any) -> Reading:
    """Map the variables of a file to channels; what the options leave out follows from names and units."""
    from ankleloop.trials.channels import AmbiguousNameError, find_position_unit, find_variable
    from ankleloop.trials.reading_process import list_variables  # here: --help does without numpy

    stated = {name: value for name, value in values.items() if value is not None}
    if no_reference and "reference" in stated:
        raise click.UsageError("--reference and --no-reference exclude each other.")
    reasons = {name: "by its option" for name in (*GUESSED, "position_unit") if name in stated}
    variables = list_variables(path, stated.get("case"))
    for channel in GUESSED:
        if channel in stated or (channel == "reference" and no_reference):
            continue
        taken = [name for role in GUESSED if (name := stated.get(role))]
        try:
            name = find_variable(channel, variables, source=path.name, taken=taken)
        except AmbiguousNameError as error:
            other = ", or --no-reference" if channel == "reference" else ""
            raise click.UsageError(f"{error} Option that decides: --{channel} NAME{other}.") from None
        if name is not None:
            stated[channel] = name
        reasons[channel] = "by its name" if name else "no variable has such a name"
    if "position_unit" not in stated:
        position = next((v for v in variables if v.name == stated["position"].lstrip("/")), None)
        unit = None if position is None else find_position_unit(position.name, position.unit)
        reasons["position_unit"] = "stated by the file" if unit else "assumed; --position-unit deg if it is in degrees"
        stated["position_unit"] = unit or "rad"
    return Reading(_parse_recording(path, stated), reasons)


def _parse_recording(path: Path, values: Mapping[str, Any]) -> Recording:
    try:
        return Recording.parse("the options", file=path.name, **values)
    except ValueError as error:
        text = re.sub(r"^the options: ", "", str(error))
        name = text.split(" ")[0]
        raise click.UsageError(f"--{name.replace('_', '-')}{text[len(name) :]}" if name in values else text) from None


def name_recordings(files: Iterable[Path]) -> dict[str, Path]:
    """Files by the names of their recordings, which differ in more than capitals."""
    named: dict[str, Path] = {}
    for file in files:
        name = name_recording(file)
        if name.lower() in {other.lower() for other in named}:
            name = name_recording(Path(f"{file.name.replace('.', '-')}.x"))
        if name in named:
            raise click.UsageError(f"{file}: another file has this name, too: rename it.")
        named[name] = file
    return named


def name_recording(path: Path) -> str:
    """Name of a recording, which is part of the names of its files, by the name of its file."""
    from ankleloop.trials.containers import find_suffix

    stem = path.name[: len(path.name) - len(find_suffix(path) or path.suffix)]
    name = re.sub(r"[^A-Za-z0-9_.-]+", "-", stem)
    name = re.sub(r"^[^A-Za-z0-9]+", "", name)[:MOST_CHARACTERS].rstrip("-_.")
    return name or "recording"
