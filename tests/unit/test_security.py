"""What SECURITY.md says of configurations, recordings and pages."""

import pickle
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
import yaml
from snakemake.common.configfile import load_configfile
from snakemake_interface_common.exceptions import WorkflowError

import ankleloop
from ankleloop_lab.checking import ConfigError
from ankleloop_lab.pages.rendering import render_table
from ankleloop_workflow.config.files import check_config_file


class Bomb:
    """An object that leaves a mark where it is unpickled."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


@pytest.mark.parametrize("suffix", [".pkl", ".npy", ".csv", ".mat", ".h5", ".nc"])
def test_a_pickle_is_no_recording_under_any_name(tmp_path, suffix):
    mark = tmp_path / "mark"
    path = tmp_path / f"recording{suffix}"
    path.write_bytes(pickle.dumps(Bomb(mark)))
    with pytest.raises(ankleloop.DataError):
        ankleloop.read_trial(path, sampling_rate=1000.0)
    assert not mark.exists()
    pickle.loads(path.read_bytes())  # the bomb itself works
    assert mark.exists()


def test_a_tag_of_python_in_a_configuration_is_refused_and_not_run(tmp_path):
    mark, path = tmp_path / "mark", tmp_path / "config.yaml"
    path.write_text(
        f"run: !!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path ['{mark}']]\n"
    )
    with pytest.raises(WorkflowError, match="not valid"):
        load_configfile(path)
    assert not mark.exists()
    with pytest.raises(ConfigError, match="tag"):
        check_config_file(path)


def test_a_template_in_a_configuration_is_refused(tmp_path):
    """The command that SECURITY.md names says so without running it; Snakemake runs it before the workflow looks."""
    mark, path = tmp_path / "mark", tmp_path / "config.yaml"
    content = {
        "__use_yte__": True,
        "__definitions__": [f"open({str(mark)!r}, 'w').close()"],
        "run": ["table1"],
    }
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    with pytest.raises(
        ConfigError, match=r"line 1: with the key __use_yte__ Snakemake runs Python code"
    ):
        check_config_file(path)
    command = [sys.executable, "-m", "ankleloop_workflow.config.files", path]
    process = subprocess.run(command, capture_output=True, text=True)
    assert process.returncode == 1
    assert "__use_yte__" in process.stderr
    assert not mark.exists()
    load_configfile(path)
    assert mark.exists()


SCRIPT = "<script>alert(1)</script><img src=x onerror=alert(1)>"


def test_names_in_tables_are_text():
    table = render_table(pd.DataFrame({SCRIPT: [SCRIPT]}), [SCRIPT])
    assert "<script" not in table
    assert "<img" not in table
