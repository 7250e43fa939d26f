"""Configurations for the rows of the table, and the call that reads them."""

from functools import partial
from pathlib import Path
from typing import Any

import yaml

from ankleloop.studies.checking import ConfigError, check_config_file
from ankleloop.studies.run_config import read_run
from ankleloop.studies.study import Study
from bad_inputs.bad_input import rows_of
from bad_inputs.inputs import text_file

METHODS = "{pr-moesp: {method: pr-moesp}}"
STUDY = {"kind": "simulation", "seed": 1, "trials": 2, "methods": {"a": {"method": "pr-moesp"}}}


def read_config(path: Path) -> dict[str, Study]:
    """Read a configuration, as the workflow does."""
    check_config_file(path)
    return read_run(yaml.safe_load(path.read_text(encoding="utf-8")), [path])[1]


row = partial(rows_of(read_config), error=ConfigError)


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
