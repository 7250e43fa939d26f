"""The JSON schema is that of the models, and explains every key."""

import json
from pathlib import Path

import jsonschema
import pytest

from ankleloop.studies.config import SCHEMA as PATH
from ankleloop.studies.config import schema_text

ROOT = Path(__file__).parents[3]
SCHEMA = json.loads(schema_text())


def test_the_schema_in_the_repository_is_current():
    current = (ROOT / PATH).read_text(encoding="utf-8")
    assert current == schema_text(), "run: python -m ankleloop.studies.config"


@pytest.mark.parametrize("name", ["config.yaml", "recordings.example.yaml"])
def test_the_schema_accepts_the_configuration(read_config, name):
    jsonschema.validate(read_config(name), SCHEMA)


def test_the_schema_refuses_what_the_models_refuse(change):
    for keys, value in (
        (["studies", "table1", "trails"], 3),
        (["studies", "table1", "trials"], 0),
        (["studies", "table1", "methods", "a"], {"method": "parallel-cascade", "options": {"order": 2}}),
    ):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(change(*keys, value=value), SCHEMA)
