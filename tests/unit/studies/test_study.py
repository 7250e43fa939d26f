"""Points, chunks and seeds of studies of simulations; recordings of a laboratory, in the file or in a table."""

from pathlib import Path

import pytest
import yaml

from ankleloop.studies.checking import ConfigError
from ankleloop.studies.config import NOTEBOOKS, SimulationStudy
from ankleloop.studies.study import SimulatedStudy, read_studies


@pytest.fixture
def table1(change):
    """The study `table1` with some of its keys changed."""

    def read(**settings):
        config = change("studies", "table1", "points", value=settings.pop("points", {"reflex_gain": [13.0, 2.0]}))
        config["studies"]["table1"] |= settings
        config["run"] = ["table1"]
        return read_studies(config)[1]["table1"]

    return read


@pytest.mark.parametrize(("name", "title"), [("a_load-sweep", "A load sweep"), ("PR-MOESP", "PR MOESP"), ("7", "7")])
def test_a_study_without_a_title_is_called_by_its_name(change, name, title):
    settings = change("studies", "table1", "title", value="")["studies"]["table1"]
    assert SimulatedStudy(name, SimulationStudy.model_validate(settings)).title == title
    assert SimulatedStudy(name, SimulationStudy.model_validate({**settings, "title": "Mine"})).title == "Mine"


def test_points_are_all_combinations(table1):
    study = table1(points={"reflex_gain": [2.0, 13.0], "voluntary": [0.0, 0.3, 1.0]})
    assert len(study.points) == 6
    values = {point.name: point.values for point in study.point_list}
    assert values["reflex_gain=13.0,voluntary=0.3"] == {"reflex_gain": 13.0, "voluntary": 0.3}
    assert study.varied == ["reflex_gain", "voluntary"]
    assert list(table1(points={}).points) == ["only"]


def test_trials_with_other_variables_are_in_another_file(table1):
    """A phase, a scheduling variable, or neither: the trials of a file have the same variables."""
    points = [{"variation": kind} for kind in (None, "cycle", "time", "schedule")] + [{"movement": 0.1}]
    study = table1(points=points, points_per_chunk=10)
    conditions = [[part.condition for part in chunk] for chunk in study.trial_chunks]
    assert conditions == [[point.condition] for point in study.point_list]
    alike = table1(points={"variation": ["cycle"], "stiffness_variation": [0.0, 0.4]}, points_per_chunk=10)
    assert len(alike.trial_chunks) == 1


@pytest.mark.parametrize(
    ("points", "name"),
    [
        ({"reflex_gain": [13, 13.0]}, "reflex_gain=13.0"),
        ([{"reflex_gain": 13}, {"reflex_gain": 13.0}], "reflex_gain=13.0"),
        ({"voluntary": [0.0, -0.0]}, "voluntary=0.0"),
    ],
)
def test_equal_points_are_refused(table1, points, name):
    with pytest.raises(ConfigError, match=f"the point {name} is listed twice"):
        table1(points=points)


GAINS = {"reflex_gain": [1.0, 2.0, 3.0, 4.0, 5.0]}


def chunk_points(study):
    return [[part.condition.removeprefix("reflex_gain=") for part in chunk] for chunk in study.chunks]


def test_a_chunk_is_some_points(table1):
    assert chunk_points(table1(points=GAINS, points_per_chunk=1)) == [["1.0"], ["2.0"], ["3.0"], ["4.0"], ["5.0"]]
    assert chunk_points(table1(points=GAINS, points_per_chunk=2)) == [["1.0", "2.0"], ["3.0", "4.0"], ["5.0"]]
    more = {"reflex_gain": [*GAINS["reflex_gain"], 6.0]}
    assert chunk_points(table1(points=more, points_per_chunk=2))[:2] == [["1.0", "2.0"], ["3.0", "4.0"]]
    for chunk in table1(points=GAINS, points_per_chunk=2, trials=7).chunks:
        assert all((part.first, part.stop) == (0, 7) for part in chunk)


def test_a_chunk_is_part_of_the_trials_of_a_point(table1):
    study = table1(points={"reflex_gain": [1.0, 2.0]}, trials=7, trials_per_chunk=3)
    ranges = [[(part.first, part.stop) for part in chunk] for chunk in study.chunks]
    assert ranges == [[(0, 3)], [(3, 6)], [(6, 7)]] * 2
    assert chunk_points(study) == [["1.0"]] * 3 + [["2.0"]] * 3
    assert study.trial_chunks == study.chunks
    assert [study.trial_chunk_of(chunk) for chunk in range(6)] == list(range(6))


def test_points_of_different_length_or_rate_do_not_share_a_chunk(table1):
    points = [{"duration": duration, "recording_rate": rate} for duration in (10.0, 20.0) for rate in (1000.0, 500.0)]
    points = [*points, {"duration": 20.0, "recording_rate": 500.0, "zeta": 0.5}]
    study = table1(points=points, points_per_chunk=10)
    assert [len(chunk) for chunk in study.chunks] == [1, 1, 1, 2]
    assert [len(chunk) for chunk in table1(points=points, points_per_chunk=10, keep="estimates").chunks] == [1, 1, 1, 2]
    assert [len(chunk) for chunk in table1(points=points, points_per_chunk=10, keep="scores").chunks] == [5]


