"""Texts of configurations, with a remark behind each value."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from ankleloop.command_line.reading import Reading, name_recording
from ankleloop.recordings.usual_methods import usual_methods
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.recording_settings import Recording

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.recordings.checks import Check

PLAIN = re.compile(r"[A-Za-z][\w ./()-]*[\w)]", re.ASCII)  # texts that YAML reads as they are, but for its own words
WORDS = ("null", "true", "false", "yes", "no", "on", "off", "y", "n", "nan", "inf")
CHANNELS = ("position", "torque", "reference", "position_unit")
DURATION = 20.0  # s of each trial of a sweep
FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)  # of the default, for the values of a sweep
TABLES = {"stiffness_table": "stiffness", "viscosity_table": "viscosity", "gain_table": "reflex_gain"}  # and means
VARIATIONS = ("_variation", "_table")  # endings of settings of how K, B and G vary
REMARK, WIDTH = 40, 120  # columns where remarks begin, if there is room, and where lines end


@dataclass(frozen=True)
class RecordedFile:
    """A file of a study."""

    path: str  # its path below the folder of the study
    reading: Reading  # how it is read
    trial: xr.Dataset | None  # what it holds; None if it cannot be used
    check: Check  # its check
    is_turned: bool = False  # whether the check shows that its torque has the other sign


def recordings_text(new: Path, folder: Path, files: Mapping[str, RecordedFile]) -> str:
    """Configuration of a study of recordings."""
    lines = [
        "# A study of recordings, written by `ankleloop study`. Look through it, then run, in the folder of the",
        "# repository of ankleloop:",
        f"#   snakemake --cores 2 --configfile {new.name}",
        *_describe_study(new),
        "    kind: recordings",
        "    notebook: recordings",
        "    title: Recordings",
        f"    folder: {_value(str(folder).replace('$', '$$'))}",
        "    files:",
    ]
    for name, file in files.items():
        lines += [f"      {_value(name)}:", *_describe_file(file)]
    lines += [
        "    # Every method that is valid for a recording is fitted; the others are skipped, with the reason. Options",
        "    # under select are chosen within the first half of a recording.",
        "    methods:",
        *_describe_methods(_choose_methods(files)),
    ]
    return "\n".join(lines) + "\n"


def _describe_study(new: Path) -> list[str]:
    """Begin the only study of a file; it has the name of the file, so that no other study has its results."""
    name = name_recording(new).replace(".", "-")
    return [
        f"# The results begin at results/reports/{name}.html. config/README.md describes every key.",
        f"run: [{_value(name)}]",
        "article: []",
        "studies:",
        f"  {_value(name)}:",
    ]


def _describe_file(file: RecordedFile) -> list[str]:
    recording, reasons = file.reading.recording, file.reading.reasons
    remarks = {name: _describe_field(Recording, name) for name in Recording.model_fields} | dict(reasons)
    remarks["position_unit"] = remarks["position_unit"].replace("--position-unit ", "")
    remarks |= {"file": "", "sampling_rate": "in Hz; null takes it from the file"}
    if file.trial is not None and recording.sampling_rate is None:
        remarks["sampling_rate"] = f"null takes it from the file, {file.trial.attrs['sampling_rate']:g} Hz"
    values = recording.model_dump() | {"file": file.path}
    if file.is_turned:
        values["torque_sign"] = -1
        remarks["torque_sign"] = "as the file has it, the torque does not oppose stretch: K would be negative"
    always = ("file", *CHANNELS, "sampling_rate", "torque_sign")
    lines = []
    for name in (*always, *(name for name in values if name not in always)):
        is_default = values[name] == Recording.model_fields[name].get_default()
        lines += _entry(name, values[name], remarks[name], commented=is_default and name not in always)
    for finding in file.check.findings:
        if finding.verdict != "ok" and not (file.is_turned and finding.name == "sign of the torque"):
            text = f"{finding.verdict}, {finding.name}: {' '.join(finding.text.split())}"
            lines += textwrap.wrap(text, WIDTH, initial_indent=" " * 8 + "# ", subsequent_indent=" " * 8 + "#   ")
    return lines


def _choose_methods(files: Mapping[str, RecordedFile]) -> dict[str, dict[str, Any]]:
    """Methods for recordings with a reference, for those without, or both where there are both."""
    kinds = sorted({file.reading.recording.reference is not None for file in files.values()}, reverse=True)
    changing = any(file.reading.recording.changes for file in files.values())
    methods = usual_methods(reference=kinds[0], changing=changing)
    if len(kinds) > 1:
        for key, method in usual_methods(reference=False, changing=changing).items():
            if method != methods[key]:
                methods[f"{key}-no-reference"] = {**method, "label": f"{method['label']} (no reference)"}
    return methods


def _describe_methods(methods: Mapping[str, Mapping[str, Any]]) -> list[str]:
    lines = []
    for key, method in methods.items():
        lines.append(f"      {key}:")
        lines += [f"        {name}: {_value(value)}" for name, value in method.items() if value]
    return lines


def sweep_text(new: Path, varied: Sequence[str]) -> str:
    """Configuration of a sweep."""
    lines = [
        "# A sweep, written by `ankleloop study`. Look through it, then run, in the folder of the repository of",
        "# ankleloop:",
        f"#   snakemake --cores 2 --configfile {new.name}",
        *_describe_study(new),
        "    kind: simulation",
        "    notebook: sweep",
        f"    title: {_value('Sweep over ' + ' and '.join(varied).replace('_', ' '))}",
        *_entry("trials", 5, "simulated trials at each point", indent=4),
        *_entry("seed", 1, "another seed gives other trials", indent=4),
        *_entry("keep", "scores", "everything also keeps trials and estimates", indent=4),
        "    # All combinations of these values are points. The values are a proposal.",
        "    points:",
        *(line for name in varied for line in _entry(name, _propose_values(name), _describe_setting(name), indent=6)),
        "    # Settings of every trial; those that are commented out have their defaults.",
        "    simulation: {}" if "duration" in varied else "    simulation:",
    ]
    fixed: dict[str, Any] = {"duration": DURATION}
    if any(name.endswith(VARIATIONS) for name in varied):  # else there is nothing with which K, B and G could vary
        fixed["variation"] = "cycle"
    for name, field in SimulationSettings.model_fields.items():
        if name not in varied:
            value = fixed.get(name, field.get_default())
            lines += _entry(name, value, _describe_setting(name), indent=6, commented=name not in fixed)
    lines += [
        "    methods:",
        "      riv: {label: Refined instrumental variables, method: riv}",
        "      pr-moesp: {label: PR-MOESP, method: pr-moesp}",
    ]
    return "\n".join(lines) + "\n"


def _describe_setting(name: str) -> str:
    return _describe_field(SimulationSettings, name)


def _propose_values(name: str) -> Any:
    """Values of a setting about its default."""
    field, limits = SimulationSettings.model_fields[name], SimulationSettings.limits(name)
    default = field.get_default()
    kinds = (field.annotation, *get_args(field.annotation))  # those of a choice that may be null are within a union
    choices = [value for kind in kinds if get_origin(kind) is Literal for value in get_args(kind)]
    if choices:
        return choices
    if name in TABLES:
        mean = SimulationSettings.model_fields[TABLES[name]].get_default()
        return [", ".join(f"{factor * mean:g}" for factor in factors) for factors in ((0.8, 1.2), (0.5, 1.5))]
    if isinstance(default, bool):
        return [True, False]
    if not default:
        return [default, 100.0 if default is None else 0.1]
    # Rates have to divide one another.
    factors = FACTORS[::2] if SimulationSettings.unit(name) == "Hz" else FACTORS
    values = [float(f"{factor * default:.3g}") for factor in factors]
    return [value for value in values if limits.get("ge", value) <= value <= limits.get("le", value)]


def _describe_field(model: Any, name: str) -> str:
    """Description and unit of a field, as the library declares them."""
    unit, text = model.unit(name), " ".join(str(model.model_fields[name].description).split())
    return f"{text} [{unit}]" if unit != "1" else text


def _entry(name: str, value: Any, remark: str = "", *, indent: int = 8, commented: bool = False) -> list[str]:
    """Line of a key with a remark behind it, or above it where it is long."""
    space = " " * indent
    line = f"{space}{'# ' * commented}{name}: {_value(value)}"
    if not remark:
        return [line]
    whole = f"{line.ljust(REMARK)}  # {remark}"
    if len(whole) <= WIDTH:
        return [whole]
    return [*textwrap.wrap(remark, WIDTH, initial_indent=f"{space}# ", subsequent_indent=f"{space}# "), line]


def _value(value: Any) -> str:
    """A value in YAML, on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, str) and PLAIN.fullmatch(value) and value.lower() not in WORDS:
        return value
    if isinstance(value, float):
        mantissa, exponent, power = repr(value).partition("e")
        return f"{mantissa if '.' in mantissa else mantissa + '.0'}e{int(power):+d}" if exponent else repr(value)
    return json.dumps(value, ensure_ascii=False)
