"""Files of the configuration of the workflow: reading them, YAML, names and runs."""

from bad_inputs.bad_input import BadInput
from bad_inputs.config_inputs import METHODS, STUDY, config, row, study, text
from bad_inputs.inputs import missing, nothing, text_file

TITLE = "Configuration: files, YAML and names"


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


ROWS = [*_rows_of_files(), *_rows_of_yaml(), *_rows_of_names()]
