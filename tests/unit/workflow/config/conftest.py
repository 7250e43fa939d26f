from copy import deepcopy
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="session")
def read_config():
    """Read a configuration file of the repository."""
    return lambda name: yaml.safe_load((ROOT / "config" / name).read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def config(read_config):
    """The configuration of the paper."""
    return read_config("config.yaml")


@pytest.fixture(scope="session")
def change(config):
    """The configuration of the paper with one key set."""

    def change(*keys, value):
        changed = deepcopy(config)
        mapping = changed
        for key in keys[:-1]:
            mapping = mapping.setdefault(key, {})
        mapping[keys[-1]] = value
        return changed

    return change


@pytest.fixture
def example(read_config):
    """The example of a study of recordings."""
    return read_config("recordings.example.yaml")
