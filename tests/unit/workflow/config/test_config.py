"""The configuration: defaults from the library, and errors that name the key."""

import json
from copy import deepcopy

import jsonschema
import pytest
from snakemake.utils import update_config

from ankleloop_lab.checking import ConfigError
from ankleloop_workflow.config.settings import schema_text
from ankleloop_workflow.config.study import read_studies

METHOD = ("studies", "table1", "methods", "a")


@pytest.mark.parametrize(
    "overlay", ["config.yaml", "ci.yaml", "beyond.yaml", "recordings.example.yaml"]
)
def test_every_configuration_of_the_repository_is_valid(config, read_config, overlay, monkeypatch):
    monkeypatch.setenv("ANKLELOOP_RECORDINGS", "recordings")

    merged = deepcopy(config)
    update_config(merged, read_config(overlay))
    read_studies(merged)


def test_null_leaves_out_a_method_of_a_shipped_study(change):
    changed = change("studies", "voluntary", "methods", "riv", value=None)
    jsonschema.validate(changed, json.loads(schema_text()))
    assert "riv" not in read_studies(changed)[1]["voluntary"].methods


def test_a_load_under_simulation_is_three_settings(change):
    changed = change("studies", "table1", "simulation", value={"load": [0.1, 10.0, 100.0]})
    jsonschema.validate(changed, json.loads(schema_text()))
    settings = read_studies(changed)[1]["table1"].settings.simulation
    assert settings.load_inertia == 0.1
    assert settings.load_stiffness == 100.0
    changed = change("studies", "table1", "simulation", value={"load": [0.1]})
    with pytest.raises(
        ConfigError, match=r"table1 → simulation: load must be three numbers \(inertia, visc"
    ):
        read_studies(changed)


TABLE1 = ("studies", "table1")


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (
            ["studies", "x"],
            {"kind": "simulation", "methods": {"a": {"method": "riv"}}},
            "x: the key 'seed' is missing",
        ),
        (["studies", "x"], {"seed": 1}, "studies → x: the key 'kind' is missing"),
        (
            [*TABLE1, "trials"],
            "1e3",
            "trials: .* which is text: write it without quotes, and powers of ten as 1.0e",
        ),
        ([*TABLE1, "title"], 3, "table1 → title: must be text, got 3: put it in quotes"),
        (
            [*TABLE1, "simulation", "duration"],
            0.0015,
            "simulation: duration × recording_rate must be a wh",
        ),
        (
            [*TABLE1, "points"],
            3,
            "table1 → points: must be lists of values by setting, or a list of p",
        ),
        (
            [*TABLE1, "points", "reflex_gain"],
            [-2.0],
            "points → reflex_gain=-2.0 → reflex_gain: must be between 0 and 100000 N·m·s/rad, got -2",
        ),
        (
            METHOD,
            {"method": "pr-moes"},
            r"a → method: unknown method 'pr-moes' \(did you mean 'pr-moesp'\?\); known: riv, pr-moesp, ",
        ),
        (
            METHOD,
            {"method": "riv", "options": {"basis": "spline", "degree": 3}},
            "a → options: degree: a spline basis needs a degree of at least 4, got 3",
        ),
        (
            METHOD,
            {"method": "pr-moesp", "select": {"order": [1, 0]}},
            r"methods → a: select: .*order must be .* 1 .*, got 0",
        ),
        (
            [*TABLE1, "notebook"],
            None,
            "config → article: its studies are simulated and have a notebook",
        ),
        ([*TABLE1, "keep"], "scores", "article: .* 'table1': name it and set its keep: everything"),
    ],
)
def test_errors_name_the_key(change, keys, value, message):
    with pytest.raises(ConfigError, match=message):
        read_studies(change(*keys, value=value))
