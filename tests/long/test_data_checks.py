"""No false alarm: the data of every simulated study pass the checks of an identification."""

import itertools
from pathlib import Path

import pytest
import yaml

from ankleloop import simulate
from ankleloop.joint.data_checks import DataUse, check_data
from ankleloop.joint.prepared import prepare

CONFIG = Path(__file__).parents[2] / "config" / "config.yaml"
SEEDS = (101, 202)


def points(study):
    values = study.get("points") or [{}]
    if isinstance(values, dict):
        values = [dict(zip(values, parts, strict=True)) for parts in itertools.product(*values.values())]
    return [study.get("simulation", {}) | point for point in values]


STUDIES = {
    name: points(study)
    for name, study in yaml.safe_load(CONFIG.read_text(encoding="utf-8"))["studies"].items()
    if study["kind"] == "simulation"
}


@pytest.mark.parametrize("study", STUDIES)
def test_simulated_studies_have_no_data_warnings(study):
    for settings, seed in itertools.product(STUDIES[study], SEEDS):
        trial = prepare(simulate(seed=seed, **settings))
        assert check_data([trial], DataUse(reference="reference")) == [], (settings, seed)
