"""The tutorial that adds a method: its file and its line make a method of the library."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from docs_blocks import ROOT, read_blocks

PAGE = "docs/tutorials/add-a-method.md"
USE = """
import json, yaml
import ankleloop
from ankleloop.studies.resources import identification_seconds
from ankleloop.studies.study import read_studies

trial = ankleloop.simulate(seed=1, duration=20.0, closed_loop=False, reflex_gain=0.0, snr_db=None, voluntary=0.0)
estimate = ankleloop.identify(trial, "stiffness")
config, studies = read_studies(yaml.safe_load({config!r}))
assert identification_seconds(20_000, [{{"method": "stiffness"}}]) > 0  # of its jobs
print(json.dumps([*estimate.stiffness.values(), *(list(study.methods) for study in studies.values())]))
"""


@pytest.fixture
def library(tmp_path):
    """A copy of the library with the method of the tutorial."""
    blocks = read_blocks(PAGE)
    shutil.copytree(ROOT / "src", tmp_path / "src")  # with its compiled kernels
    shutil.copytree(ROOT / "workflow" / "schemas", tmp_path / "workflow" / "schemas")
    methods = tmp_path / "src" / "ankleloop" / "methods"
    (methods / "stiffness.py").write_text(blocks[0].code, encoding="utf-8")
    registry = (methods / "registry.py").read_text(encoding="utf-8")
    [families] = [block.code for block in blocks if "FAMILIES = " in block.code]
    for line in filter(None, families.splitlines()):  # each takes the place of the line that begins alike
        registry = re.sub(rf"^{re.escape(line[:10])}.*moesp.*$", line, registry, flags=re.MULTILINE)
    assert registry.count("real_time, stiffness") == registry.count("riv_tv, stiffness") == 1
    (methods / "registry.py").write_text(registry, encoding="utf-8")
    return tmp_path


def run(library, *arguments):
    environment = {**os.environ, "PYTHONPATH": str(library / "src")}
    process = subprocess.run(
        [sys.executable, *arguments], cwd=library, env=environment, capture_output=True, text=True, check=False
    )
    assert process.returncode == 0, process.stderr
    return process.stdout


def test_the_method_of_the_tutorial_becomes_one_of_the_library(library):
    [config] = [block.code for block in read_blocks(PAGE) if block.language == "yaml"]
    stiffness = json.loads(run(library, "-c", USE.format(config=config)))
    assert stiffness[:3] == pytest.approx([150.0, 0.8, 0.015], rel=0.02)
    run(library, "-m", "ankleloop.studies.config")
    schema = (library / "workflow" / "schemas" / "config.schema.json").read_text(encoding="utf-8")
    assert '"stiffness"' in schema
