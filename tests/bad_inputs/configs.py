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
    """What readers of YAML 1.1 change, or never end to read."""
    keys = "studies:\n  NAME: {kind: simulation, seed: 1, methods: " + METHODS + "}\n"
    bomb = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{name}: &{name} [{', '.join([f'*{below}'] * 10)}]\n"
        for below, name in zip("abcdefgh", "bcdefghi", strict=True)
    )
    return [
        row("the number 012", text("points_per_chunk: 012"), "config.yaml, line 9", "012 as 10", "quotes"),
        row(
            "the name no without quotes",
            text_file("config.yaml", keys.replace("NAME", "no")),
            "config.yaml, line 2: YAML reads the key no as true or false",
            "put it in quotes",
        ),
        row("a tag of Python", text("title: !!python/tuple [a]"), "config.yaml, line 9: the tag 'python/tuple'"),
        row(
            "aliases of aliases of aliases",
            text_file("config.yaml", bomb),
            "config.yaml, line 6: more than 1,000,000 values",
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
