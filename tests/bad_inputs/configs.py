"""The configuration of the workflow."""

from functools import partial
from pathlib import Path
from typing import Any

import pytest
import yaml

from ankleloop.studies.checking import ConfigError
from ankleloop.studies.config_files import check_config_file
from ankleloop.studies.run_config import read_run
from ankleloop.studies.study import Study
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import missing, nothing, text_file

TITLE = "Configuration"

METHODS = "{pr-moesp: {method: pr-moesp}}"
STUDY = {"kind": "simulation", "seed": 1, "trials": 2, "methods": {"a": {"method": "pr-moesp"}}}


def read_config(path: Path) -> dict[str, Study]:
    """Read a configuration, as the workflow does."""
    check_config_file(path)
    return read_run(yaml.safe_load(path.read_text(encoding="utf-8")), [path])[1]


def read_config_with_an_empty_variable(path: Path) -> None:
    """Read a configuration where EMPTY_VARIABLE is set to nothing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("EMPTY_VARIABLE", "")
        read_config(path)


row = partial(rows_of(read_config), error=ConfigError, shown="snakemake")


def config(**keys: Any):
    """A configuration with one study `s`, and other keys beside it."""
    return text_file("config.yaml", yaml.safe_dump({"studies": {"s": STUDY}, **keys}, allow_unicode=True))


def study(**keys: Any):
    """A configuration whose study has other keys."""
    return config(studies={"s": {**STUDY, **keys}})


def text(line: str):
    """A configuration whose study has a line of YAML as it stands."""
    body = yaml.safe_dump({"studies": {"s": STUDY}})
    return text_file("config.yaml", f"{body.rstrip()}\n    {line}\n")


def method(**keys: Any):
    """A configuration whose study has one method."""
    return study(methods={"a": {"method": "pr-moesp", **keys}})


def recordings(**keys: Any):
    """A configuration of a study of recordings."""
    base = {
        "kind": "recordings",
        "folder": ".",
        "methods": {"a": {"method": "riv"}},
        "files": {"S1": {"file": "a.mat"}},
    }
    return config(studies={"r": {**base, **keys}})


def _rows_of_files() -> list[BadInput]:
    twice = "studies:\n  s: {kind: simulation, seed: 1, seed: 2, methods: " + METHODS + "}\n"
    return [
        row("a tab in place of spaces", text_file("config.yaml", "studies:\n\ts: 1\n"), "config.yaml", "line 2"),
        row("a bracket that is not closed", text_file("config.yaml", "run: [s\nstudies: {}\n"), "config.yaml", "line"),
        row("UTF-16", text_file("config.yaml", "studies: {}".encode("utf-16-le")), "config.yaml"),
        row("Latin-1", text_file("config.yaml", "title: Käfer".encode("latin-1")), "config.yaml", "UTF-8"),
        row("the file is empty", text_file("config.yaml", ""), "config.yaml: must have keys at the top level"),
        row(
            "a list in place of keys",
            text_file("config.yaml", "- run\n- studies\n"),
            "config.yaml: must have keys at the top level",
        ),
        row("a key twice", text_file("config.yaml", twice), "config.yaml: the key 'seed' in line 2 stands in line 2"),
        row(
            "studies twice",
            text_file("config.yaml", "studies: {}\nrun: []\nstudies: {}\n"),
            "config.yaml: the key 'studies' in line 3 stands in line 1",
        ),
        row("an alias that contains itself", text_file("config.yaml", "studies: &a\n  s: *a\n"), "config"),
        row("there is no file", missing("config.yaml"), "config.yaml", "the file cannot be read"),
        row("a folder", nothing, "the file cannot be read (Is a directory)", "check the path"),
    ]


def _rows_of_studies() -> list[BadInput]:
    place = "config → studies → s"
    return [
        row("studies in a list", config(studies=["s"]), "config → studies: must be a mapping of keys to values"),
        row("no studies", config(studies={}), "config → studies", "must not be empty"),
        row("a study that is empty", config(studies={"s": None}), f"{place}: must be a mapping of keys to values"),
        row(
            "a study that is a text",
            config(studies={"s": "table1"}),
            f"{place}: must be a mapping of keys to values, got 'table1'",
        ),
        row("unknown key", config(studdies={}), "config: unknown key 'studdies'", "did you mean 'studies'"),
        row("unknown key of a study", study(trails=3), f"{place}: unknown key 'trails'", "did you mean 'trials'"),
        row("a name with a slash", config(studies={"../s": STUDY}), "config → studies → ../s"),
        row(
            "a name that is a number",
            config(studies={1: STUDY}),
            "config.yaml, line 2: YAML reads the key 1 as a number",
            "quotes",
        ),
        row("run names no study", config(run=["table9"]), "config: run: there is no study 'table9'; there are s"),
        row("run is a text", config(run="s"), "config → run", "list"),
        row("run is empty", config(run=[]), "config: run", "names no study"),
        row("a study run twice", config(run=["s", "s"]), "config: run", "'s'", "twice"),
        row("2.5 trials", study(trials=2.5), f"{place} → trials", "whole number", "got 2.5"),
        row("1.0 trials", study(trials=1.0), right=_has_one_trial),
        row("no trials", study(trials=0), f"{place} → trials", "got 0"),
        row("trials that are true", study(trials=True), f"{place} → trials", "whole number", "got True"),
        row("trials as text", study(trials="20"), f"{place} → trials", "whole number", "got '20'"),
        row("a seed that is missing", study(seed=None), f"{place} → seed", "got None"),
        row("a seed below 0", study(seed=-1), f"{place} → seed", "got -1"),
        row(
            "a title that is a date",
            text("title: 2024-01-01"),
            "config.yaml, line 9: YAML reads 2024-01-01 as a date",
            "quotes",
        ),
        row(
            "unknown kind",
            study(kind="simulations"),
            f"{place} → kind: must be one of 'simulation', 'recordings' (did you mean 'simulation'?)",
        ),
        row("unknown notebook", study(notebook="table9"), f"{place} → notebook: must be one of", "got 'table9'"),
        row(
            "a figure of a method that the study does not have",
            study(figure={"methods": ["b"]}),
            place,
            "figure",
            "'b'",
        ),
        row(
            "a figure of a trial that the study does not have",
            study(figure={"trial": 5}),
            place,
            "figure",
            "trial",
            "5",
        ),
        row("a figure of no method", study(figure={"methods": []}), f"{place} → figure → methods: must not be empty"),
        row(
            "a figure of a method twice",
            study(figure={"methods": ["a", "a"]}),
            f"{place}: figure: methods: 'a' is listed",
        ),
        row("a figure of length 0", study(figure={"length": 0.0}), f"{place} → figure → length [s]", "got 0.0"),
        row("run is a mapping", config(run={"s": 1}), "config → run: must be a list in brackets"),
        row("a study in run that is null", config(run=[None]), "config → run", "must be text, got None"),
        row("a seed with a fraction", study(seed=0.5), f"{place} → seed", "whole number", "got 0.5"),
        row("trials beyond all bounds", study(trials=10**9), f"{place} → trials", "between 1 and 100000"),
        row("a figure behind the end of the trial", study(figure={"start": 100.0}), place, "figure", "start", "100"),
    ]


def _rows_of_simulations() -> list[BadInput]:
    place = "config → studies → s"
    return [
        row(
            "nan as a setting",
            text("simulation: {stiffness: .nan}"),
            f"{place} → simulation → stiffness [N·m/rad]",
            "got nan",
        ),
        row(
            "infinity as a setting",
            text("simulation: {duration: .inf}"),
            f"{place} → simulation → duration [s]",
            "got inf",
        ),
        row(
            "a setting that YAML reads as text",
            text("simulation: {stiffness: 1e3}"),
            f"{place} → simulation → stiffness [N·m/rad]",
            "'1e3'",
        ),
        row(
            "a setting with a decimal comma",
            text("simulation: {duration: '50,0'}"),
            f"{place} → simulation → duration [s]",
            "'50,0'",
        ),
        row("yes as a number", text("simulation: {snr_db: yes}"), f"{place} → simulation → snr_db [dB]", "got True"),
        row(
            "unknown setting",
            study(simulation={"stifness": 1.0}),
            f"{place} → simulation: unknown key 'stifness'",
            "did you mean 'stiffness'",
        ),
        row("settings in a list", study(simulation=[1]), f"{place} → simulation: must be a mapping of keys to values"),
        row(
            "a negative duration", study(simulation={"duration": -1}), f"{place} → simulation → duration [s]", "got -1"
        ),
        row(
            "a point out of range",
            study(points={"reflex_gain": [-2.0]}),
            f"{place} → points → reflex_gain=-2.0 → reflex_gain [N·m·s/rad]",
            "got -2.0",
        ),
        row(
            "points by an unknown setting",
            study(points={"gain": [1.0]}),
            f"{place} → points: 'gain' is not a setting of the simulation",
        ),
        row(
            "points without values",
            study(points={"reflex_gain": []}),
            f"{place} → points: each setting must have a list of values",
        ),
        row(
            "a point twice",
            study(points={"reflex_gain": [13, 13.0]}),
            f"{place} → points: the point reflex_gain=13.0 is listed twice",
        ),
        row("a point that is the setting of all", study(points=[{}, {"reflex_gain": 13.0}]), "have the same settings"),
        row(
            "no list of values",
            study(points={"zeta": 1.0}),
            f"{place} → points: each setting must have a list",
            "zeta: 1.0",
        ),
        row(
            "a list as a value", study(points={"zeta": [[1.0]]}), f"{place} → points: zeta: each value must be a single"
        ),
        row("points in a text", study(points="zeta"), f"{place} → points: must be lists of values by setting"),
        row("an empty list of points", study(points=[]), f"{place} → points: must be lists of values by setting"),
        row(
            "nan as a point",
            text("points: {reflex_gain: [.nan]}"),
            "reflex_gain=nan → reflex_gain [N·m·s/rad]",
            "got nan",
        ),
        row("a number beyond all floats", study(points={"zeta": [10**400]}), f"{place} → points → zeta=1000"),
        row(
            "a misspelt setting in points",
            study(points={"reflex_gian": [1.0]}),
            "'reflex_gian' is not a setting of the simulation (did you mean 'reflex_gain'?)",
        ),
        row(
            "10,000,000,000 points",
            study(points={name: list(range(1, 101)) for name in ("zeta", "delay", "stiffness", "inertia", "omega_n")}),
            f"{place} → points: 10,000,000,000 points are more than 100,000",
        ),
        row(
            "a million chunks",
            study(points={"reflex_gain": list(range(1000))}, trials=1000, trials_per_chunk=1),
            f"{place}: 1,000,000 chunks are more than 100,000: increase trials_per_chunk",
        ),
        row(
            "parts of points",
            study(points_per_chunk=2, trials_per_chunk=2),
            f"{place}: a chunk is some points, or part",
        ),
        row("chunks of 0 points", study(points_per_chunk=0), f"{place} → points_per_chunk", "got 0"),
    ]


def _rows_of_methods() -> list[BadInput]:
    place = "config → studies → s → methods"
    return [
        row("no methods", study(methods={}), place, "must not be empty"),
        row("methods in a list", study(methods=["riv"]), f"{place}: must be a mapping of keys to values"),
        row(
            "unknown method",
            method(method="pr-moes"),
            f"{place} → a → method: must be one of 'pr-moesp'",
            "got 'pr-moes'",
        ),
        row(
            "unknown option",
            method(options={"blok_rows": 3}),
            f"{place} → a → options: unknown key 'blok_rows'",
            "did you mean 'block_rows'",
        ),
        row("an option out of range", method(options={"order": 0}), f"{place} → a → options → order", "got 0"),
        row(
            "an order as large as the block rows",
            method(options={"order": 15}),
            f"{place} → a → options",
            "block_rows must be larger than the order",
        ),
        row(
            "a rate that does not divide that of the record",
            method(options={"identification_rate": 70.0}),
            f"{place} → a",
            "70",
            "1000",
        ),
        row(
            "a candidate out of range",
            method(select={"order": [0]}),
            f"{place} → a: select: ",
            "between 1 and 20, got 0",
        ),
        row("a method that is null", study(methods={"a": None}), f"{place} → a: must be a mapping of keys to values"),
        row(
            "a method without its name",
            study(methods={"a": {"label": "x"}}),
            f"{place} → a: the key 'method' is missing",
        ),
        row("a method in a list", method(method=["riv"]), f"{place} → a → method: must be one of", "['riv']"),
        row("options in a list", method(options=[1]), f"{place} → a → options: must be a mapping of keys to values"),
        row(
            "options that are null", method(options=None), f"{place} → a → options: must be a mapping of keys to values"
        ),
        row(
            "an option that is text", method(options={"order": "2"}), f"{place} → a → options → order", "without quotes"
        ),
        row("no candidates", method(select={"order": []}), f"{place} → a → select → order: must not be empty"),
        row(
            "candidates without a list", method(select={"order": 2}), f"{place} → a → select → order: must be a list in"
        ),
        row("unknown candidates", method(select={"ordre": [2]}), f"{place} → a: select: ", "did you mean 'order'"),
        row(
            "an option that is fixed and selected",
            method(options={"order": 2}, select={"order": [2, 3]}),
            f"{place} → a: 'order' is under options and under select",
        ),
        row(
            "a criterion without a selection",
            method(criterion="instrumental"),
            "criterion has no effect without select",
        ),
        row(
            "a reference that no simulated trial has",
            method(options={"reference": "refrence"}),
            f"{place} → a → options: a simulated trial has no 'refrence' (did you mean 'reference'?)",
        ),
        row(
            "trials that are shorter than the filters",
            study(simulation={"duration": 0.1}),
            f"{place} → a → options: the record of 0.1 s is too short",
        ),
        row(
            "leads beyond the block rows",
            method(options={"instrument_leads": 16}),
            f"{place} → a → options: instrument_leads must be between 0 and block_rows (15), got 16",
        ),
        row("a name with a space", study(methods={"a b": {"method": "riv"}}), f"{place} → a b"),
        row(
            "two methods with one label",
            study(methods={"a": {"method": "riv"}, "b": {"method": "riv", "label": "a"}}),
            "'a'",
            "label",
        ),
    ]


def _rows_of_recordings() -> list[BadInput]:
    place = "config → studies → r"
    return [
        row(
            "a recording without a file",
            recordings(files={"S1": {"torque": "t"}}),
            f"{place} → files → S1: the key 'file' is missing",
        ),
        row(
            "no recordings",
            recordings(files={}),
            "study r: name its recordings under files, or a table that lists them",
        ),
        row(
            "a name of a recording that is a path",
            recordings(files={"a/b": {"file": "a.mat"}}),
            f"{place} → files → a/b",
        ),
        row(
            "a subject that YAML reads as a number",
            recordings(files={"S1": {"file": "a.mat", "subject": 7}}),
            f"{place} → files → S1 → subject: must be text, got 7",
            "quotes",
        ),
        row(
            "a sign of 0",
            recordings(files={"S1": {"file": "a.mat", "torque_sign": 0}}),
            f"{place} → files → S1 → torque_sign",
            "got 0",
        ),
        row(
            "a part that ends before it starts",
            recordings(files={"S1": {"file": "a.mat", "start": 9.0, "stop": 3.0}}),
            f"{place} → files → S1",
            "stop",
            "start",
        ),
        row(
            "a default for the file",
            recordings(defaults={"file": "a.mat"}),
            f"{place}: defaults: the key 'file' has no default",
        ),
        row("an unknown default", recordings(defaults={"torqe_sign": -1}), place, "unknown key 'torqe_sign'"),
        row(
            "a folder in a variable that is not set",
            recordings(folder="${NO_SUCH_VARIABLE}/x"),
            "study r: the folder of its recordings is ${NO_SUCH_VARIABLE}/x",
            "NO_SUCH_VARIABLE is not set",
            "export NO_SUCH_VARIABLE=",
        ),
        row(
            "a folder in a variable that is empty",
            recordings(folder="${EMPTY_VARIABLE}/x"),
            "study r: the folder of its recordings is ${EMPTY_VARIABLE}/x",
            "EMPTY_VARIABLE is empty",
            call=read_config_with_an_empty_variable,
        ),
        row("a folder that does not exist", recordings(folder="/no/such"), "line", "/no/such, does not exist"),
        row("a folder that is a file", recordings(folder="config.yaml"), "config.yaml, is a file"),
        row("a folder with none of the files", recordings(), "has none of its 1 files", "a.mat"),
        row(
            "a folder of nobody", recordings(folder="~nobody-of-this-name/x"), "~nobody-of-this-name/x, does not exist"
        ),
        row(
            "an empty path of a file", recordings(files={"S1": {"file": ""}}), f"{place} → files → S1 → file: must not"
        ),
        row(
            "a table in a variable that is not set",
            recordings(files={}, table="${NO_SUCH_VARIABLE}/list.csv"),
            "study r: the table of its recordings is ${NO_SUCH_VARIABLE}/list.csv",
        ),
        row("a table that does not exist", recordings(files={}, table="list.csv"), "there is no table", "list.csv"),
        row(
            "recordings whose names differ in capitals",
            recordings(files={"S1": {"file": "a.mat"}, "s1": {"file": "b.mat"}}),
            "files: 'S1' and 's1' differ in capitals only",
        ),
        row(
            "a recording that is called as the page of another",
            recordings(files={"S1": {"file": "a.mat"}, "S1.html": {"file": "b.mat"}}),
            "files: S1.html is the page of the recording S1",
        ),
        row("defaults in a list", recordings(defaults=[1]), f"{place} → defaults: must be a mapping", "got [1]"),
        row("files in a list", recordings(files=["a.mat"]), f"{place} → files: must be a mapping"),
        row("points of recordings", recordings(points={"zeta": [1.0]}), f"{place}: unknown key 'points'"),
        row(
            "a notebook of simulations",
            recordings(notebook="table1"),
            f"{place} → notebook: must be 'recordings'",
            "got 'table1'",
        ),
    ]


def _rows_of_yaml() -> list[BadInput]:
    """What readers of YAML 1.1 change, or never end to read."""
    keys = "studies:\n  NAME: {kind: simulation, seed: 1, methods: " + METHODS + "}\n"
    numbers = {"012": "10", "1_2": "12", "13:30": "810", "0x1F": "31"}
    words = {
        "7": "number",
        "1_2": "number",
        "13:30": "number",
        "no": "true or false",
        "~": "nothing",
        "2020-01-01": "date",
    }
    bomb = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{name}: &{name} [{', '.join([f'*{below}'] * 10)}]\n"
        for below, name in zip("abcdefgh", "bcdefghi", strict=True)
    )
    return [
        *(
            row(
                f"the number {written}",
                text(f"points_per_chunk: {written}"),
                "config.yaml, line 9",
                f"{written} as {number}",
                "quotes",
            )
            for written, number in numbers.items()
        ),
        *(
            row(
                f"the name {written} without quotes",
                text_file("config.yaml", keys.replace("NAME", written)),
                f"config.yaml, line 2: YAML reads the key {written} as",
                kind,
                "put it in quotes",
            )
            for written, kind in words.items()
        ),
        row(
            "a label that YAML reads as false", text("title: no"), "→ title: must be text, got False: put it in quotes"
        ),
        row("a title that YAML reads as a number", text("title: 7.5"), "→ title: must be text, got 7.5: put it in qu"),
        row(
            "a name in run that YAML reads as a number",
            config(run=[1]),
            "config → run",
            "must be text, got 1: put it in",
        ),
        row("a tag of Python", text("title: !!python/tuple [a]"), "config.yaml, line 9: the tag 'python/tuple'"),
        row("a tag of somebody else", text("title: !secret a"), "config.yaml, line 9: the tag '!secret'"),
        row("a list as a key", text("? [a, b]\n    : 1"), "config.yaml, line 9: a key must be text"),
        row(
            "an alias without anchor",
            text("title: *nobody"),
            "config.yaml, line 9: this is not YAML",
            "undefined alias",
        ),
        row(
            "two documents",
            text_file("config.yaml", "run: [s]\n---\nrun: [t]\n"),
            "config.yaml, line 2",
            "another document",
        ),
        row("a text whose quote is not closed", text("title: 'x"), "config.yaml, line", "this is not YAML"),
        row("a control character", text("title: a\x07b"), "config.yaml: this is not YAML", "control characters"),
        row(
            "aliases of aliases of aliases",
            text_file("config.yaml", bomb),
            "config.yaml, line 6: more than 1,000,000 values",
        ),
        row("lists in lists in lists", text_file("config.yaml", "run: " + "[" * 5000), "nested more than 100 deep"),
        row(
            "a key of JSON twice",
            text_file("config.json", '{"run": ["s"], "run": ["t"]}'),
            "config.json: the key 'run' stands",
        ),
    ]


def _rows_of_names() -> list[BadInput]:
    place = "config → studies"
    names = {"spaces": "a b", "a dot": "a.b", "two dots": "..", "an accent": "é", "a brace": "{a}", "nothing": ""}
    return [
        *(
            row(
                f"a name with {wrong}" if name else "a name of nothing",
                config(studies={name: STUDY}),
                f"{place} → {name}",
                "must consist of letters A-Z a-z, digits and _ -",
            )
            for wrong, name in names.items()
        ),
        row("a name of 300 letters", config(studies={"a" * 300: STUDY}), place, "at most 100 characters", "300"),
        row(
            "studies whose names differ in capitals",
            config(studies={"Load": STUDY, "load": STUDY}),
            "studies: 'Load' and 'load' differ in capitals only",
        ),
        row(
            "methods whose names differ in capitals",
            study(methods={"A": {"method": "riv"}, "a": {"method": "riv"}}),
            "methods: 'A' and 'a' differ in capitals only",
        ),
        row(
            "a study with the name of the table of costs",
            config(studies={"economy": STUDY}),
            "studies: 'economy' has another table, results/tables/economy.csv",
        ),
        row(
            "a method with the name of another",
            study(methods={"pr-moesp": {"method": "riv"}}),
            "methods: pr-moesp is the name of another method than riv",
        ),
        row(
            "a misspelt study in run",
            config(run=["t"], studies={"s": STUDY, "table1": STUDY}),
            "run: there is no study 't'",
        ),
        row(
            "an article of an unknown study",
            config(article=["t"]),
            "config: article: there is no study 't'; there are s",
        ),
        row("an article with a study twice", config(article=["s", "s"]), "config: article: 's' is listed twice"),
        row(
            "an article of a study without notebook",
            config(article=["s"], studies={"s": {**STUDY, "notebook": None}}),
            "config: article: the study 's' is not simulated, or has no notebook",
        ),
        row(
            "an article without Table 1",
            config(article=["s"]),
            "config: article: needs the study 'table1'",
            "article: []",
        ),
        row(
            "a selection where the economy is measured",
            config(
                article=["table1"],
                studies={
                    "table1": {**STUDY, "methods": {"pr-moesp": {"method": "pr-moesp", "select": {"order": [2]}}}}
                },
            ),
            "article: pr-moesp of the study 'table1' must not have select",
        ),
        row("an article that is null", config(article=None), "config → article: must be a list in brackets"),
    ]


def _rows_of_notebooks() -> list[BadInput]:
    """What a notebook needs of its study, which would otherwise be found after all trials."""
    place = "config → studies → s → notebook"
    two = {"reflex_gain": [5.0, 13.0], "voluntary": [0.0, 0.1]}
    cascade = {"a": {"method": "parallel-cascade"}}

    def notebook(name: str, **keys: Any):
        return study(notebook=name, **keys)

    return [
        row("Figure 4 of one point", notebook("figure4"), f"{place}: figure4 needs one setting", "got none"),
        row(
            "Figure 4 of two settings",
            notebook("figure4", points=two),
            "needs one setting",
            "got reflex_gain, voluntary",
        ),
        row(
            "Figure 4 without the parallel cascade",
            notebook("figure4", points={"reflex_gain": [5.0, 13.0]}),
            f"{place}: figure4 needs a method parallel-cascade",
        ),
        row(
            "Figure 4 against the measured torque",
            notebook("figure4", points={"reflex_gain": [5.0, 13.0]}, methods=cascade, against="measured"),
            "needs scores against the true torques: leave out against: measured",
        ),
        row(
            "Figure 4 against a setting that is null",
            notebook("figure4", points={"snr_db": [None, 10.0]}, methods=cascade),
            "needs numbers as values of snr_db, got None",
        ),
        row("a comparison of one point", notebook("comparison"), "comparison needs a setting beside closed_loop"),
        row(
            "a comparison of a grid",
            notebook("comparison", points=two),
            "needs one value of voluntary for each value of",
        ),
        row("traces of another method", notebook("traces"), "traces needs one method, real-time, got pr-moesp"),
        row(
            "traces of several truths",
            notebook("traces", methods={"a": {"method": "real-time"}}, points={"reflex_gain": [5.0, 13.0]}),
            "needs points with the same K, B, I and G",
        ),
        row(
            "a map of one setting",
            notebook("sensitivity"),
            "sensitivity needs two settings or more that differ, got none",
        ),
        row(
            "a map without a stop rule", notebook("sensitivity", points=two), "whose name begins with parallel-cascade"
        ),
        row(
            "efficiency without intervals of the delay",
            notebook("efficiency"),
            "needs a method riv with the option delay: n",
        ),
        row(
            "a choice without selections",
            notebook("choosing", points={"voluntary": [0.0, 0.1]}),
            "choosing needs select for every method, got none for a",
        ),
        row(
            "obstacles without a filter",
            notebook("obstacles", simulation={"antialias_cutoff": None}),
            "obstacles needs a point with the anti-aliasing filter",
        ),
    ]


def _has_one_trial(studies: dict[str, Study]) -> None:
    trials = studies["s"].settings.trials
    assert (trials, type(trials)) == (1, int)


ROWS = [
    *_rows_of_files(),
    *_rows_of_yaml(),
    *_rows_of_names(),
    *_rows_of_studies(),
    *_rows_of_simulations(),
    *_rows_of_methods(),
    *_rows_of_notebooks(),
    *_rows_of_recordings(),
]
