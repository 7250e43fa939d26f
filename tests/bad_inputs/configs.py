"""Files of the configuration of the workflow: reading them, YAML, names and runs."""

from bad_inputs.bad_input import BadInput
from bad_inputs.config_inputs import METHODS, STUDY, config, row, text
from bad_inputs.inputs import missing, text_file


def _rows_of_files() -> list[BadInput]:
    twice = "studies:\n  s: {kind: simulation, seed: 1, seed: 2, methods: " + METHODS + "}\n"
    return [
        row("a tab in place of spaces", text_file("config.yaml", "studies:\n\ts: 1\n"), "config.yaml", "line 2"),
        row("UTF-16", text_file("config.yaml", "studies: {}".encode("utf-16-le")), "config.yaml"),
        row("a key twice", text_file("config.yaml", twice), "config.yaml: the key 'seed' in line 2 stands in line 2"),
        row("there is no file", missing("config.yaml"), "config.yaml", "the file cannot be read"),
    ]


def _rows_of_yaml() -> list[BadInput]:
    """What readers of YAML 1.1 change."""
    keys = "studies:\n  NAME: {kind: simulation, seed: 1, methods: " + METHODS + "}\n"
    return [
        row("the number 012", text("points_per_chunk: 012"), "config.yaml, line 9", "012 as 10", "quotes"),
        row(
            "the name no without quotes",
            text_file("config.yaml", keys.replace("NAME", "no")),
            "config.yaml, line 2: YAML reads the key no as bool",
            "put it in quotes",
        ),
        row(
            "a tag of Python",
            text("title: !!python/tuple [a]"),
            "config.yaml: ",
            "the tag 'tag:yaml.org,2002:python/tuple'",
            "line 9",
        ),
    ]


def _rows_of_names() -> list[BadInput]:
    return [
        row(
            "a name with a brace",
            config(studies={"{a}": STUDY}),
            "config → studies → {a}",
            "must consist of letters A-Z a-z, digits and _ -",
        ),
        row(
            "a misspelt study in run",
            config(run=["t"], studies={"s": STUDY, "table1": STUDY}),
            "run: there is no study 't'",
        ),
    ]


ROWS = [*_rows_of_files(), *_rows_of_yaml(), *_rows_of_names()]
