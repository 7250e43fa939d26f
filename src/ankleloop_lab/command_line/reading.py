"""How a command reads a file: its options, which the library declares, and what names and units of the file say."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin

import click
from pydantic.fields import FieldInfo

from ankleloop.errors import DataError
from ankleloop.trials.channels import CHANNELS
from ankleloop_lab.checking import cast_number
from ankleloop_lab.command_line.terminal import echo, name_option
from ankleloop_lab.files.channels import NONE
from ankleloop_lab.files.contents import Variable
from ankleloop_lab.files.reading_options import list_trials
from ankleloop_lab.files.reading_process import read_channels
from ankleloop_lab.files.units import POSITION_UNITS, TORQUE_UNITS, find_position_unit
from ankleloop_lab.recordings.settings import Recording

Command = TypeVar("Command", bound=Callable[..., Any])

METAVARS = {"variables": "NAME=VARIABLE,…", "cycle_onsets": "NAME|TIMES"}
METAVARS["position_unit"] = "|".join([*POSITION_UNITS, "RAD"])
METAVARS["torque_unit"] = "|".join([*TORQUE_UNITS, "NM"])
METAVARS["apparatus"] = "FILE"
METAVARS |= dict.fromkeys(("schedule", "time", *CHANNELS), "NAME")
DEFAULTS = {"position_unit": "as the file states it, else rad", "sampling_rate": "that of the file"}
DEFAULTS["torque_unit"] = "N·m"
DEFAULTS |= dict.fromkeys(CHANNELS, "by its name")
FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
MOST_CHARACTERS = 60  # of the name of a recording that is made of the name of a file


def reading_options(command: Command) -> Command:
    """Decorator that gives a command an option for each field of a recording, and one to take no reference."""
    help_text = "Take no variable for the reference, whatever its name."
    command = click.option("--no-reference", is_flag=True, help=help_text)(command)
    return add_options(command, [name for name in Recording.model_fields if name != "file"])


def add_options(command: Command, names: Sequence[str]) -> Command:
    """Give a command options for some fields of a recording, as the library declares them."""
    for name in reversed(names):
        field = Recording.model_fields[name]
        unit = Recording.unit(name)
        # What null is in YAML is to leave out an option.
        text = re.split(r"; (?:null|0)\b", str(field.description))[0]
        text = text[0].upper() + text[1:] + (f" [{unit}]." if unit != "1" else ".")
        default = DEFAULTS.get(name, field.get_default())
        if default not in (None, ""):
            text += f"  [default: {default}]"
        kinds = set(get_args(field.annotation) or (field.annotation,)) - {NoneType}
        choices = list_choices(field)
        parse: Any = click.STRING
        if name.endswith("_unit"):
            parse = cast_number  # or text
        elif choices:
            parse = click.Choice(choices)
        elif kinds <= {int, float}:
            parse = click.FLOAT if float in kinds else click.INT
        metavar = METAVARS.get(name) or (unit.upper() if unit != "1" else None)
        option = click.option(name_option(name), name, type=parse, metavar=metavar, help=text)
        command = option(command)
    return command


def list_choices(field: FieldInfo) -> list[Any]:
    """Values of an option that has a list of them."""
    kinds = (field.annotation, *get_args(field.annotation))
    return [value for kind in kinds if get_origin(kind) is Literal for value in get_args(kind)]


def map_trials(path: Path, **values: Any) -> list[Recording]:
    """Map the variables of each trial of a file to channels, and show it; most files have one."""
    return list_trials(path, map_file(path, **values))


def parse_reading(path: Path, *, no_reference: bool = False, **values: Any) -> Recording:
    """How a file is read by the options of a command, without what its names and units say."""
    stated = {name: value for name, value in values.items() if value is not None}
    if no_reference:
        if "reference" in stated:
            raise click.UsageError("--reference and --no-reference exclude each other.")
        stated["reference"] = NONE
    try:
        return Recording.parse("the options", file=path.name, **stated)
    except ValueError as error:
        raise click.UsageError(str(error)) from None


def map_file(path: Path, **values: Any) -> Recording:
    """Map the variables of a file to channels, and show it; what the options leave out follows from names and units."""
    options = parse_reading(path, **values)
    variables = _find_variables(path, options)
    mapping = {"reference": NONE}
    mapping |= {role: variable.name for role, variable in variables.items() if role in CHANNELS}
    mapping |= options.channels
    unit = options.position_unit
    remark = ""
    if unit is None:
        position = variables.get("position")
        unit = find_position_unit(position.name, position.unit) if position else None
        remark = " (stated by the file)"
        if unit is None:
            unit = "rad"
            remark = " (assumed: --position-unit deg if it is in degrees)"
    recording = options.model_copy(update={**mapping, "position_unit": unit})
    unit_text = f"{_show_unit(recording.position_unit, 'rad')}{remark}"
    echo(click.style(path.name, bold=True))
    names = {role: _describe_part(name, variables.get(role)) for role, name in mapping.items()}
    torque_unit = _show_unit(recording.torque_unit, "N·m")
    echo(f"  position  {names['position']}, in {unit_text}, sign {recording.position_sign:+d}")
    echo(f"  torque    {names['torque']}, in {torque_unit}, sign {recording.torque_sign:+d}")
    echo(f"  reference {names['reference']}")
    return recording


def _show_unit(unit: str | float | None, usual: str) -> str:
    """A unit that is stated by name or as a number of the usual one, or else the usual one."""
    return f"{unit:g} {usual}" if isinstance(unit, float) else unit or usual


def _describe_part(name: str, variable: Variable | None) -> str:
    """Name of a channel, and the first sample of a part of a variable, so that a neighbour is noticed."""
    if variable is None or not variable.read().size:
        return name
    several = f"{variable.count} trials, the first one " if variable.count else ""
    return f"{name} ({several}begins with {variable.read()[0]:.4g})"


def _find_variables(path: Path, options: Recording) -> dict[str, Variable]:
    """Variables of a file by role; where their names leave a choice, an option decides."""
    try:
        return read_channels(path, options.case, "find", variables=options.names)
    except DataError as error:
        unknown = error.remedy.keys() & CHANNELS
        if not unknown:
            raise
        option = f"--{unknown.pop()} NAME"
        if "reference" in error.remedy:
            option += ", or --no-reference"
        raise click.UsageError(f"{error} Option that decides: {option}.") from None


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
    stem = Path(path.name.removesuffix(".gz")).stem
    return (
        re.sub(r"[^A-Za-z0-9_.-]+", "-", stem).lstrip("-_.")[:MOST_CHARACTERS].rstrip("-_.")
        or "recording"
    )
