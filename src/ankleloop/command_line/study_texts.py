"""Texts of configurations, with a remark behind each value."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

import yaml

from ankleloop.command_line.reading import Reading, name_recording
from ankleloop.recordings.validity import usual_methods
from ankleloop.simulation.settings import DWELLS, SimulationSettings
from ankleloop.studies.recording_settings import Recording

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.recordings.checks import Check

ALWAYS = ("file", "position", "torque", "reference", "position_unit", "sampling_rate", "torque_sign")
DURATION = 20.0  # s of each trial of a sweep
FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)  # of the default, for the values of a sweep
TABLES = {"stiffness_table": "stiffness", "viscosity_table": "viscosity", "gain_table": "reflex_gain"}  # and means
VARIATIONS = ("_variation", "_table")  # endings of settings of how K, B and G vary
REMARK, WIDTH = 40, 120  # columns where remarks begin, if there is room, and where lines end
# The only study of a file has the name of the file, so that no other study has its results.
STUDY = """\
# {kind}, written by `ankleloop study`. Look through it, then run, in the folder of the repository of
# ankleloop:
#   snakemake --cores 2 --configfile {file}
# The results begin at results/reports/{name}.html. config/README.md describes every key.
run: [{name}]
article: []
studies:
  {name}:
"""
RECORDINGS = """\
    kind: recordings
    notebook: recordings
    title: Recordings
    folder: {folder}
    files:
{files}
    # Every method that is valid for a recording is fitted; the others are skipped, with the reason. Options
    # under select are chosen within the first half of a recording.
    methods:
{methods}
"""
SWEEP = """\
    kind: simulation
    notebook: sweep
    title: {title}
    trials: 5                             # simulated trials at each point
    seed: 1                               # another seed gives other trials
    keep: scores                          # everything also keeps trials and estimates
    # All combinations of these values are points. The values are a proposal.
    points:
{points}
    # Settings of every trial; those that are commented out have their defaults.
    {simulation}
{settings}
    methods:
      riv: {{label: Refined instrumental variables, method: riv}}
      pr-moesp: {{label: PR-MOESP, method: pr-moesp}}
"""


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
    lines = []
    for name, file in files.items():
        lines += [f"      {dump(name)}:", *_describe_file(file)]
    methods = []
    for key, method in _choose_methods(files.values()).items():
        methods.append(f"      {key}:")
        methods += [f"        {name}: {dump(value)}" for name, value in method.items() if value]
    return _begin("A study of recordings", new) + RECORDINGS.format(
        folder=dump(str(folder).replace("$", "$$")), files="\n".join(lines), methods="\n".join(methods)
    )


def _begin(kind: str, new: Path) -> str:
    return STUDY.format(kind=kind, file=new.name, name=dump(name_recording(new).replace(".", "-")))


def _describe_file(file: RecordedFile) -> list[str]:
    recording, reasons = file.reading.recording, file.reading.reasons
    values = {**dict.fromkeys(ALWAYS), **recording.model_dump(), "file": file.path}
    remarks = {name: _describe_field(Recording, name) for name in values} | {**reasons, "file": ""}
    remarks["position_unit"] = remarks["position_unit"].replace("--position-unit ", "")
    remarks["sampling_rate"] = "in Hz; null takes it from the file"
    if file.trial is not None and recording.sampling_rate is None:
        remarks["sampling_rate"] = f"null takes it from the file, {file.trial.attrs['sampling_rate']:g} Hz"
    if file.is_turned:
        values["torque_sign"] = -1
        remarks["torque_sign"] = "as the file has it, the torque does not oppose stretch: K would be negative"
    lines = []
    for name, value in values.items():
        is_default = value == Recording.model_fields[name].get_default()
        lines += _entry(name, value, remarks[name], indent=8, commented=is_default and name not in ALWAYS)
    for finding in file.check.findings:
        if finding.verdict != "ok" and not (file.is_turned and finding.name == "sign of the torque"):
            text = f"{finding.verdict}, {finding.name}: {' '.join(finding.text.split())}"
            lines += textwrap.wrap(text, WIDTH, initial_indent=" " * 8 + "# ", subsequent_indent=" " * 8 + "#   ")
    return lines


def _choose_methods(files: Iterable[RecordedFile]) -> dict[str, dict[str, Any]]:
    """Methods for recordings with a reference, for those without, or both where there are both."""
    recordings = [file.reading.recording for file in files]
    kinds = {recording.reference is not None for recording in recordings}
    changing = any(recording.changes for recording in recordings)
    methods = usual_methods(reference=True in kinds, changing=changing)
    if len(kinds) > 1:
        for key, method in usual_methods(reference=False, changing=changing).items():
            if method != methods[key]:
                methods[f"{key}-no-reference"] = {**method, "label": f"{method['label']} (no reference)"}
    return methods


def sweep_text(new: Path, varied: Sequence[str]) -> str:
    """Configuration of a sweep."""
    settings: list[str] = []
    fixed: dict[str, Any] = {"duration": DURATION}
    if any(name.endswith(VARIATIONS) for name in varied):  # else there is nothing with which K, B and G could vary
        fixed["variation"] = "cycle"
    remarks = {name: _describe_field(SimulationSettings, name) for name in SimulationSettings.model_fields}
    points = [line for name in varied for line in _entry(name, _propose_values(name), remarks[name])]
    for name, default in SimulationSettings.defaults().items():
        if name not in varied:
            settings += _entry(name, fixed.get(name, default), remarks[name], commented=name not in fixed)
    return _begin("A sweep", new) + SWEEP.format(
        title=dump("Sweep over " + " and ".join(varied).replace("_", " ")),
        points="\n".join(points),
        simulation="simulation: {}" if fixed.keys() <= set(varied) else "simulation:",
        settings="\n".join(settings),
    )


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
    if name == "dwell_weights":
        return [None, ", ".join(f"{weight:g}" for weight in DWELLS)]
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


def _entry(name: str, value: Any, remark: str, *, indent: int = 6, commented: bool = False) -> list[str]:
    """Line of a key with a remark behind it, or above it where it is long."""
    space = " " * indent
    line = f"{space}{'# ' * commented}{name}: {dump(value)}"
    whole = f"{line.ljust(REMARK)}  # {remark}" if remark else line
    if len(whole) <= WIDTH:
        return [whole]
    return [*textwrap.wrap(remark, WIDTH, initial_indent=f"{space}# ", subsequent_indent=f"{space}# "), line]


def dump(value: Any) -> str:
    """A value in YAML, on one line."""
    flow = yaml.safe_dump([value], default_flow_style=True, allow_unicode=True, width=float("inf"), sort_keys=False)
    return flow.strip()[1:-1]
