"""The JSON schema is that of the models, and explains every key."""

import json
from pathlib import Path

import jsonschema
import pytest

from ankleloop_workflow.config.settings import SCHEMA as PATH
from ankleloop_workflow.config.settings import schema_text

ROOT = Path(__file__).parents[4]
SCHEMA = json.loads(schema_text())


def test_the_schema_in_the_repository_is_current():
    current = (ROOT / PATH).read_text(encoding="utf-8")
    assert current == schema_text(), "run: python -m ankleloop_workflow.config.settings"


@pytest.mark.parametrize("name", ["config.yaml", "recordings.example.yaml"])
def test_the_schema_accepts_the_configuration(read_config, name):
    jsonschema.validate(read_config(name), SCHEMA)
