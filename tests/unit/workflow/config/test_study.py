"""Points, chunks and seeds of studies of simulations; recordings of a laboratory, in the file or in a table."""

from pathlib import Path

import pytest

from ankleloop_lab.checking import ConfigError
from ankleloop_workflow.config.study import read_studies


@pytest.fixture
def table1(change):
    """The study `table1` with some of its keys changed."""

    def read(**settings):
        config = change(
            "studies",
            "table1",
            "points",
            value=settings.pop("points", {"reflex_gain": [13.0, 2.0]}),
        )
        config["studies"]["table1"] |= settings
        config["run"] = ["table1"]
        return read_studies(config)[1]["table1"]

    return read


def test_trials_with_other_variables_are_in_another_file(table1):
    """A phase, a scheduling variable, or neither: the trials of a file have the same variables."""
    points = [{"variation": kind} for kind in (None, "cycle", "time", "schedule")] + [
        {"movement": 0.1}
    ]
    study = table1(points=points)
    conditions = [[part.condition for part in chunk] for chunk in study.trial_files]
    assert conditions == [[point.condition] for point in study.point_list]
    alike = table1(points={"variation": ["cycle"], "stiffness_variation": [0.0, 0.4]})
    assert len(alike.trial_files) == 1


def test_points_of_different_length_or_rate_do_not_share_a_trial_file(table1):
    points = [
        {"duration": duration, "recording_rate": rate}
        for duration in (10.0, 20.0)
        for rate in (1000.0, 500.0)
    ]
    points = [*points, {"duration": 20.0, "recording_rate": 500.0, "zeta": 0.5}]
    study = table1(points=points)
    assert [len(chunk) for chunk in study.chunks] == [1, 1, 1, 2]
    for keep in ("estimates", "scores"):
        assert [len(chunk) for chunk in table1(points=points, keep=keep, trials=20).chunks] == [5]


# --- recordings


@pytest.fixture
def read_table(example, tmp_path):
    """The study of the example with a table instead of its files."""

    def read(text, **settings):
        (tmp_path / "list.csv").write_text(text, encoding="utf-8")
        study = {
            "table": str(tmp_path / "list.csv"),
            "folder": str(tmp_path),
            "files": {},
            "defaults": {},
            **settings,
        }
        example["studies"]["recordings"] |= study
        return read_studies(example)[1]["recordings"]

    return read


def test_a_table_lists_recordings(read_table):
    """Numbers or text as their column is, defaults where a cell is empty, and names by subject, condition and trial."""
    text = (
        "file,subject,condition,trial,torque_sign,start,drift,reference\n"
        "a.mat,007,NA,1e3,-1.0,01.50,2,12\nb.csv,S1,rest,12_3,,,,\nc.csv,S1,rest,1.0,1,,,\n"
    )
    files = {"d": {"file": "d.mat", "position": "phi"}}
    defaults = {"torque_sign": -1, "position": "angle"}
    study = read_table(text, files=files, defaults=defaults, recordings_per_chunk=3)
    assert list(map(list, study.chunks)) == [["d", "007-NA-1e3", "S1-rest-12_3"], ["S1-rest-1.0"]]
    keys = ("position", "torque_sign", "start", "drift", "reference")
    assert [tuple(point[key] for key in keys) for point in study.points.values()] == [
        ("phi", -1, None, 0, None),
        ("angle", -1, 1.5, 2, "12"),
        ("angle", -1, None, 0, None),
        ("angle", 1, None, 0, None),
    ]
    assert study.existing_paths(0) == []
    with pytest.raises(ConfigError, match="unknown key 'colour'; known here: position"):
        read_table(text, defaults={"colour": 1}).points  # noqa: B018


def test_rows_with_a_common_name_are_merged(read_table):
    study = read_table("batch,name,file,drift\nB1,,a.mat,1\n,other,c.mat,\nB1,,b.mat,2\n")
    mappings = study.chunks[0]
    assert list(mappings) == ["B1", "other"]
    assert [Path(path).name for path in mappings["B1"]["paths"]] == ["a.mat", "b.mat"]
    assert [part["drift"] for part in mappings["B1"]["parts"]] == [1, 2]
    assert len(mappings["other"]["parts"]) == 1


def test_two_methods_with_one_label_are_refused(read_table):
    methods = {name: {"method": "riv", "label": "RIV"} for name in ("a", "b")}
    with pytest.raises(ConfigError, match="2 methods have the label 'RIV'"):
        read_table("name,file\ny,b.mat\n", methods=methods)
