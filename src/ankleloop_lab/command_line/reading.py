"""How a command reads a file: its options, which the library declares, and what names and units of the file say."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
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
from ankleloop_lab.files.units import ChannelUnit
from ankleloop_lab.recordings.settings import Recording

Command = TypeVar("Command", bound=Callable[..., Any])

METAVARS = {"variables": "NAME=VARIABLE,…", "cycle_onsets": "NAME|TIMES"}
METAVARS |= dict.fromkeys(("position_unit", "torque_unit", "reference_unit"), "UNIT|NUMBER")
METAVARS["apparatus"] = "FILE"
METAVARS |= dict.fromkeys(("schedule", "time", *CHANNELS), "NAME")
DEFAULTS = {"position_unit": "as the file states it, else rad", "sampling_rate": "that of the file"}
DEFAULTS["torque_unit"] = "as the file states it, else N·m"
DEFAULTS["reference_unit"] = "as the file states it, else that of the position"
DEFAULTS |= dict.fromkeys(CHANNELS, "by its name")
FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
MOST_CHARACTERS = 60  # of the name of a recording that is made of the name of a file


class UnclearNamesError(click.UsageError):
    """Names in a file leave a choice, which an option decides."""


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
        style: dict[str, Any] = {"type": parse, "metavar": metavar}
        if kinds == {bool}:
            style = {"is_flag": True, "default": None}
        command = click.option(name_option(name), name, help=text, **style)(command)
    return command


def list_choices(field: FieldInfo) -> list[Any]:
    """Values of an option that has a list of them."""
    kinds = (field.annotation, *get_args(field.annotation))
    return [value for kind in kinds if get_origin(kind) is Literal for value in get_args(kind)]


def map_trials(path: Path, shown: set[str] | None = None, **values: Any) -> list[Recording]:
    """Map the variables of each trial of a file to channels, and show it; most files have one."""
    return list_trials(path, map_file(path, shown, **values))


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


def map_file(path: Path, shown: set[str] | None = None, **values: Any) -> Recording:
    """Map the variables of a file to channels, and show it; what the options leave out follows from names and units.

    Of several files that are read alike one is shown: `shown` has how others are read.
    """
    options = parse_reading(path, **values)
    variables = _find_variables(path, options)
    channels = {role: variable.name for role, variable in variables.items() if role in CHANNELS}
    mapping = {"reference": NONE} | channels | options.channels
    units: Mapping[str, ChannelUnit] = {}
    with suppress(DataError):  # which its reading shows
        units = options.find_units(variables, source=path.name)
    position_unit = options.position_unit
    if position_unit is None and "position" in units:
        position_unit = units["position"].name
    recording = options.model_copy(update={**mapping, "position_unit": position_unit})
    signs = {"position": f", sign {recording.position_sign:+d}"}
    signs["torque"] = f", sign {recording.torque_sign:+d}"
    lines = []
    for role in filter(mapping.__contains__, CHANNELS):
        is_assumed = getattr(options, f"{role}_unit") is None
        unit = _describe_unit(units[role], is_assumed) if role in units else ""
        part = (
            _describe_part(mapping[role], variables.get(role)) if shown is None else mapping[role]
        )
        lines.append(f"  {role:9} {part}{unit}{signs.get(role, '')}")
    text = "\n".join(lines)
    if shown is None or text not in shown:
        echo(f"{click.style(path.name, bold=True)}\n{text}")
    if shown is not None:
        shown.add(text)
    return recording


def _describe_unit(unit: ChannelUnit, is_assumed: bool) -> str:
    """Unit of a channel, with its factor where that is not 1, and where the unit is from."""
    remarks = []
    if unit.factor != 1.0 and not unit.name.endswith(f" {unit.usual}"):  # no number as it was given
        remarks.append(f"1 {unit.name} = {unit.factor:.6g} {unit.usual}")
    if unit.stated:
        remarks.insert(0, "stated by the file")
    elif is_assumed and unit.name == "rad":
        remarks.append("assumed: --position-unit deg if it is in degrees")
    return f", in {unit.name}" + (f" ({'; '.join(remarks)})" if remarks else "")


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
        raise UnclearNamesError(f"{error} Option that decides: {option}.") from None


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
