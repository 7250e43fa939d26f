"""Configurations of the workflow: files, studies, sweeps, recordings, and tables of points and of recordings."""

from pathlib import Path
from typing import Any

import yaml

from ankleloop_lab.checking import ConfigError
from ankleloop_lab.recordings.settings import Recording, read_recordings
from ankleloop_workflow.config.files import check_config_file
from ankleloop_workflow.config.run import read_run
from ankleloop_workflow.config.study import Study
from bad_inputs.bad_input import rows_of
from bad_inputs.inputs import missing, text_file

PLACE = "config → studies → s"
POINTS = f"{PLACE} → points"
STUDY = {"kind": "simulation", "seed": 1, "trials": 2, "methods": {"a": {"method": "pr-moesp"}}}
RECORDINGS = {"kind": "recordings", "folder": ".", "methods": {"a": {"method": "riv"}}, "files": {}}


def read_config(path: Path) -> dict[str, Study]:
    """Read a configuration, as the workflow does."""
    check_config_file(path)
    return read_run(yaml.safe_load(path.read_text(encoding="utf-8")), [path])[1]


def read_table(path: Path) -> dict[str, list[Recording]]:
    """Read a table of recordings, as the workflow does."""
    return read_recordings(str(path), {})


def text(content: str):
    """A configuration of this text."""
    return text_file("config.yaml", content)


def config(**keys: Any):
    """A configuration with one study `s`, and other keys beside it."""
    return text(yaml.safe_dump({"studies": {"s": STUDY}, **keys}, allow_unicode=True))


def line(key_and_value: str):
    """A configuration whose study ends in a line of YAML as it stands."""
    return text(f"{yaml.safe_dump({'studies': {'s': STUDY}})}    {key_and_value}\n")


def study(**keys: Any):
    """A configuration whose study has other keys."""
    return config(studies={"s": STUDY | keys})


def points(**values: Any):
    """A configuration whose study has these points."""
    return study(points=values)


def method(**keys: Any):
    """A configuration whose study has one method."""
    return study(methods={"a": {"method": "pr-moesp", **keys}})


def recordings(files=("a.mat",), **keys: Any):
    """A configuration of a study of recordings."""
    named = (
        files
        if isinstance(files, dict)
        else {f"S{k}": {"file": file} for k, file in enumerate(files)}
    )
    return config(studies={"s": RECORDINGS | {"files": named} | keys})


def recording_table(*lines: str):
    """A table of recordings."""
    return text_file("table.csv", "\n".join(lines) + "\n")


LOGARITHMIC = {"start": -1, "stop": 1, "count": 3, "scale": "logarithmic"}
DESIGN = {
    "design": "sobol",
    "count": 100,
    "seed": 1,
    "parameters": {"zeta": {"start": 0.5, "stop": 1.0}},
}
FIXED_AND_VARIED = study(
    points={"order": [2, 3]}, methods={"a": {"method": "pr-moesp", "options": {"order": 2}}}
)
FIXED_AND_SELECTED = method(options={"order": 2}, select={"order": [2, 3]})
CYCLES_AND_SCHEDULE = recordings(
    {"S1": {"file": "a.mat", "cycle_onsets": "phase", "schedule": "angle"}}
)
NO_SUCH_AXIS = study(points={"zeta": [0.5, 1.0]}, notebook="sweep", sweep={"axes": ["zetta"]})
CAPITALS = recordings({"S1": {"file": "a.mat"}, "s1": {"file": "b.mat"}})
MANY = points(
    **{name: list(range(1, 101)) for name in ("zeta", "delay", "stiffness", "inertia", "omega_n")}
)

row = rows_of(read_config, ConfigError)
table = rows_of(read_table, ConfigError)

