"""The configuration of a run is checked before its first job: paths, files of recordings, and all that it names."""

import json

import pytest
import yaml
from snakemake.utils import update_config

from ankleloop_lab.checking import ConfigError
from ankleloop_workflow.config.files import expand_path
from ankleloop_workflow.config.run import complete_config, describe_article, read_run
from ankleloop_workflow.config.study import read_studies


@pytest.fixture
def recorded(tmp_path):
    """Read a run of recordings in a folder."""

    def read(folder, **files):
        study = {"kind": "recordings", "folder": folder, "methods": {"a": {"method": "riv"}}}
        study["files"] = {name: {"file": file} for name, file in files.items()}
        path = tmp_path / "config.yaml"
        path.write_text(yaml.safe_dump({"studies": {"r": study}}), encoding="utf-8")
        return read_run(yaml.safe_load(path.read_text(encoding="utf-8")), [path])[1]["r"]

    return read


def test_paths_may_have_variables_dollar_signs_and_a_home(monkeypatch):
    monkeypatch.setenv("FOLDER", "/data/a$b")  # what a variable holds is not expanded again
    monkeypatch.setenv("HOME", "/home/me")
    paths = {
        "$FOLDER/x y": "/data/a$b/x y",
        "${FOLDER}x": "/data/a$bx",
        "~/x": "/home/me/x",
        "/a$$b": "/a$b",
        "/a$": "/a$",
        "../x": "../x",
    }
    assert {text: str(expand_path(text, "the folder")) for text in paths} == paths


def test_one_file_of_many_may_be_missing(recorded, tmp_path):
    """Its job refuses it in its own page, and goes on with the others."""
    folder = tmp_path / "two words"
    folder.mkdir()
    (folder / "a b.csv").touch()
    study = recorded(str(folder), A="a b.csv", B="missing.csv", C="x" * 300, D="nul\0byte")
    assert study.existing_paths(0) == [str(folder / "a b.csv")]
    with pytest.raises(
        ConfigError,
        match=r"config.yaml, line 6: .*folder: none of its 1 files exists; .*missing.csv",
    ):
        recorded(str(folder), B="missing.csv")


def test_records_too_short_for_a_method_are_refused_before_the_first_job(tmp_path):
    """Where another method of the study can identify them."""
    methods = {name: {"method": name} for name in ("parallel-cascade", "real-time")}
    study = {
        "kind": "simulation",
        "seed": 1,
        "trials": 1,
        "points": {"duration": [60.0, 9.0]},
        "methods": methods,
    }
    path = tmp_path / "config.yaml"
    path.write_text(yaml.safe_dump({"studies": {"short": study}}), encoding="utf-8")
    read_run({"studies": {"short": study}}, [path])
    with pytest.raises(
        ConfigError, match=r"line \d+: .* real-time: .*duration=9\.0.*record longer"
    ):
        read_run({"studies": {"short": study}}, [path], identify=True)


def test_a_run_without_the_article_says_so(config):
    whole = read_studies(config)[0]
    assert (describe_article(whole), whole.article_names) == ("", config["article"])
    part = read_studies({**config, "run": [name for name in config["article"] if name != "load"]})[
        0
    ]
    assert describe_article(part).endswith("because run leaves out studies of article: load.")
    assert part.article_names == []


def test_braces_in_the_name_of_a_file_are_named(recorded, tmp_path):
    (tmp_path / "S{1}.csv").touch()
    with pytest.raises(
        ConfigError, match=r"the recording A1: Snakemake takes the braces of .*S\{1\}.csv"
    ):
        recorded(str(tmp_path), A1="S{1}.csv")


@pytest.mark.parametrize("name", ["config.yaml", "beyond.yaml"])
def test_the_configuration_with_all_defaults_runs_again(read_config, name):
    """As results/configuration.json: nothing in it is refused, and no study is another one."""
    config = read_config("config.yaml")
    update_config(config, read_config(name))
    checked, studies = read_run(config, [])
    written = json.loads(json.dumps(complete_config(checked, studies)))
    assert written["studies"]["table1"]["simulation"]["stiffness"] == 150.0
    again, others = read_run(written, [])
    assert again == checked
    assert [study.describe() for study in others.values()] == [
        study.describe() for study in studies.values()
    ]


@pytest.mark.parametrize("key", ["run", "article"])
def test_a_study_that_is_not_there_is_named_with_its_line(tmp_path, key):
    path = tmp_path / "mine.yaml"
    study = {"kind": "simulation", "seed": 1, "notebook": None, "methods": {"a": {"method": "riv"}}}
    path.write_text(f"studies: {json.dumps({'mine': study})}\n{key}: [mien]\n", encoding="utf-8")
    config = yaml.safe_load(path.read_text(encoding="utf-8"))
    with pytest.raises(ConfigError, match=rf"mine.yaml, line 2: config → {key}: .*no study 'mien'"):
        read_run(config, [path])