def test_the_article_is_made_where_all_its_studies_are(config, change):
    assert read_studies(config)[0].article_names == config["article"]
    part = read_studies(change("run", value=["table1"]))[0]
    assert (part.run_names, part.article_names) == (["table1"], [])
    assert read_studies(change("run", value=None))[0].run_names == list(config["studies"])


def test_figures_of_a_study(table1):
    assert table1().figures == NOTEBOOKS["table1"] == ("figure3", "order")
    assert table1(notebook=None).figures == ()
    assert table1(methods={"riv": {"method": "riv"}}, figure={}).figures == ("figure3",)


# --- recordings


def recorded(config):
    return read_studies(config)[1]["recordings"]


@pytest.fixture
def tabulate(example, tmp_path):
    """The example with a table instead of its files."""

    def write(text, **settings):
        study = example["studies"]["recordings"]
        for key in ("files", "defaults"):
            study.pop(key, None)
        (tmp_path / "list.csv").write_text(text, encoding="utf-8")
        study |= {"table": str(tmp_path / "list.csv"), "folder": str(tmp_path), **settings}
        return example

    return write


def test_a_table_lists_recordings(tabulate):
    text = (
        "file,subject,condition,trial,torque_sign,start,stop,drift\na.mat,S1,rest,1,-1,2,30.5,2\nb.csv,S1,rest,2,,,,\n"
    )
    study = recorded(tabulate(text))
    assert list(study.points) == ["S1-rest-1", "S1-rest-2"]
    first, second = study.points.values()
    assert (first["torque_sign"], first["start"], first["stop"], first["drift"]) == (-1, 2, 30.5, 2)
    assert (second["torque_sign"], second["start"], second["drift"], second["position"]) == (1, None, 0, "position")
    assert [len(chunk) for chunk in study.chunks] == [2]
    assert study.existing_paths(0) == []


def test_cells_are_numbers_or_text_as_their_column_is(tabulate):
    text = "name,file,subject,condition,trial,reference,torque_sign,sampling_rate\nx,a.mat,012,NA,1.0,12,-1.0,1e3\n"
    point = recorded(tabulate(text)).points["x"]
    assert [point[key] for key in ("subject", "condition", "trial", "reference")] == ["012", "NA", "1.0", "12"]
    assert (point["torque_sign"], point["sampling_rate"]) == (-1, 1000.0)


def test_rows_override_the_defaults(tabulate):
    text = "name,file,torque_sign\na,a.mat,\nb,b.mat,1\n"
    config = tabulate(text, defaults={"torque_sign": -1, "position": "angle"})
    config["studies"]["recordings"]["files"] = {"c": {"file": "c.mat", "position": "phi"}}
    points = recorded(config).points
    assert {name: (point["torque_sign"], point["position"]) for name, point in points.items()} == {
        "a": (-1, "angle"),
        "b": (1, "angle"),
        "c": (-1, "phi"),
    }
    with pytest.raises(ConfigError, match="unknown key 'colour'; known here: position"):
        recorded(tabulate(text, defaults={"colour": 1}))


def test_rows_with_a_common_name_are_merged(tabulate):
    text = "batch,name,file,drift\nB1,,a.mat,1\n,other,c.mat,\nB1,,b.mat,2\n"
    study = recorded(tabulate(text))
    assert list(study.points) == ["B1", "other"]
    assert [Path(path).name for path in study.paths("B1")] == ["a.mat", "b.mat"]
    mappings = study.mappings(0)
    assert [part["drift"] for part in mappings["B1"]["parts"]] == [1, 2]
    assert mappings["B1"]["paths"] == study.paths("B1")
    assert len(mappings["other"]["parts"]) == 1


def test_chunks_of_recordings(tabulate):
    rows = "".join(f"r{k},{k}.mat\n" for k in range(5))
    chunks = recorded(tabulate(f"name,file\n{rows}", recordings_per_chunk=2)).chunks
    assert chunks == [["r0", "r1"], ["r2", "r3"], ["r4"]]


def test_text_of_a_table_is_kept_as_it_is_written(tabulate):
    text = "file,subject,condition,trial,start\na.mat,007,1e3,12_3,01.50\n"
    (point,) = recorded(tabulate(text)).points.values()
    assert [point[key] for key in ("subject", "condition", "trial", "start")] == ["007", "1e3", "12_3", 1.5]
    assert list(recorded(tabulate(text)).points) == ["007-1e3-12_3"]


@pytest.mark.parametrize("written", ["007", "12_3", "7", "1:30", "1.0", "no"])
def test_text_that_yaml_changes_is_refused(tabulate, written):
    """YAML reads the subject 007 as 7; in quotes it is text."""
    config = tabulate("name,file\ny,b.mat\n")
    for quoted, value in ((True, f'"{written}"'), (False, written)):
        config["studies"]["recordings"]["files"] = yaml.safe_load(f"{{x: {{file: a.mat, subject: {value}}}}}")
        if quoted:
            assert recorded(config).points["x"]["subject"] == written
            continue
        with pytest.raises(ConfigError, match=r"files → x → subject: must be text, got .*: put it in quotes"):
            recorded(config)


def test_what_would_replace_results_silently_is_refused(tabulate):
    text = "name,file\ny,b.mat\n"
    config = tabulate(text)
    methods = config["studies"]["recordings"]["methods"]
    first, second = list(methods)[:2]
    methods[second]["label"] = methods[first].get("label") or first
    with pytest.raises(ConfigError, match="2 methods have the label"):
        recorded(config)