ROWS = [
    # files and names
    row("a tab in place of spaces", text("studies:\n\ts: 1\n"), "config.yaml", "line 2"),
    row(
        "a key twice",
        text("studies:\n  s: {seed: 1, seed: 2}\n"),
        "config.yaml: the key 'seed' in line 2 stands in",
    ),
    row("there is no file", missing("config.yaml"), "config.yaml", "the file cannot be read"),
    row(
        "the number 012",
        line("trials_per_chunk: 012"),
        "config.yaml, line 9",
        "012 as 10",
        "quotes",
    ),
    row(
        "the name no without quotes",
        text("studies:\n  no: {}\n"),
        "line 2: YAML reads the key no as bool",
    ),
    row(
        "a name with a brace",
        config(studies={"{a}": STUDY}),
        "studies → {a}",
        "must consist of letters A-Z a-z",
    ),
    row("a misspelt study in run", config(run=["t"]), "run: there is no study 't'"),
    # studies and their methods
    row(
        "unknown key of a study",
        study(trails=3),
        f"{PLACE}: unknown key 'trails'",
        "did you mean 'trials'",
    ),
    row("2.5 trials", study(trials=2.5), f"{PLACE} → trials", "whole number", "got 2.5"),
    row("a figure behind the end", study(figure={"start": 100.0}), PLACE, "figure", "start", "100"),
    row(
        "unknown setting",
        study(simulation={"stifness": 1.0}),
        f"{PLACE} → simulation: unknown key 'stifness'",
    ),
    row(
        "unknown option",
        method(options={"blok_rows": 3}),
        "a → options: unknown key 'blok_rows'",
        "'block_rows'",
    ),
    row(
        "too few block rows",
        method(options={"order": 15}),
        "a → options",
        "must be larger than the order",
    ),
    row(
        "a rate that does not divide",
        method(options={"identification_rate": 70.0}),
        "methods → a",
        "70",
        "1000",
    ),
    row(
        "fixed and selected",
        FIXED_AND_SELECTED,
        "a: option 'order' is given, and to be selected as well",
    ),
    row(
        "Figure 4 of one point",
        study(notebook="figure4"),
        f"{PLACE} → notebook: figure4 needs one setting",
    ),
    row(
        "efficiency without a delay",
        study(notebook="efficiency"),
        "needs a method riv with the option delay: n",
    ),
    # points of a sweep
    row(
        "no list of values",
        points(zeta=1.0),
        f"{POINTS} → zeta: must be a list of values",
        "got 1.0",
    ),
    row(
        "a value that is listed twice",
        points(zeta=[1, 1.0]),
        f"{POINTS}: the point zeta=1.0 is listed twice",
    ),
    row(
        "a misspelt option",
        points(block_row=[12]),
        f"{POINTS}: 'block_row' is not a setting",
        "'block_rows'?",
    ),
    row("10,000,000,000 points", MANY, f"{POINTS}: 10,000,000,000 points are more than 100,000"),
    row(
        "fixed and varied",
        FIXED_AND_VARIED,
        "order: the method a has order under options or select as well",
    ),
    row(
        "few block rows at a point",
        points(order=[2, 3], block_rows=[3, 12]),
        "points → block_rows=3,order=3 → a: block_rows must be larger than the order (3), got 3",
    ),
    row(
        "logarithms of zero",
        points(voluntary=LOGARITHMIC),
        "voluntary: a logarithmic scale begins above 0, got",
    ),
    row(
        "an unknown design", study(points=DESIGN), "design: must be 'latin-hypercube'; got 'sobol'"
    ),
    row(
        "an axis that does not vary",
        NO_SUCH_AXIS,
        f"{PLACE} → sweep: axes",
        "(did you mean 'zeta'?)",
    ),
    # recordings
    row(
        "a recording without a file",
        recordings({"S1": {"torque": "t"}}),
        "files → S1: the key 'file' is missing",
    ),
    row(
        "cycles and a schedule",
        CYCLES_AND_SCHEDULE,
        "S1",
        "cycle_onsets and schedule exclude each other",
    ),
    row(
        "a variable that is not set",
        recordings(folder="${NO_SUCH}/x"),
        "NO_SUCH is not set",
        "export NO_SUCH=",
    ),
    row(
        "a folder that does not exist",
        recordings(folder="/no/such"),
        "line",
        "files exists",
        "/no/such/a.mat",
    ),
    row(
        "braces in a folder",
        recordings(folder="data{1}"),
        "Snakemake takes the braces of data{1}/a.mat for wildcards",
    ),
    row("names that differ in capitals", CAPITALS, "files: 'S1' and 's1' differ in capitals only"),
    table("no table of recordings", missing("table.csv"), "table.csv: the file cannot be read"),
    table(
        "semicolons",
        recording_table("file;subject", "a.mat;S1"),
        "line 1: columns have names of their own, with commas",
    ),
    table(
        "unknown column",
        recording_table("file,torqe_sign", "a.mat,1"),
        "unknown key 'torqe_sign'",
        "did you mean",
    ),
    table(
        "more cells than columns",
        recording_table("file", "a.mat,S1"),
        "line 2: the row does not fit the 1 columns",
    ),
    table(
        "a decimal comma",
        recording_table("file,start", 'a.mat,"3,5"'),
        "table.csv, line 2 → start: must be a finite number",
        "'3,5'",
    ),
    table(
        "a name twice",
        recording_table("file,name", "a.mat,S1", "b.mat,S1"),
        "line 3: the name 'S1' is taken",
    ),
]
